"""CPU time per trajectory about the Earth as it is: relnav's batched propagation beside brahe's own propagator.

1000 dispersed low orbits over 6000 s with a state every minute, under a field of degree and order 40, Sun, Moon and
drag. Each program is compared with itself at its tightest tolerance, so that the errors are those of integration. brahe
takes one trajectory at a time, so it gets fewer.

    python benchmarks/real_field.py [--quick] [--docs]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split

import numpy as np

from relnav_sim import ExponentialAtmosphere, ForceModel, GravityField, propagate
from relnav_sim.astro import constants
from relnav_sim.astro.earth_orientation import eme2000_from_gcrf, gcrf_from_eme2000
from relnav_sim.astro.orbits import Elements, state_from_elements

ROWS, PEER_ROWS = (20, 2) if bench.QUICK else (1000, 10)
TIMES = np.arange(0.0, 6001.0, 60.0)
BALLISTIC, DEGREE = 0.011, 40
FIELD = GravityField.load("ggm05s", DEGREE, DEGREE)
AIR = ExponentialAtmosphere(constants.BASE_ALTITUDE_M, constants.DENSITY_KG_M3, constants.SCALE_HEIGHT_M)
FORCE = ForceModel(
    FIELD.mu_m3_s2,
    FIELD.radius_m,
    zonals=(),
    atmosphere=AIR,
    gravity=FIELD,
    epoch="2010-07-27T00:00:00 UTC",
    third_bodies=("sun", "moon"),
)


def dispersed_states():
    """Return states within some km and m/s of a circular orbit 500 km high."""
    nominal = state_from_elements(Elements(6.878e6, 0.0, 1.5, 0.0, 0.0, 0.0), FIELD.mu_m3_s2)
    return nominal + np.random.default_rng(0).normal(size=(ROWS, 6)) * np.repeat([1000.0, 1.0], 3)


def relnav(states, rtol=1e-12):
    return propagate(states, TIMES, FORCE, BALLISTIC, rtol)


def brahe_each():
    """Return the propagation of states by brahe, with the same field, and the Earth turned by the same models."""
    import brahe as bh

    bh.set_global_eop_provider(bh.StaticEOPProvider.from_zero())
    air = bh.AtmosphericModel.exponential(AIR.scale_height_m, AIR.density_kg_m3, AIR.base_altitude_m)
    area, factor = bh.ParameterSource.value(1.0), bh.ParameterSource.value(BALLISTIC)
    low = bh.EphemerisSource.LowPrecision
    forces = bh.ForceModelConfig(
        gravity=bh.GravityConfiguration.spherical_harmonic(
            DEGREE, DEGREE, model_type=bh.GravityModelType.GGM05S, parallel=bh.ParallelMode.Never
        ),
        drag=bh.DragConfiguration(model=air, area=area, cd=factor),
        third_body=[bh.ThirdBodyConfiguration(body, low) for body in (bh.ThirdBody.SUN, bh.ThirdBody.MOON)],
        mass=bh.ParameterSource.value(1.0),
        frame_transform=bh.FrameTransformationModel.FULL_EARTH_ROTATION,
    )
    start = bh.Epoch.from_datetime(2010, 7, 27, 0, 0, 0.0, 0.0, bh.TimeSystem.UTC)
    moments = [start + float(t) for t in TIMES]

    def run(states, rel_tol):
        steps = bh.NumericalPropagationConfig.with_method(bh.IntegrationMethod.RKF78)
        steps = steps.with_abs_tol(1e3 * rel_tol).with_rel_tol(rel_tol).with_store_accelerations(True)
        steps = steps.with_interpolation_method(bh.InterpolationMethod.HERMITE_QUINTIC)
        paths = []
        for state in gcrf_from_eme2000(states):
            propagator = bh.NumericalOrbitPropagator(start, state, steps, forces)
            propagator.propagate_to(moments[-1])
            paths.append([propagator.state(moment) for moment in moments])
        return eme2000_from_gcrf(np.array(paths))

    return run


def at_the_end(paths, reference):
    """Return the largest distance of the last states, m: in between brahe interpolates, which costs it digits."""
    return np.linalg.norm((paths[:PEER_ROWS] - reference)[:, -1, :3], axis=-1).max()


def main():
    bench.keep_to_one_core()
    states = dispersed_states()
    few = states[:PEER_ROWS]
    contenders = {"relnav": bench.Contender(lambda: relnav(states), ROWS)}
    references, notes = {"relnav": relnav(few, 1e-14)}, []
    try:
        run = brahe_each()
        exact = run(few, 1e-15)
        for digits in (10, 12, 14):
            name = f"brahe, RKF78, relative tolerance 1e-{digits}"
            contenders[name] = bench.Contender(lambda rel_tol=10.0**-digits: run(few, rel_tol), PEER_ROWS)
            references[name] = exact
        notes.append(
            f"The two programs are {at_the_end(references['relnav'], exact):.0e} m apart after 6000 s, as they have "
            "different series for Sun and Moon."
        )
    except ImportError as error:
        notes.append(bench.missing(error))
    timings = bench.take_turns(contenders, rounds=3)
    errors = {name: at_the_end(timing.result, references[name]) for name, timing in timings.items()}
    rows = []
    for name in list(timings)[1:]:
        pair = {"relnav": timings["relnav"], name: timings[name]}
        apart = f"{errors[name]:.0e} m"
        rows += bench.beside("truth, 40 x 40, Sun, Moon, drag, 6000 s", pair, lambda *_, apart=apart: apart, "ms")
    notes.insert(
        0,
        "Each program is compared with itself at its tightest tolerance, at the end of the path; relnav's own error "
        f"is {errors['relnav']:.0e} m.",
    )
    bench.publish("real field", "\n\n".join([bench.side_by_side_table(rows, "ms"), " ".join(notes)]))


if __name__ == "__main__":
    main()

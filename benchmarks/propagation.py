"""CPU time per trajectory: relnav's batched propagation beside scipy, heyoka and brahe.

1000 dispersed low orbits over 6000 s with a state every second, under J2 to J4 and drag. The others take one trajectory
at a time, so they get fewer.

    python benchmarks/propagation.py [--quick] [--docs]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split

from math import exp, sqrt

import numpy as np
from scipy.integrate import solve_ivp

from relnav_sim import ExponentialAtmosphere, ForceModel, propagate
from relnav_sim.astro import constants
from relnav_sim.astro.orbits import Elements, state_from_elements

ROWS, PEER_ROWS = (20, 2) if bench.QUICK else (1000, 5)
TIMES = np.arange(6001.0)
BALLISTIC = 0.011
MU, RADIUS, TURN = constants.MU_M3_S2, constants.RADIUS_M, constants.ROTATION_RAD_S
AIR = ExponentialAtmosphere(constants.BASE_ALTITUDE_M, constants.DENSITY_KG_M3, constants.SCALE_HEIGHT_M)
FORCE = ForceModel(MU, RADIUS, (constants.J2, constants.J3, constants.J4), AIR)


def dispersed_states():
    """Return 1000 states within some km and m/s of a circular orbit at 7000 km."""
    nominal = state_from_elements(Elements(7e6, 0.0, 0.9, 0.0, 0.0, 0.0), MU)
    return nominal + np.random.default_rng(0).normal(size=(ROWS, 6)) * np.repeat([1000.0, 1.0], 3)


def slope(t, y):
    """Return the derivative for scipy: plain floats, which for one trajectory are faster than small arrays."""
    x, y, z, vx, vy, vz = y.tolist()
    r2 = x * x + y * y + z * z
    r = sqrt(r2)
    s2, q = z * z / r2, RADIUS / r
    u2, u3, u4 = 1.5 * constants.J2 * q * q, 2.5 * constants.J3 * q**3 * z / r, 0.625 * constants.J4 * q**4
    planar = 1 + u2 * (1 - 5 * s2) + u3 * (3 - 7 * s2) + u4 * (-3 + 42 * s2 - 63 * s2 * s2)
    polar = 1 + u2 * (3 - 5 * s2) + u3 * (6 - 7 * s2) + u4 * (-15 + 70 * s2 - 63 * s2 * s2)
    pull, extra = -MU / (r2 * r), 1.5 * constants.J3 * q**3 * MU / r2
    wx, wy = vx + TURN * y, vy - TURN * x
    speed = sqrt(wx * wx + wy * wy + vz * vz)
    drag = -0.5 * BALLISTIC * speed * AIR.density_kg_m3 * exp((AIR.base_altitude_m + RADIUS - r) / AIR.scale_height_m)
    return [
        vx, vy, vz,
        pull * x * planar + drag * wx, pull * y * planar + drag * wy, pull * z * polar + extra + drag * vz,
    ]  # fmt: skip


def relnav(states):
    return propagate(states, TIMES, FORCE, BALLISTIC)


def scipy_each(states, rtol=1e-12):
    scale = np.repeat([7e6, 7.5e3], 3)
    return np.stack(
        [
            solve_ivp(slope, (0, TIMES[-1]), y, method="DOP853", rtol=rtol, atol=rtol * scale, t_eval=TIMES).y.T
            for y in states
        ]
    )


def heyoka_each():
    """Return the propagation of states by heyoka's Taylor integrator, compiled before the clock starts."""
    import heyoka as hy

    x, y, z, vx, vy, vz = hy.make_vars("x", "y", "z", "vx", "vy", "vz")
    r2 = x * x + y * y + z * z
    s, q = z / hy.sqrt(r2), RADIUS / hy.sqrt(r2)
    legendre = [(3 * s**2 - 1) / 2, (5 * s**3 - 3 * s) / 2, (35 * s**4 - 30 * s**2 + 3) / 8]
    series = sum(j * q**n * p for n, j, p in zip((2, 3, 4), FORCE.zonals, legendre, strict=True))
    potential = MU / hy.sqrt(r2) * (1.0 - series)
    wx, wy = vx + TURN * y, vy - TURN * x
    height = (AIR.base_altitude_m + RADIUS - hy.sqrt(r2)) / AIR.scale_height_m
    drag = -0.5 * BALLISTIC * AIR.density_kg_m3 * hy.exp(height) * hy.sqrt(wx * wx + wy * wy + vz * vz)
    gravity = [hy.diff(potential, c) for c in (x, y, z)]
    slopes = [vx, vy, vz, *(g + drag * w for g, w in zip(gravity, (wx, wy, vz), strict=True))]
    system = list(zip((x, y, z, vx, vy, vz), slopes, strict=True))
    # Its default tolerance, 2.2e-16: at 1e-12 it is no faster and 3e-3 m off.
    integrator = hy.taylor_adaptive(system, [7e6, 0.0, 0.0, 0.0, 7.5e3, 0.0])

    def run(states):
        paths = []
        for state in states:
            integrator.time = 0.0
            integrator.state[:] = state
            paths.append(integrator.propagate_grid(TIMES)[-1])
        return np.stack(paths)

    return run


def brahe_each():
    """Return the propagation of states by brahe with its own constants of the Earth, and the force with these."""
    import brahe as bh

    bh.set_global_eop_provider(bh.StaticEOPProvider.from_zero())
    air = bh.AtmosphericModel.exponential(AIR.scale_height_m, AIR.density_kg_m3, AIR.base_altitude_m)
    area, factor = bh.ParameterSource.value(1.0), bh.ParameterSource.value(BALLISTIC)
    forces = bh.ForceModelConfig(
        gravity=bh.GravityConfiguration.earth_zonal(bh.ZonalHarmonicsDegree.J4),
        drag=bh.DragConfiguration(model=air, area=area, cd=factor),
        mass=bh.ParameterSource.value(1.0),
        frame_transform=bh.FrameTransformationModel.EARTH_ROTATION_ONLY,
    )
    steps = bh.NumericalPropagationConfig.with_method(bh.IntegrationMethod.RKF78)
    steps = steps.with_abs_tol(1e-9).with_rel_tol(1e-12).with_store_accelerations(True)
    steps = steps.with_interpolation_method(bh.InterpolationMethod.HERMITE_QUINTIC)
    start = bh.Epoch.from_datetime(2026, 1, 1, 0, 0, 0.0, 0.0, bh.TimeSystem.UTC)
    moments = [start + float(t) for t in TIMES]

    def run(states):
        paths = []
        for state in states:
            propagator = bh.NumericalOrbitPropagator(start, state, steps, forces)
            propagator.propagate_to(moments[-1])
            paths.append([propagator.state(moment) for moment in moments])
        return np.array(paths)

    return run, ForceModel(bh.GM_EARTH, bh.R_EARTH, (bh.J2_EARTH, bh.J3_EARTH, bh.J4_EARTH), AIR)


def main():
    bench.keep_to_one_core()
    states = dispersed_states()
    few, some = states[:PEER_ROWS], states[: 10 * PEER_ROWS]
    contenders = {
        "relnav": bench.Contender(lambda: relnav(states), ROWS),
        "SciPy `solve_ivp`, DOP853": bench.Contender(lambda: scipy_each(few), PEER_ROWS),
    }
    notes, others = [], {}
    try:
        each = heyoka_each()
        contenders["heyoka `taylor_adaptive`"] = bench.Contender(lambda: each(some), len(some))
    except ImportError as error:
        notes.append(bench.missing(error))
    try:
        run, force = brahe_each()
        contenders["brahe, RKF78"] = bench.Contender(lambda: run(some), len(some))
        others["brahe, RKF78"] = propagate(few, TIMES, force, BALLISTIC)
    except ImportError as error:
        notes.append(bench.missing(error))
    timings = bench.take_turns(contenders, rounds=4)
    reference = scipy_each(few, rtol=3e-14)

    def error(paths, reference):
        return np.abs(paths[:PEER_ROWS] - reference)[..., :3].max()

    rows = []
    for name, timing in timings.items():
        apart = f"{error(timing.result, others.get(name, reference)):.0e} m"
        if name != "relnav":
            pair = {"relnav": timings["relnav"], name: timing}
            rows += bench.beside("truth, 6000 s, per trajectory", pair, lambda *_, apart=apart: apart, "ms")
    notes.append(
        f"Agreement of relnav itself: {error(timings['relnav'].result, reference):.0e} m from SciPy with a relative "
        "tolerance of 3e-14, as are the others' figures. brahe has its own constants of the Earth, so it is compared "
        "with relnav's path under these."
    )
    bench.publish("propagation", "\n\n".join([bench.side_by_side_table(rows, "ms"), *notes]))


if __name__ == "__main__":
    main()

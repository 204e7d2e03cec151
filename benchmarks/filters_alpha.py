"""Filters of the alpha-divergence family: CPU time per run-step, beside an earlier relnav and beside their draws alone.

6 states, radar at 12 km, 5 Hz, 200 runs as one block (8 with 10000 samples); NIS, log-likelihood and effective sample
size included.

    python benchmarks/filters_alpha.py [--quick] [--docs]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split


import numpy as np

from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.filters.particle_set import standard_normals
from relnav_sim.measurements.converted_radar import ConvertedRadar
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar
from relnav_sim.streams import RandomSource

SIGMAS = np.array([4.0, 1.164e-3, 1.164e-3])  # m, rad, rad
# Filter, options, form of the measurement, runs and steps.
CASES = (
    ("kf", {"r_scale": 2.0}, "cartesian", 200, 60),
    ("alpha_kf", {"samples": 10_000}, "cartesian", 8, 30),
    ("alpha_kf", {"samples": 10_000, "sampling": "antithetic"}, "cartesian", 8, 30),
    ("alpha_kf", {"samples": 512, "sampling": "fixed"}, "cartesian", 200, 30),
    ("ekf", {}, "spherical", 200, 60),
    ("alpha_kf", {"samples": 10_000}, "spherical", 8, 30),
    ("alpha_kf", {"samples": 10_000, "sampling": "antithetic"}, "spherical", 8, 30),
    ("alpha_kf", {"samples": 512, "sampling": "fixed"}, "spherical", 200, 30),
    ("mkf", {"samples": 512, "sampling": "fixed", "proposal": "posterior"}, "spherical", 200, 30),
    ("skf", {}, "spherical", 8, 30),
    ("adaptive_alpha_kf", {"scheme": "gate"}, "spherical", 200, 60),
    ("adaptive_alpha_kf", {"scheme": "student_t"}, "spherical", 200, 60),
    ("adaptive_alpha_kf", {"scheme": "responsibilities"}, "spherical", 200, 60),
    ("adaptive_alpha_kf", {"scheme": "windowed_nis"}, "spherical", 200, 60),
)


def measurement_of(form):
    noise = SightNoise(
        weights=np.array([0.9, 0.1]),
        deviations=SIGMAS * np.array([[1.0], [10.0]]),
        nominal=SIGMAS,
        attitude=np.zeros((3, 3)),
        assumed="nominal",
    )
    return (SphericalRadar if form == "spherical" else ConvertedRadar)(np.eye(3), noise)


def motion():
    return van_loan(cw_system(1.05e-3), np.vstack([np.zeros((3, 3)), np.eye(3)]), 1e-6 * np.eye(3), 0.2)


def problem(form, runs, steps):
    rng = np.random.default_rng(1)
    F, Q = motion()
    measurement = measurement_of(form)
    x = np.broadcast_to([0.0, 12_000.0, 200.0, 0.0, 0.0, 0.0], (runs, 6)).copy()
    cov0 = np.diag([14.0, 4.0, 14.0, 0.1, 0.1, 0.1]) ** 2
    mean0 = x + rng.standard_normal((runs, 6)) * np.sqrt(np.diag(cov0))
    root = np.linalg.cholesky(Q)
    z = np.empty((runs, steps, 3))
    for k in range(steps):
        x = x @ F.T + rng.standard_normal((runs, 6)) @ root.T
        noise = np.linalg.cholesky(np.broadcast_to(measurement.noise(x, k), (runs, 3, 3)))
        z[:, k] = measurement.predict(x, k) + np.einsum("bij,bj->bi", noise, rng.standard_normal((runs, 3)))
    return LinearDynamics(F, Q), measurement, z, mean0, cov0


def fixed_samples(runs=200, steps=30):
    """Return the alpha filter with 512 fixed samples on the spherical radar."""
    dynamics, measurement, z, mean0, cov0 = problem("spherical", runs, steps)
    filter = create_filter("alpha_kf", dynamics, measurement, samples=512, sampling="fixed")
    return bench.Contender(lambda: run_filter(filter, z, mean0, cov0).mean, runs * steps)


def draws_alone(runs, steps):
    """Return the draw of the 10000 samples of three observed states, of every run and epoch."""

    def run():
        streams = RandomSource(0, tuple(range(runs))).streams("filter.alpha_kf.samples")
        for _ in range(steps):
            standard_normals(streams, 3, 10_000)

    return bench.Contender(run, runs * steps)


def random_samples(runs, steps):
    """Return the alpha filter with 10000 random samples on the spherical radar."""
    dynamics, measurement, z, mean0, cov0 = problem("spherical", runs, steps)
    filter = create_filter("alpha_kf", dynamics, measurement, samples=10_000)
    return bench.Contender(lambda: run_filter(filter, z, mean0, cov0).mean, runs * steps)


# The filter of an earlier commit, by itself: its modules have other names. Prints seconds and where the means ended.
EARLIER = """
import json, sys, time
import numpy as np
from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.models.radar import PolarRadar, RadarNoise
given = np.load(sys.argv[1])
sigmas = given["sigmas"]
noise = RadarNoise(np.array([0.9, 0.1]), sigmas * np.array([[1.0], [10.0]]), sigmas, np.zeros((3, 3)), "nominal")
measurement = PolarRadar(np.eye(3), noise)
dynamics = LinearDynamics(given["F"], given["Q"])
filter = create_filter("alpha_kf", dynamics, measurement, samples=512, sampling="fixed")
spent = []
for _ in range(int(sys.argv[2])):
    began = time.process_time()
    history = run_filter(filter, given["z"], given["mean0"], given["cov0"])
    spent.append(time.process_time() - began)
print(json.dumps({"seconds": min(spent), "mean": history.mean.tolist()}))
"""


def earlier(tree, runs, steps):
    """Return the filter of the earlier commit on the same tracks: a process of its own each round."""
    _, _, z, mean0, cov0 = problem("spherical", runs, steps)
    F, Q = motion()
    given = bench.ROOT / "build" / "alpha_kf.npz"
    np.savez(given, F=F, Q=Q, z=z, mean0=mean0, cov0=cov0, sigmas=SIGMAS)
    return bench.Contender(
        lambda: bench.in_tree(tree, EARLIER, str(given), "2" if bench.QUICK else "4"),
        runs * steps,
        clock=lambda told: told["seconds"],
    )


def apart(relnav, told):
    return f"{np.abs(relnav - np.array(told['mean']))[..., :3].max():.0e} m"


def family():
    """Return a row for each case."""
    contenders = {}
    for kind, options, form, runs, steps in CASES:
        dynamics, measurement, z, mean0, cov0 = problem(form, runs, 3 if bench.QUICK else steps)
        filter = create_filter(kind, dynamics, measurement, **options)
        label = f"`{kind}` {form} {', '.join(f'{name}: {value}' for name, value in options.items())}".strip()
        contenders[label] = bench.Contender(
            lambda filter=filter, z=z, mean0=mean0, cov0=cov0: run_filter(filter, z, mean0, cov0),
            z.shape[0] * z.shape[1],
        )
    timings = bench.take_turns(contenders, rounds=6)
    ekf = timings["`ekf` spherical"].us
    return [
        f"| {label} | {bench.significant(timing.us)} | {bench.significant(timing.us / ekf)} |"
        for label, timing in timings.items()
    ]


def main():
    bench.keep_to_one_core()
    runs, steps = 200, 5 if bench.QUICK else 30
    contenders, notes = {"relnav": fixed_samples(runs, steps)}, []
    tree = bench.baseline()
    if tree is None:
        notes.append(f"The history of commit {bench.BASELINE} is not here, so relnav of that commit is left out.")
    else:
        contenders[f"relnav at {bench.BASELINE}"] = earlier(tree, runs, steps)
    rows = bench.beside(
        "`alpha_kf`, 512 fixed samples, 200 runs, per run-step", bench.take_turns(contenders, rounds=5), apart
    )
    timings = bench.take_turns({"relnav": random_samples(8, steps), "its draws alone": draws_alone(8, steps)}, rounds=5)
    rows += bench.beside(
        "`alpha_kf`, 10000 random samples, 8 runs, per run-step", timings, lambda *_: "(a part of the filter)"
    )
    bench.publish("alpha filters", "\n\n".join([bench.side_by_side_table(rows, "us"), *notes]))
    bench.publish("alpha family", bench.table(["filter", "us per run-step", "times `ekf`"], family()))


if __name__ == "__main__":
    main()

"""CPU time per filter step of the alpha-divergence family, beside the Kalman filters that it approximates.

6 states, radar at 12 km, 5 Hz, 200 runs as one block (8 with 10000 samples). One core, one BLAS thread; NIS,
log-likelihood and effective sample size included. The rounds take turns and the smallest time of each counts.

    python benchmarks/filters_alpha.py
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import time

import numpy as np

from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.measurements.converted_radar import ConvertedRadar
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar

ROUNDS = 12
SIGMAS = np.array([4.0, 1.164e-3, 1.164e-3])  # m, rad, rad
# Filter, options, form of the measurement, runs, steps, and the most that it may cost, us.
CASES = (
    ("kf", {"r_scale": 2.0}, "cartesian", 200, 60, None),
    ("alpha_kf", {"samples": 10_000}, "cartesian", 8, 30, 700),
    ("alpha_kf", {"samples": 10_000, "sampling": "antithetic"}, "cartesian", 8, 30, None),
    ("alpha_kf", {"samples": 512, "sampling": "fixed"}, "cartesian", 200, 30, 15),
    ("ekf", {}, "spherical", 200, 60, None),
    ("alpha_kf", {"samples": 10_000}, "spherical", 8, 30, 700),
    ("alpha_kf", {"samples": 10_000, "sampling": "antithetic"}, "spherical", 8, 30, None),
    ("alpha_kf", {"samples": 512, "sampling": "fixed"}, "spherical", 200, 30, 15),
    ("mkf", {"samples": 512, "sampling": "fixed", "proposal": "posterior"}, "spherical", 200, 30, None),
    ("skf", {}, "spherical", 8, 30, None),
    ("adaptive_alpha_kf", {"scheme": "gate"}, "spherical", 200, 60, None),
    ("adaptive_alpha_kf", {"scheme": "student_t"}, "spherical", 200, 60, None),
    ("adaptive_alpha_kf", {"scheme": "responsibilities"}, "spherical", 200, 60, None),
    ("adaptive_alpha_kf", {"scheme": "windowed_nis"}, "spherical", 200, 60, None),
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


def problem(form, runs, steps):
    rng = np.random.default_rng(1)
    input_matrix = np.vstack([np.zeros((3, 3)), np.eye(3)])
    F, Q = van_loan(cw_system(1.05e-3), input_matrix, 1e-6 * np.eye(3), 0.2)
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


def main():
    prepared = []
    for kind, options, form, runs, steps, most in CASES:
        dynamics, measurement, z, mean0, cov0 = problem(form, runs, steps)
        filter = create_filter(kind, dynamics, measurement, **options)
        prepared.append((filter, z, mean0, cov0, most, f"{kind} {form} {options or ''}"))
    best = [np.inf] * len(CASES)
    for _ in range(ROUNDS):
        for i, (filter, z, mean0, cov0, *_) in enumerate(prepared):
            start = time.process_time()
            history = run_filter(filter, z, mean0, cov0)
            best[i] = min(best[i], (time.process_time() - start) / history.nis.size * 1e6)
    ekf = next(cost for cost, case in zip(best, CASES, strict=True) if case[0] == "ekf")
    print(f"{'us per run-step':>16} {'times ekf':>10} {'allowed':>8}")
    for cost, (*_, most, label) in zip(best, prepared, strict=True):
        print(f"{cost:16.1f} {cost / ekf:10.1f} {most or '':>8}  {label}")


if __name__ == "__main__":
    main()

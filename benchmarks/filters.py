"""CPU time per filter step: relnav's batched filters beside kalman-py and filterpy, on the same problem in one run.

6 states, range, azimuth and elevation, 3000 steps. relnav filters 200 runs as one block; the peers filter one run at a
time, so they get fewer runs. One core, one BLAS thread; NIS and log-likelihood are computed by all. The rounds take
turns and the smallest time of each counts, so that a busy machine does not favour anyone.

    python benchmarks/filters.py
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import sys
import time
from pathlib import Path

import filterpy.kalman
import kalman_py
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "filters"))
from radar_problem import polar, polar_jacobian, radar_problem

from relnav_sim import create_filter, run_filter

RUNS, STEPS, ROUNDS = 200, 3000, 3
PEER_STEPS = 1000


def wrapped(a, b):
    difference = np.array(a) - b
    difference[..., 1:] = np.mod(difference[..., 1:] + np.pi, 2 * np.pi) - np.pi
    return difference


def relnav(kind):
    def run(problem):
        filter = create_filter(kind, problem.dynamics, problem.measurement)
        history = run_filter(filter, problem.z, problem.mean0, problem.cov0)
        return history.nis.size, history.mean[0]

    return run


def kalman_py_ekf(problem):
    peer = kalman_py.ExtendedKalmanFilter(
        lambda x, dt: problem.F @ x, polar, problem.Q, problem.R, problem.mean0[0], problem.cov0,
        jac_f=lambda x, dt: problem.F, jac_h=polar_jacobian, residual_z=wrapped,
    )  # fmt: skip
    return PEER_STEPS, peer.filter(problem.z[0, :PEER_STEPS], 1.0).means


def kalman_py_ukf(problem):
    peer = kalman_py.UnscentedKalmanFilter(
        lambda x, dt: problem.F @ x, polar, problem.Q, problem.R, problem.mean0[0], problem.cov0,
        alpha=1.0, beta=0.0, kappa=0.0, residual_z=wrapped,
    )  # fmt: skip
    return PEER_STEPS, peer.filter(problem.z[0, :PEER_STEPS], 1.0).means


def filterpy_ekf(problem):
    peer = filterpy.kalman.ExtendedKalmanFilter(dim_x=6, dim_z=3)
    peer.x, peer.P = problem.mean0[0].copy(), problem.cov0.copy()
    peer.F, peer.Q, peer.R = problem.F, problem.Q, problem.R
    means = []
    for z in problem.z[0, :PEER_STEPS]:
        peer.predict()
        peer.update(z, polar_jacobian, polar, residual=wrapped)
        means.append(peer.x.copy())
        (peer.mahalanobis**2, peer.log_likelihood)
    return PEER_STEPS, np.array(means)


def filterpy_ukf(problem):
    points = filterpy.kalman.MerweScaledSigmaPoints(6, alpha=1.0, beta=0.0, kappa=0.0)
    peer = filterpy.kalman.UnscentedKalmanFilter(6, 3, 1.0, polar, lambda x, dt: problem.F @ x, points)
    peer.residual_z = wrapped
    peer.x, peer.P, peer.Q, peer.R = problem.mean0[0].copy(), problem.cov0.copy(), problem.Q, problem.R
    peer.z_mean = lambda sigmas, weights: sigmas[0] + weights @ wrapped(sigmas, sigmas[0])
    means = []
    for z in problem.z[0, :PEER_STEPS]:
        peer.predict()
        peer.update(z)
        means.append(peer.x.copy())
        (peer.mahalanobis**2, peer.log_likelihood)
    return PEER_STEPS, np.array(means)


def main():
    problem = radar_problem(runs=RUNS, steps=STEPS)
    for kind, peers in (
        ("ekf", {"kalman-py": kalman_py_ekf, "filterpy": filterpy_ekf}),
        ("ukf", {"kalman-py": kalman_py_ukf, "filterpy": filterpy_ukf}),
    ):
        contenders = {"relnav": relnav(kind), **peers}
        best = dict.fromkeys(contenders, np.inf)
        means = {}
        for _ in range(ROUNDS):
            for name, run in contenders.items():
                begin = time.process_time()
                steps, means[name] = run(problem)
                best[name] = min(best[name], 1e6 * (time.process_time() - begin) / steps)
        for name, cost in best.items():
            apart = np.abs(means[name] - means["relnav"][: len(means[name])])[:, :3].max()
            print(
                f"{kind}  {name:10s} {cost:8.2f} us per run-step   {cost / best['relnav']:6.1f} x relnav"
                f"   largest difference in position {apart:.1e} m"
            )


if __name__ == "__main__":
    main()

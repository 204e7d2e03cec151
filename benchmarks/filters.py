"""Kalman filters beside other libraries, on the same data: CPU time per run-step and how far the means are apart.

Clohessy-Wiltshire motion, range and two angles by a radar 5 km behind, 6 states. relnav filters 1, 50 or 200 runs as
one block, as dynamax does with vmap; kalman-py, filterpy and Stone Soup filter one run at a time. NIS and
log-likelihood are computed by all that have them.

    python benchmarks/filters.py [--quick] [--docs]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split

from dataclasses import dataclass

import numpy as np
from radar_problem import MEAN_MOTION, SIGMAS, polar, polar_jacobian

from relnav_sim import FunctionMeasurement, LinearDynamics, create_filter, run_filter
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar

STEPS = {1: 3000, 50: 1000, 200: 1000}
PEER_STEPS = 500
if bench.QUICK:
    STEPS, PEER_STEPS = dict.fromkeys(STEPS, 40), 40
STEP_S = 2.0


@dataclass(frozen=True)
class Problem:
    F: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    z: np.ndarray
    mean0: np.ndarray
    cov0: np.ndarray


def problem(runs, steps):
    """Return tracks that never cross the azimuth of +-pi: dynamax cannot wrap a difference of angles."""
    rng = np.random.default_rng(7)
    F, Q = van_loan(cw_system(MEAN_MOTION), np.vstack([np.zeros((3, 3)), np.eye(3)]), 1e-7 * np.eye(3), STEP_S)
    cov0 = np.diag([10.0, 10.0, 10.0, 0.1, 0.1, 0.1]) ** 2
    x = np.broadcast_to([0.0, 5000.0, 200.0, 0.0, 0.0, 0.0], (runs, 6)).copy()
    mean0 = x + rng.standard_normal((runs, 6)) * np.sqrt(np.diag(cov0))
    z, root = np.empty((runs, steps, 3)), np.linalg.cholesky(Q)
    for k in range(steps):
        x = x @ F.T + rng.standard_normal((runs, 6)) @ root.T
        z[:, k] = polar(x) + SIGMAS * rng.standard_normal((runs, 3))
    return Problem(F, Q, np.diag(SIGMAS**2), z, mean0, cov0)


def relnav(kind, given, measurement):
    filter = create_filter(kind, LinearDynamics(given.F, given.Q), measurement)
    return bench.Contender(
        lambda: run_filter(filter, given.z, given.mean0, given.cov0).mean, given.z.shape[0] * given.z.shape[1]
    )


def radar():
    axes = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # those of the state, from the nadir frame
    return SphericalRadar(axes, SightNoise(np.ones(1), SIGMAS[None], SIGMAS, np.zeros((3, 3)), assumed="nominal"))


def functions(given):
    return FunctionMeasurement(polar, given.R, polar_jacobian, angles=(1, 2))


def wrapped(a, b):
    difference = np.array(a) - b
    difference[..., 1:] = np.mod(difference[..., 1:] + np.pi, 2 * np.pi) - np.pi
    return difference


def kalman_py(kind, given):
    import kalman_py

    z, m, P = given.z[0, :PEER_STEPS], given.mean0[0], given.cov0
    if kind == "ekf":
        peer = kalman_py.ExtendedKalmanFilter(
            lambda x, dt: given.F @ x, polar, given.Q, given.R, m, P,
            jac_f=lambda x, dt: given.F, jac_h=polar_jacobian, residual_z=wrapped,
        )  # fmt: skip
    else:
        peer = kalman_py.UnscentedKalmanFilter(
            lambda x, dt: given.F @ x, polar, given.Q, given.R, m, P,
            alpha=1.0, beta=0.0, kappa=0.0, residual_z=wrapped,
        )  # fmt: skip
    return bench.Contender(lambda: np.asarray(peer.filter(z, STEP_S).means)[None], len(z))


def filterpy(kind, given):
    import filterpy.kalman

    def run():
        if kind == "ekf":
            peer = filterpy.kalman.ExtendedKalmanFilter(dim_x=6, dim_z=3)
            peer.F = given.F
        else:
            points = filterpy.kalman.MerweScaledSigmaPoints(6, alpha=1.0, beta=0.0, kappa=0.0)
            peer = filterpy.kalman.UnscentedKalmanFilter(6, 3, STEP_S, polar, lambda x, dt: given.F @ x, points)
            peer.residual_z = wrapped
            peer.z_mean = lambda sigmas, weights: sigmas[0] + weights @ wrapped(sigmas, sigmas[0])
        peer.x, peer.P, peer.Q, peer.R = given.mean0[0].copy(), given.cov0.copy(), given.Q, given.R
        means = []
        for z in given.z[0, :PEER_STEPS]:
            peer.predict()
            peer.update(z, polar_jacobian, polar, residual=wrapped) if kind == "ekf" else peer.update(z)
            means.append(peer.x.copy())
            (peer.mahalanobis**2, peer.log_likelihood)
        return np.array(means)[None]

    return bench.Contender(run, PEER_STEPS)


def stone_soup(kind, given):
    from datetime import datetime, timedelta

    from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor, UnscentedKalmanPredictor
    from stonesoup.types.array import CovarianceMatrix, StateVector, StateVectors
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater, UnscentedKalmanUpdater

    class Radar(NonLinearGaussianMeasurement):
        @property
        def ndim_meas(self):
            return 3

        def function(self, state, noise=False, **others):
            vector = state.state_vector
            reading = polar(np.asarray(vector, dtype=float).T).T
            return (StateVectors if reading.ndim == 2 and reading.shape[1] > 1 else StateVector)(reading)

        def jacobian(self, state, **others):
            return polar_jacobian(np.asarray(state.state_vector, dtype=float)[:, 0])

        def rvs(self, *given, **others):
            raise NotImplementedError  # the base class wants it; the filters don't call it

        def pdf(self, *given, **others):
            raise NotImplementedError  # as above

    motion = LinearGaussianTimeInvariantTransitionModel(
        transition_matrix=given.F, covariance_matrix=CovarianceMatrix(given.Q)
    )
    sensor = Radar(ndim_state=6, mapping=(0, 1, 2), noise_covar=CovarianceMatrix(given.R))
    if kind == "ekf":
        predictor, updater = ExtendedKalmanPredictor(motion), ExtendedKalmanUpdater(sensor)
    else:
        same = {"alpha": 1.0, "beta": 0.0, "kappa": 1e-12}  # 0 stands for its default, 3 - n
        predictor, updater = UnscentedKalmanPredictor(motion, **same), UnscentedKalmanUpdater(sensor, **same)
    start = datetime(2026, 1, 1)
    times = [start + timedelta(seconds=STEP_S * (k + 1)) for k in range(PEER_STEPS)]

    def run():
        state = GaussianState(StateVector(given.mean0[0]), CovarianceMatrix(given.cov0), timestamp=start)
        means = []
        for z, moment in zip(given.z[0, :PEER_STEPS], times, strict=True):
            predicted = predictor.predict(state, timestamp=moment)
            state = updater.update(SingleHypothesis(predicted, Detection(StateVector(z), timestamp=moment)))
            means.append(np.asarray(state.state_vector, dtype=float)[:, 0])
        return np.array(means)[None]

    return bench.Contender(run, PEER_STEPS)


def dynamax(kind, given):
    """Return its filter over all runs by vmap, compiled for arrays of double precision."""
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp
    from dynamax.nonlinear_gaussian_ssm import (
        ParamsNLGSSM,
        UKFHyperParams,
        extended_kalman_filter,
        unscented_kalman_filter,
    )

    def h(x):
        rho = jnp.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
        return jnp.array([rho, jnp.arctan2(x[1], x[0]), jnp.arcsin(-x[2] / rho)])

    F = jnp.asarray(given.F)

    def one(mean, z):
        # It begins with an update, so it is given the prediction.
        params = ParamsNLGSSM(
            F @ mean, F @ given.cov0 @ F.T + given.Q, lambda x: F @ x, jnp.asarray(given.Q), h, jnp.asarray(given.R)
        )
        fields = ["filtered_means", "filtered_covariances"]
        if kind == "ekf":
            found = extended_kalman_filter(params, z, output_fields=fields)
        else:
            found = unscented_kalman_filter(params, z, UKFHyperParams(1.0, 0.0, 0.0), output_fields=fields)
        return found.filtered_means, found.filtered_covariances, found.marginal_loglik

    block = jax.jit(jax.vmap(one))
    mean0, z = jnp.asarray(given.mean0), jnp.asarray(given.z)
    return bench.Contender(
        lambda: np.asarray(jax.block_until_ready(block(mean0, z))[0]), given.z.shape[0] * given.z.shape[1]
    )


PEERS = {"kalman-py": kalman_py, "dynamax": dynamax, "filterpy": filterpy, "Stone Soup": stone_soup}


def apart(relnav, peer):
    """Say how far the means are apart, in position."""
    runs, steps = peer.shape[:2]
    return f"{np.abs(relnav[:runs, :steps] - peer)[..., :3].max():.0e} m"


def main():
    bench.keep_to_one_core()
    rows, notes = [], []
    for kind in ("ekf", "ukf"):
        for runs, steps in STEPS.items():
            given = problem(runs, steps)
            contenders = {
                "relnav": relnav(kind, given, radar()),
                "relnav, the radar as Python functions": relnav(kind, given, functions(given)),
            }
            for name, make in PEERS.items():
                try:
                    contenders[name] = make(kind, given)
                except ImportError as error:
                    notes.append(bench.missing(error))
            timings = bench.take_turns(contenders, rounds=4)
            many = "1 run" if runs == 1 else f"{runs} runs"
            rows += bench.beside(f"`{kind}`, {many}, per run-step", timings, apart)
    bench.publish("filters", "\n\n".join([bench.side_by_side_table(rows, "us"), *dict.fromkeys(notes)]))


if __name__ == "__main__":
    main()

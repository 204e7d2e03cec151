import numpy as np
import pytest
from radar_problem import polar, polar_jacobian, radar_problem
from scipy import stats

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.streams import RandomSource

F = np.array([[1.0, 1.0], [0.0, 1.0]])
Q = np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
H, P0 = np.array([[1.0, 0.0]]), np.eye(2)
DYNAMICS = LinearDynamics(F, Q)
STEP = Step(0)


class PerParticle(LinearDynamics):
    """The same process noise, given particle by particle."""

    def process_noise(self, states, step):
        return np.broadcast_to(super().process_noise(states, step), (*states.shape, states.shape[-1])).copy()


def linear_track(runs, steps, r, seed=0):
    rng = np.random.default_rng(seed)
    x, z = rng.standard_normal((runs, 2)), np.empty((runs, steps, 1))
    for k in range(steps):
        x = x @ F.T + rng.standard_normal((runs, 2)) @ np.linalg.cholesky(Q).T
        z[:, k] = x[:, :1] + np.sqrt(r) * rng.standard_normal((runs, 1))
    return z


def predicted_set(filter, mean, covariance, runs=1):
    prior = Gaussian(np.broadcast_to(mean, (runs, len(mean))).copy(), np.stack([covariance] * runs))
    return filter.predict(filter.start(prior, RandomSource(0, tuple(range(runs)))), STEP)


def proposal_moments(proposal, root):
    """Return mean (N, n) and covariance (N, n, n) of every particle's q, run 0, by drawing with unit vectors."""
    _, r, N = proposal.mean.shape
    at_zero, _ = proposal.draw(np.zeros((1, r, N)))
    columns = []
    for j in range(r):
        unit = np.zeros((1, r, N))
        unit[:, j] = 1
        columns.append(proposal.draw(unit)[0] - at_zero)
    A = np.stack(columns, axis=-1)[0].swapaxes(0, 1)
    return at_zero[0].T, A @ A.swapaxes(-1, -2)


@pytest.mark.parametrize("dynamics", [DYNAMICS, PerParticle(F, Q)])
def test_with_a_linear_measurement_the_proposal_is_the_exact_conditional(dynamics):
    measurement = LinearMeasurement(np.array([[1.0, 0.0], [0.3, 2.0]]), np.array([[0.2, 0.05], [0.05, 0.1]]))
    filter = create_filter("unscented_particle", dynamics, measurement, particles=20, roughening=0.0)
    particle_set = predicted_set(filter, np.zeros(2), P0)
    z = np.array([[1.0, -2.0]])
    mean, covariance = proposal_moments(filter._propose(particle_set, z, STEP), particle_set.root)
    G = measurement.jacobian(mean, 0)
    gain = Q @ G.T @ np.linalg.inv(G @ Q @ G.T + measurement.noise(mean, 0))
    for i in range(20):
        centre = particle_set.centres[0, :, i]
        np.testing.assert_allclose(mean[i], centre + gain @ (z[0] - G @ centre), atol=1e-12)
        np.testing.assert_allclose(covariance[i], Q - gain @ G @ Q, atol=1e-12)


def test_each_proposal_is_the_unscented_update_of_its_transition_density():
    covariance = np.diag([30.0, 20.0, 10.0, 0.1, 0.1, 0.1]) ** 2
    R = np.array([[16.0, 2e-3, 0.0], [2e-3, 1.44e-6, 1e-7], [0.0, 1e-7, 1.44e-6]])
    measurement = FunctionMeasurement(polar, R, polar_jacobian, angles=(1, 2))
    dynamics = LinearDynamics(np.eye(6), covariance)
    filter = create_filter("unscented_particle", dynamics, measurement, particles=15, roughening=0.0)
    particle_set = predicted_set(filter, np.array([-300.0, 5.0, 100.0, 0.0, 0.0, 0.0]), 0.01 * covariance)
    z = polar(np.array([[-310.0, -20.0, 110.0, 0.0, 0.0, 0.0]]))
    proposal = filter._propose(particle_set, z, STEP)
    mean, spread = proposal_moments(proposal, particle_set.root)
    # One run for each particle: the unscented filter with the same square root of Q draws the same sigma points.
    ukf = create_filter("ukf", dynamics, measurement)
    belief = Gaussian(particle_set.centres[0].T.copy(), np.stack([covariance] * 15))
    posterior, _ = ukf.update(belief, np.repeat(z, 15, axis=0), STEP)
    scale = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(mean / scale, posterior.mean / scale, atol=1e-9)
    np.testing.assert_allclose(
        spread / np.outer(scale, scale), posterior.covariance / np.outer(scale, scale), atol=1e-9
    )


def test_log_ratio_is_that_of_the_densities():
    measurement = LinearMeasurement(H, [[0.3]])
    filter = create_filter("unscented_particle", DYNAMICS, measurement, particles=30, roughening=0.0)
    particle_set = predicted_set(filter, np.zeros(2), P0)
    proposal = filter._propose(particle_set, np.array([[1.5]]), STEP)
    mean, covariance = proposal_moments(proposal, particle_set.root)
    states, log_ratio = proposal.draw(particle_set.noise)
    for i in range(30):
        p = stats.multivariate_normal.logpdf(states[0, :, i], particle_set.centres[0, :, i], Q)
        q = stats.multivariate_normal.logpdf(states[0, :, i], mean[i], covariance[i])
        np.testing.assert_allclose(log_ratio[0, i], p - q, atol=1e-9)


@pytest.mark.parametrize("r", [1.0, 1e-6, 1e-12])
def test_with_a_linear_measurement_the_weight_is_that_of_the_ancestor_alone(r):
    """p(z | x) p(x | a) / q(x) = p(z | a) wherever x was drawn, however peaked the likelihood."""
    measurement = LinearMeasurement(H, [[r]])
    filter = create_filter("unscented_particle", DYNAMICS, measurement, particles=40, ess_fraction=0.0, roughening=0.0)
    particle_set = predicted_set(filter, np.zeros(2), P0)
    z = np.array([[0.7]])
    posterior, innovation = filter.update(particle_set, z, STEP)
    score = stats.norm.logpdf(0.7, particle_set.centres[0, 0], np.sqrt(Q[0, 0] + r))
    # Rounding of the state against the sensor's sigma is all that is left.
    tolerance = 1e-9 + 1e-13 / r**0.5
    np.testing.assert_allclose(innovation.log_likelihood[0], np.log(np.exp(score).mean()), atol=tolerance)
    weights = np.exp(score - score.max())
    np.testing.assert_allclose(np.exp(posterior.log_weights[0]), weights / weights.sum(), atol=tolerance)


def test_process_noise_may_be_tiny_and_singular():
    tied = np.array([[0.5], [1.0]])
    measurement = LinearMeasurement(H, [[1e-4]])
    for Q_small in (1e-24 * Q, 1e-16 * tied @ tied.T, np.diag([0.0, 1e-12])):
        filter = create_filter("unscented_particle", LinearDynamics(F, Q_small), measurement, particles=200)
        history = run_filter(filter, linear_track(3, 15, 1e-4), np.zeros(2), P0)
        assert np.isfinite(history.mean).all()
        assert np.isfinite(history.log_likelihood).all()


def test_beats_the_bootstrap_filter_at_equal_numbers_on_a_peaked_likelihood():
    r, runs, particles = 1e-4, 100, 300
    z = linear_track(runs, 15, r)
    measurement = LinearMeasurement(H, [[r]])
    exact = run_filter(create_filter("kf", DYNAMICS, measurement), z, np.zeros(2), P0)
    deviation = np.sqrt(np.einsum("btii->bti", exact.covariance))
    error, ess = {}, {}
    for kind, options in (("particle", {"roughening": 0.0}), ("unscented_particle", {})):
        filter = create_filter(kind, DYNAMICS, measurement, particles=particles, **options)
        history = run_filter(filter, z, np.zeros(2), P0)
        error[kind] = np.sqrt(np.square((history.mean - exact.mean) / deviation).mean())
        ess[kind] = history.extras["ess"].mean()
    assert error["unscented_particle"] < 0.15
    assert error["particle"] > 10 * error["unscented_particle"]
    assert ess["unscented_particle"] > 10 * ess["particle"]


@pytest.mark.slow
def test_evidence_is_unbiased():
    runs, r = 1000, 1e-2
    z = linear_track(runs, 12, r)
    measurement = LinearMeasurement(H, [[r]])
    exact = run_filter(create_filter("kf", DYNAMICS, measurement), z, np.zeros(2), P0).log_likelihood.sum(axis=1)
    filter = create_filter("unscented_particle", DYNAMICS, measurement, particles=300, roughening=0.0)
    history = run_filter(filter, z, np.zeros(2), P0)
    difference = history.log_likelihood.sum(axis=1) - exact
    ratio = np.exp(difference)
    assert difference.std() < 1
    assert abs(ratio.mean() - 1) < 3.5 * ratio.std() / np.sqrt(runs)
    accepted = history.extras["accepted"]
    # The optimal proposal is the target itself: every move is accepted, where there were moves.
    np.testing.assert_allclose(accepted[history.extras["resampled"] == 1], 1)
    assert np.isnan(accepted[history.extras["resampled"] == 0]).all()


def test_moves_leave_the_posterior_as_it_is():
    """On a curved measurement, where the proposals are not exact: against a bootstrap filter of many particles."""
    measurement = FunctionMeasurement(lambda x, epoch: np.hypot(x[..., :1], x[..., 1:2]), [[0.01]])
    dynamics = LinearDynamics(np.eye(2), np.diag([0.5, 0.3]))
    z = np.full((60, 1, 1), 2.0)
    options = {"particles": 1000, "ess_fraction": 1.0, "roughening": 0.0}
    particle_sets = {}
    for steps in (0, 8):
        filter = create_filter("unscented_particle", dynamics, measurement, mcmc_steps=steps, **options)
        particle_set = predicted_set(filter, np.array([1.5, 0.5]), 0.05 * np.eye(2), runs=60)
        posterior, innovation = filter.update(particle_set, z[:, 0], STEP)
        particle_sets[steps] = posterior.states
        if steps:
            assert 0.5 < innovation.extras["accepted"].mean() < 1
    rng = np.random.default_rng(0)
    x = np.array([1.5, 0.5]) + rng.standard_normal((2_000_000, 2)) * np.sqrt([0.55, 0.35])
    weights = np.exp(-0.5 * np.square(np.hypot(*x.T) - 2.0) / 0.01)
    for moment in (lambda x: x[..., 0], lambda x: x[..., 1], lambda x: x[..., 1] ** 2):
        expected = np.average(moment(x), weights=weights)
        found = moment(particle_sets[8]).mean(axis=1)
        assert abs(found.mean() - expected) < 4.5 * found.std() / np.sqrt(60) + 2e-3
    assert len(np.unique(particle_sets[8][0, :, 0])) > 1.2 * len(np.unique(particle_sets[0][0, :, 0]))


def test_matches_the_unscented_filter_in_orbit():
    p = radar_problem(runs=6, steps=90)
    ukf = run_filter(create_filter("ukf", p.dynamics, p.measurement), p.z, p.mean0, p.cov0)
    filter = create_filter("unscented_particle", p.dynamics, p.measurement, particles=1500)
    found = run_filter(filter, p.z, p.mean0, p.cov0)
    deviation = np.sqrt(np.einsum("btii->bti", ukf.covariance))
    assert np.sqrt(np.square((found.mean - ukf.mean) / deviation)[:, 20:].mean()) < 0.3
    squares = [np.square(h.mean - p.truth)[:, 20:, :3].sum(axis=2).mean() for h in (found, ukf)]
    assert np.sqrt(squares[0] / squares[1]) < 1.06


def test_bits_do_not_depend_on_the_block():
    p = radar_problem(runs=3, steps=10)
    p.z[1, 3:6] = np.nan
    for dynamics in (p.dynamics, PerParticle(p.F, p.Q)):

        def run(rows, dynamics=dynamics):
            filter = create_filter("unscented_particle", dynamics, p.measurement, particles=111, mcmc_steps=2)
            return run_filter(filter, p.z[rows], p.mean0[rows], p.cov0, runs=rows)

        whole = run([0, 1, 2])
        for rows in ([0], [1], [1, 2]):
            part = run(rows)
            for name in ("mean", "covariance", "nis", "log_likelihood"):
                np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[rows])

import numpy as np
import pytest
from radar_problem import polar, radar_problem
from scipy import stats

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, MixtureNoise, create_filter, run_filter
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.particle_set import log_likelihood, moments, square_root, standard_normals
from relnav_sim.filters.resampling import draw_ancestors
from relnav_sim.streams import RandomSource

SCHEMES = ("systematic", "stratified", "residual")
F = np.array([[1.0, 1.0], [0.0, 1.0]])
Q = np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
H, R, P0 = np.array([[1.0, 0.0]]), np.array([[1.0]]), np.eye(2)
DYNAMICS, MEASUREMENT = LinearDynamics(F, Q), LinearMeasurement(H, R)


def linear_track(runs, steps, seed=0):
    rng = np.random.default_rng(seed)
    x, z = rng.standard_normal((runs, 2)), np.empty((runs, steps, 1))
    for k in range(steps):
        x = x @ F.T + rng.standard_normal((runs, 2)) @ np.linalg.cholesky(Q).T
        z[:, k] = x[:, :1] + rng.standard_normal((runs, 1))
    return z


def streams(runs, name="test"):
    return RandomSource(1, tuple(range(runs))).streams(name)


def random_weights(runs, particles, seed=0):
    weights = np.random.default_rng(seed).gamma(0.3, size=(runs, particles))
    return weights / weights.sum(axis=1, keepdims=True)


# Resampling


@pytest.mark.parametrize("scheme", ["systematic", "stratified"])
def test_ancestors_are_those_of_a_search_through_the_cumulative_weights(scheme):
    runs, N = 20, 57
    weights = random_weights(runs, N)
    ancestors = draw_ancestors(scheme, weights, streams(runs))
    u = streams(runs).uniform(1 if scheme == "systematic" else N)
    for run in range(runs):
        positions = (np.arange(N) + u[run]) / N
        expected = np.searchsorted(np.cumsum(weights[run]), positions)
        np.testing.assert_array_equal(ancestors[run], expected)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_expected_number_of_copies_is_the_weight(scheme):
    trials, N = 4000, 12
    weights = np.broadcast_to(random_weights(1, N), (trials, N))
    ancestors = draw_ancestors(scheme, weights, streams(trials))
    assert (np.diff(ancestors, axis=1) >= 0).all()
    counts = (ancestors[:, :, None] == np.arange(N)).sum(axis=1)
    spread = np.maximum(counts.std(axis=0), 0.02)
    assert (np.abs(counts.mean(axis=0) - N * weights[0]) < 4.5 * spread / np.sqrt(trials)).all()
    if scheme != "stratified":
        assert (counts >= np.floor(N * weights[0] - 1e-9)).all()
    if scheme == "systematic":
        assert (counts <= np.ceil(N * weights[0] + 1e-9)).all()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_particle_with_all_the_weight_or_none(scheme):
    weights = np.zeros((2, 9))
    weights[0, 8], weights[1, 0] = 1.0, 1.0
    np.testing.assert_array_equal(draw_ancestors(scheme, weights, streams(2)), [[8] * 9, [0] * 9])


# Building blocks


def test_normals_are_normal_and_do_not_depend_on_the_block():
    numbers = standard_normals(streams(3), 7, 9001)
    assert numbers.shape == (3, 7, 9001)
    assert stats.kstest(numbers.ravel(), "norm").pvalue > 1e-3
    flat = numbers.reshape(3, -1)
    assert np.abs(np.corrcoef(flat[:, :-1].ravel(), flat[:, 1:].ravel())[0, 1]) < 4 / np.sqrt(flat.size)
    half = flat.shape[1] // 2
    pairs = np.corrcoef(np.square(flat[:, :half]).ravel(), np.square(flat[:, half : 2 * half]).ravel())[0, 1]
    assert np.abs(pairs) < 4 / np.sqrt(3 * half)
    for run in range(3):
        alone = RandomSource(1, (run,)).streams("test")
        np.testing.assert_array_equal(standard_normals(alone, 7, 9001)[0], numbers[run])


def test_square_root_of_every_kind_of_covariance():
    rng = np.random.default_rng(0)
    scales = np.diag([1e4, 1.0, 1e-7])
    full = scales @ (np.eye(3) + 0.9 * (1 - np.eye(3)) / 2) @ scales
    tied = np.vstack([np.eye(2) / 2, np.eye(2)])  # positions moved by half the velocity's change
    deficient = tied @ np.diag([1e-12, 4e-12]) @ tied.T
    assert square_root(full).shape == (3, 3)
    assert square_root(deficient).shape == (4, 2)
    for matrix in (full, deficient, np.diag([0.0, 2.0, 0.0]), np.zeros((2, 2))):
        root = square_root(matrix)
        scale = np.sqrt(np.diag(matrix))
        np.testing.assert_allclose(
            root @ root.T, matrix, rtol=0, atol=1e-12 * max(1e-300, np.outer(scale, scale).max())
        )
    particles = rng.standard_normal((2, 5, 4, 4))
    stack = particles @ particles.swapaxes(-1, -2)
    stack[1, 2] = deficient
    root = square_root(stack)
    np.testing.assert_allclose(root @ root.swapaxes(-1, -2), stack, atol=1e-10)


def test_likelihood_is_the_measurements_own():
    states = np.random.default_rng(0).normal(500.0, 30.0, (3, 50, 6))
    z = polar(states[:, 0]) + 1e-3
    covariance = np.array([[16.0, 1e-3, 0.0], [1e-3, 1e-6, 1e-7], [0.0, 1e-7, 1e-6]])
    mixture = MixtureNoise(np.array([0.9, 0.1]), np.stack([covariance, 9 * covariance]))
    for noise in (covariance, np.stack([covariance] * 3)[:, None], mixture):
        measurement = FunctionMeasurement(polar, noise, angles=(1, 2))
        found = log_likelihood(measurement, z, states, states.mean(axis=1), 0)
        np.testing.assert_allclose(found, measurement.log_likelihood(z, states, 0), rtol=1e-10, atol=1e-9)

    class Laplace(FunctionMeasurement):
        def log_likelihood(self, z, states, epoch):
            return -np.abs(z[:, None] - self.predict(states, epoch)).sum(axis=-1)

    measurement = Laplace(polar, covariance, angles=(1, 2))
    np.testing.assert_array_equal(
        log_likelihood(measurement, z, states, states.mean(axis=1), 0), measurement.log_likelihood(z, states, 0)
    )


def test_moments():
    rng = np.random.default_rng(0)
    components, weights = 1e4 + rng.standard_normal((2, 3, 40)), random_weights(2, 40)
    mean, covariance = moments(components, np.log(weights))
    for run in range(2):
        np.testing.assert_allclose(mean[run], np.average(components[run], axis=1, weights=weights[run]))
        expected = np.cov(components[run], aweights=weights[run], ddof=0)
        np.testing.assert_allclose(covariance[run], expected, atol=1e-12)


# The filter


def test_one_step_against_a_plain_loop():
    """Weights, mean, covariance, evidence and ESS of the particle set that the filter drew, particle by particle."""
    z = linear_track(2, 1)
    filter = create_filter("particle", DYNAMICS, MEASUREMENT, particles=50, ess_fraction=0.0, roughening=0.0)
    belief = filter.start(Gaussian(np.zeros((2, 2)), np.stack([P0] * 2)), RandomSource(0, (0, 1)))
    predicted = filter.predict(belief, Step(0))
    posterior, innovation = filter.update(predicted, z[:, 0], Step(0))
    for run in range(2):
        likelihood = [stats.norm.pdf(z[run, 0, 0], x[0]) for x in predicted.states[run]]
        weights = np.array(likelihood) / np.sum(likelihood)
        mean = sum(w * x for w, x in zip(weights, predicted.states[run], strict=True))
        offsets = predicted.states[run] - mean
        np.testing.assert_allclose(posterior.mean[run], mean)
        scatter = sum(w * np.outer(d, d) for w, d in zip(weights, offsets, strict=True))
        P = F @ P0 @ F.T + Q
        kalman = P - P @ H.T @ np.linalg.inv(H @ P @ H.T + R) @ H @ P
        np.testing.assert_allclose(posterior.covariance[run], scatter + np.square(weights).sum() * kalman, atol=1e-12)
        np.testing.assert_allclose(innovation.log_likelihood[run], np.log(np.mean(likelihood)))
        np.testing.assert_allclose(innovation.extras["ess"][run], 1 / np.square(weights).sum())


OTHERS = [{"resampling": "stratified"}, {"resampling": "residual"}, {"mcmc_steps": 2}]


@pytest.mark.parametrize("options", [{}, *(pytest.param(options, marks=pytest.mark.slow) for options in OTHERS)])
def test_evidence_is_unbiased(options):
    """The evidence itself, not its logarithm, which is low by half its variance."""
    runs = 1500
    z = linear_track(runs, 8)
    exact = run_filter(create_filter("kf", DYNAMICS, MEASUREMENT), z, np.zeros(2), P0).log_likelihood.sum(axis=1)
    filter = create_filter("particle", DYNAMICS, MEASUREMENT, particles=400, roughening=0.0, **options)
    difference = run_filter(filter, z, np.zeros(2), P0).log_likelihood.sum(axis=1) - exact
    assert difference.std() < 1
    ratio = np.exp(difference)
    assert abs(ratio.mean() - 1) < 3.5 * ratio.std() / np.sqrt(runs)
    assert difference.mean() < -3 * difference.std() / np.sqrt(runs)


@pytest.mark.parametrize("roughening", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
def test_mean_and_covariance_are_those_of_the_kalman_filter_within_monte_carlo_error(roughening):
    runs, particles = 200, 1000
    z = linear_track(runs, 10)
    exact = run_filter(create_filter("kf", DYNAMICS, MEASUREMENT), z, np.zeros(2), P0)
    found = run_filter(
        create_filter("particle", DYNAMICS, MEASUREMENT, particles=particles, roughening=roughening), z, np.zeros(2), P0
    )
    deviation = np.sqrt(np.einsum("btii->bti", exact.covariance))
    error = (found.mean - exact.mean) / deviation
    # 1 / sqrt(N) if all were independent draws of the posterior; resampling and weights cost a few times that.
    assert np.sqrt(np.square(error).mean()) < 3.5 / np.sqrt(particles)
    assert np.abs(error.mean(axis=(0, 1))).max() < 4 * error.mean(axis=1).std() / np.sqrt(runs)
    ratio = np.einsum("btii->bti", found.covariance) / deviation**2
    assert abs(ratio.mean() - 1) < 0.02
    assert abs(found.nis.mean() - exact.nis.mean()) < 0.03


@pytest.mark.slow
def test_matches_the_unscented_filter_in_orbit():
    """From a poor prior and with the small process noise of an orbit, which needs the kernel."""
    p = radar_problem(runs=12, steps=120)
    ukf = run_filter(create_filter("ukf", p.dynamics, p.measurement), p.z, p.mean0, p.cov0)
    filter = create_filter("particle", p.dynamics, p.measurement, particles=4000, roughening=1.0)
    found = run_filter(filter, p.z, p.mean0, p.cov0)
    deviation = np.sqrt(np.einsum("btii->bti", ukf.covariance))
    assert np.sqrt(np.square((found.mean - ukf.mean) / deviation)[:, 20:].mean()) < 0.25
    squares = [np.square(h.mean - p.truth)[:, 20:, :3].sum(axis=2).mean(axis=1) for h in (found, ukf)]
    assert np.sqrt(squares[0].mean() / squares[1].mean()) < 1.05
    worse = squares[0] - squares[1]
    assert abs(worse.mean()) < 3.5 * worse.std() / np.sqrt(12)
    difference = (found.log_likelihood - ukf.log_likelihood).sum(axis=1)
    assert abs(difference.mean()) < 2
    assert found.extras["stages"].max() > 1


def test_without_a_kernel_copies_never_part_in_orbit():
    p = radar_problem(runs=4, steps=150)
    dead, rough = (
        run_filter(create_filter("particle", p.dynamics, p.measurement, **options), p.z, p.mean0, p.cov0)
        for options in ({"particles": 500, "roughening": 0.0}, {"particles": 500})
    )
    rms = [np.sqrt(np.square(h.mean - p.truth)[:, 50:, :3].sum(axis=2).mean()) for h in (dead, rough)]
    assert rms[0] > 5 * rms[1]


def test_moves_leave_the_posterior_as_it_is():
    """After resampling and many moves the unweighted particle set has the moments of the exact posterior."""
    runs, particles = 40, 4000
    z = linear_track(runs, 1)
    options = {"particles": particles, "ess_fraction": 1.0, "mcmc_steps": 25}
    filter = create_filter("particle", DYNAMICS, MEASUREMENT, **options)
    belief = filter.start(Gaussian(np.zeros((runs, 2)), np.stack([P0] * runs)), RandomSource(0, tuple(range(runs))))
    posterior, _ = filter.update(filter.predict(belief, Step(0)), z[:, 0], Step(0))
    exact = run_filter(create_filter("kf", DYNAMICS, MEASUREMENT), z, np.zeros(2), P0)
    particle_set = posterior.states
    deviation = np.sqrt(np.einsum("bii->bi", exact.covariance[:, 0]))
    error = (particle_set.mean(axis=1) - exact.mean[:, 0]) / deviation
    assert np.abs(error.mean(axis=0)).max() < 4 * error.std(axis=0).max() / np.sqrt(runs)
    np.testing.assert_allclose((particle_set.var(axis=1) / deviation**2).mean(axis=0), 1, atol=0.02)
    for run in range(3):
        assert len(np.unique(particle_set[run, :, 0])) > 0.9 * particles


@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_mean_after_resampling_is_that_before_with_the_noise_of_resampling(scheme):
    """Unbiased given the weighted particles, with at most the variance of multinomial copies, (sum w x^2 - m^2) / N.

    For the stratified and the residual scheme that is a theorem (Douc and Cappe 2005), for the systematic one it holds
    here.
    """
    runs, particles = 1000, 40
    z = linear_track(runs, 1)
    found = {}
    for estimate in ("before_resampling", "after_resampling"):
        options = {"particles": particles, "roughening": 0.0, "ess_fraction": 1.0, "resampling": scheme}
        filter = create_filter("particle", DYNAMICS, MEASUREMENT, estimate=estimate, **options)
        belief = filter.start(Gaussian(np.zeros((runs, 2)), np.stack([P0] * runs)), RandomSource(0, range(runs)))
        predicted = filter.predict(belief, Step(0))
        found[estimate], _ = filter.update(predicted, z[:, 0], Step(0))
    before, after = found["before_resampling"], found["after_resampling"]
    np.testing.assert_array_equal(after.components, before.components)
    np.testing.assert_array_equal(after.covariance, before.covariance)
    np.testing.assert_allclose(after.mean, after.states.mean(axis=1), atol=1e-12)
    noise = after.mean - before.mean
    assert (np.abs(noise.mean(axis=0)) < 4 * noise.std(axis=0) / np.sqrt(runs)).all()
    weights = np.exp(log_likelihood(MEASUREMENT, z[:, 0], predicted.states, predicted.mean, 0))
    weights /= weights.sum(axis=1, keepdims=True)
    offsets = predicted.states - before.mean[:, None]
    multinomial = np.einsum("bp,bpi->bi", weights, np.square(offsets)).mean(axis=0) / particles
    variance = np.square(noise).mean(axis=0)
    assert (variance > 0).all() and (variance < multinomial).all()


@pytest.mark.parametrize("kind", ["particle", "unscented_particle"])
def test_the_mean_after_resampling_is_taken_after_the_moves_and_only_where_there_are_copies(kind):
    p = radar_problem(runs=4, steps=12)
    options = {"particles": 150, "mcmc_steps": 2, "ess_fraction": 0.5, "estimate": "after_resampling"}
    filter = create_filter(kind, p.dynamics, p.measurement, **options)
    belief = filter.start(Gaussian(p.mean0, np.stack([p.cov0] * 4)), RandomSource(0, range(4)))
    resampled = []
    for epoch in range(12):
        belief, innovation = filter.update(filter.predict(belief, Step(epoch)), p.z[:, epoch], Step(epoch))
        of_all = np.einsum("bp,bpi->bi", belief.weights, belief.states)
        np.testing.assert_allclose(belief.mean, of_all, rtol=0, atol=1e-9 * np.abs(of_all).max())
        resampled.append(innovation.extras["resampled"])
    assert 0 < np.mean(resampled) < 1


@pytest.mark.parametrize(
    "options",
    [
        {"resampling": "residual", "roughening": 1.0, "mcmc_steps": 1},
        {"resampling": "stratified", "mcmc_steps": 2, "ess_fraction": 1.0},
    ],
)
def test_bits_do_not_depend_on_the_block(options):
    p = radar_problem(runs=4, steps=12)
    p.z[1, 3:6] = np.nan

    def run(rows):
        filter = create_filter("particle", p.dynamics, p.measurement, particles=333, **options)
        return run_filter(filter, p.z[rows], p.mean0[rows], p.cov0, runs=rows)

    whole = run([0, 1, 2, 3])
    for rows in ([0], [1], [2, 3]):
        part = run(rows)
        for name in ("mean", "covariance", "nis", "log_likelihood"):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[rows])


def test_a_run_that_breaks_leaves_the_others_alone():
    z = linear_track(3, 10)
    clean = run_filter(create_filter("particle", DYNAMICS, MEASUREMENT, particles=100), z, np.zeros(2), P0)
    broken = z.copy()
    broken[1, 4] = 1e200
    with pytest.warns(RuntimeWarning, match="run 1 at epoch 4"):
        found = run_filter(create_filter("particle", DYNAMICS, MEASUREMENT, particles=100), broken, np.zeros(2), P0)
    assert np.isnan(found.mean[1, 4:]).all()
    for run in (0, 2):
        np.testing.assert_array_equal(found.mean[run], clean.mean[run])


def test_process_noise_of_low_rank_draws_as_many_numbers_as_its_rank():
    tied = np.array([[0.5], [1.0]])
    dynamics = LinearDynamics(F, 0.1 * tied @ tied.T)
    filter = create_filter("particle", dynamics, MEASUREMENT, particles=100, roughening=0.0)
    belief = filter.start(Gaussian(np.zeros((1, 2)), P0[None]), RandomSource(0, (0,)))
    predicted = filter.predict(belief, Step(0))
    assert predicted.noise.shape == (1, 1, 100)
    moved = (predicted.components - F @ belief.components)[0]
    np.testing.assert_allclose(moved[0], moved[1] / 2, atol=1e-12)


@pytest.mark.parametrize(
    "options", [{"particles": 1}, {"resampling": "roulette"}, {"ess_fraction": 1.5}, {"roughening": 9.0}]
)
def test_wrong_options_are_refused(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        create_filter("particle", DYNAMICS, MEASUREMENT, **options)


def root_of_position(states, epoch):
    """A measurement that has no number for some particles: those left of the origin."""
    return np.sqrt(states[..., :1])


class OddLikelihood(LinearMeasurement):
    """Gives a value of its own to some particles of some runs instead of their likelihood."""

    def __init__(self, value, runs, share):
        super().__init__(H, R)
        self.value, self.runs, self.share = value, runs, share

    def log_likelihood(self, z, states, epoch):
        score = super().log_likelihood(z, states, epoch)
        if epoch >= 3:
            score[self.runs, : int(self.share * score.shape[1])] = self.value
        return score


@pytest.mark.parametrize("kind", ["particle", "unscented_particle", "gp_particle", "mf_upf"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_particles_without_a_finite_likelihood_weigh_nothing_and_all_of_them_fail_the_run(kind, value):
    z, options = linear_track(4, 8), {"particles": 400}

    def history(measurement):
        return run_filter(create_filter(kind, DYNAMICS, measurement, **options), z, np.zeros(2), P0)

    clean = history(OddLikelihood(0.0, [], 0.0))
    few = history(OddLikelihood(value, [1], 0.05))
    assert not few.failures
    for run in (0, 2, 3):
        assert np.array_equal(few.mean[run], clean.mean[run])
    # A twentieth of the particles less changes the mean by its own sampling error, not more.
    deviation = np.sqrt(np.einsum("kii->ki", clean.covariance[1]))
    assert (np.abs(few.mean[1] - clean.mean[1]) < deviation).all()
    with pytest.warns(RuntimeWarning, match="run 2 at epoch 3: no particle gives the measurement a finite likelihood"):
        lost = history(OddLikelihood(value, [2], 1.0))
    assert [(failure.run, failure.epoch) for failure in lost.failures] == [(2, 3)]
    for run in (0, 1, 3):
        assert np.array_equal(lost.mean[run], clean.mean[run])


@pytest.mark.parametrize("kind", ["particle", "unscented_particle"])
def test_particles_for_which_the_measurement_has_no_number_weigh_nothing(kind):
    """h = sqrt(x) is NaN for a few particles, which by the reading are not where the state is either."""
    measurement = FunctionMeasurement(root_of_position, [[0.01]])
    z = np.sqrt(np.array([[[4.0], [4.1], [3.9], [4.0], [4.05]]]))
    filter = create_filter(kind, LinearDynamics(np.eye(1), [[0.05]]), measurement, particles=2000)
    history = run_filter(filter, z, [3.0], [[4.0]])
    assert not history.failures
    # sqrt(x) = 2 +- 0.1 is x = 4 +- 0.4.
    assert abs(history.mean[0, -1, 0] - 4) < 4 * np.sqrt(history.covariance[0, -1, 0, 0]) < 2

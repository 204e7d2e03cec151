"""The NIS of filters that carry mixtures: that of the predictive mixture's moments."""

import numpy as np
import pytest

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, MixtureNoise, create_filter, run_filter
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.components import Linearised, predictive_nis
from relnav_sim.streams import RandomSource

F, Q = np.array([[1.0, 1.0], [0.0, 1.0]]), 0.01 * np.array([[1 / 3, 0.5], [0.5, 1.0]])
P0 = 4 * np.eye(2)
WEIGHTS = np.array([0.8, 0.2])
NOISES = np.array([[[1.0, 0.2], [0.2, 0.5]], [[25.0, 0.0], [0.0, 36.0]]])
MIXTURE = MixtureNoise(WEIGHTS, NOISES)
H = np.array([[1.0, 0.0], [0.3, 1.0]])


def tracks(runs, steps, seed=5):
    """Return readings of the very model that the filters assume."""
    rng = np.random.default_rng(seed)
    x, z = rng.multivariate_normal([0, 0], P0, size=runs), np.empty((runs, steps, 2))
    for k in range(steps):
        x = x @ F.T + rng.multivariate_normal([0, 0], Q, size=runs)
        roots = np.linalg.cholesky(NOISES)[rng.choice(2, size=runs, p=WEIGHTS)]
        z[:, k] = x @ H.T + np.einsum("bij,bj->bi", roots, rng.standard_normal((runs, 2)))
    return z


@pytest.mark.parametrize(("kind", "options"), [("imm", {}), ("gaussian_sum", {"components": 3}), ("ekf", {})])
def test_its_mean_is_the_number_of_channels_where_the_model_is_right(kind, options):
    """400 independent runs: the mean over runs lies within 4 of its standard errors, 0.04 each."""
    filter = create_filter(kind, LinearDynamics(F, Q), LinearMeasurement(H, MIXTURE), **options)
    means = run_filter(filter, tracks(400, 40), [0, 0], P0).nis.mean(axis=1)
    standard_error = means.std(ddof=1) / np.sqrt(len(means))
    assert standard_error < 0.05
    assert abs(means.mean() - 2) < 4 * standard_error


def by_hand(weights, means, covariances, noises, z):
    expected = [H @ mean for mean in means]
    centre = sum(w * one for w, one in zip(weights, expected, strict=True))
    S = np.zeros((2, 2))
    for w, one, P, R in zip(weights, expected, covariances, noises, strict=True):
        S += w * (H @ P @ H.T + R + np.outer(one - centre, one - centre))
    return (z - centre) @ np.linalg.inv(S) @ (z - centre)


def test_it_equals_a_plain_transcription():
    rng = np.random.default_rng(2)
    z = tracks(3, 12)
    step = Step(12)
    for kind, options in (("imm", {"persistence": 0.6}), ("gaussian_sum", {"components": 3})):
        filter = create_filter(kind, LinearDynamics(F, Q), LinearMeasurement(H, MIXTURE), **options)
        belief = filter.start(
            Gaussian(np.zeros((3, 2)), np.broadcast_to(P0, (3, 2, 2)).copy()), RandomSource(0, (0, 1, 2))
        )
        for k in range(12):
            belief, _ = filter.update(filter.predict(belief, Step(k)), z[:, k], Step(k))
        belief = filter.predict(belief, step)
        z_next = rng.normal(0, 5, (3, 2))
        _, innovation = filter.update(belief, z_next, step)
        for run in range(3):
            if kind == "imm":
                weights, noises = np.exp(belief.log_weights[run]), NOISES
            else:
                weights, noises = belief.weights[run], [np.einsum("k,kij->ij", WEIGHTS, NOISES)] * 3
            hand = by_hand(weights, belief.means[run], belief.covariances[run], noises, z_next[run])
            assert innovation.nis[run] == pytest.approx(hand, rel=1e-10)


def test_angles_of_the_components_are_averaged_across_the_cut():
    bearing = FunctionMeasurement(lambda x, k: np.arctan2(x[..., 1:], x[..., :1]), [[1e-4]], angles=(0,))
    means = np.array([[[-10.0, 0.1], [-10.0, -0.1]]])
    model = Linearised.at(bearing, means, 0)
    nis = predictive_nis(
        bearing, model, np.array([[0.5, 0.5]]), np.zeros((1, 2, 2, 2)), np.full((1, 1, 1), 1e-4), np.array([[np.pi]])
    )
    # Both lie 0.01 rad to either side of pi, where the reading is: the innovation is nil.
    assert nis[0] == pytest.approx(0.0, abs=1e-20)


@pytest.mark.parametrize("kind", ["imm", "gaussian_sum"])
def test_a_component_without_a_likelihood_counts_for_nothing_and_all_of_them_fail_the_run(kind):
    """Two components of the noise: one is so precise that a far reading overflows its density, the other is not."""
    sharp = MixtureNoise([0.5, 0.5], [[[1e-300]], [[1.0]]])
    z = np.zeros((3, 4, 1))
    z[1, 2] = 1e155  # squared over 1e-300 there is no number; over 1 there is none either
    z[2, 2] = 1e10  # beyond what the precise component can hold, an outlier for the other
    filter = create_filter(kind, LinearDynamics([[1.0]], [[0.0]]), LinearMeasurement([[1.0]], sharp))
    with pytest.warns(RuntimeWarning, match="run 1 at epoch 2: no component of the mixture") as caught:
        history = run_filter(filter, z, [0.0], [[1e-300]])
    assert len(caught) == 1
    [failure] = history.failures
    assert (failure.run, failure.epoch) == (1, 2)
    assert np.isfinite(history.mean[[0, 2]]).all() and np.isfinite(history.log_likelihood[2]).all()
    # By the other component alone: its weight, and its density of a reading 1e10 standard deviations off.
    assert history.log_likelihood[2, 2] == pytest.approx(-0.5e20, rel=1e-12)

"""Residuals and NIS that judge a filter are with the noise that it works with, scaled or estimated."""

import numpy as np
import pytest
from every_filter import CAUSAL, small_options

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.editing import MeasurementEditing
from relnav_sim.filters.editing_options import EditingOptions
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.filters.run import advance
from relnav_sim.streams import RandomSource

F, Q, R = np.array([[1.0, 1.0], [0.0, 1.0]]), 1e-4 * np.eye(2), np.array([[4.0]])
RUNS, EPOCHS = 3, 60


def judged(kind, options, edited=False):
    """Return what a filter made of positions three times as noisy as it was told; one run lacks every third."""
    rng = np.random.default_rng(7)
    z = 6 * rng.standard_normal((RUNS, EPOCHS, 1))
    z[1, ::3] = np.nan
    given = LinearMeasurement(np.array([[1.0, 0.0]]), R)
    filter = create_filter(kind, LinearDynamics(F, Q), {"radar": given}, **options)
    if edited:
        filter = MeasurementEditing(filter, EditingOptions(probability=0.9))
    prior = Gaussian(np.zeros((RUNS, 2)), np.tile(4 * np.eye(2), (RUNS, 1, 1)))
    belief = filter.start(prior, RandomSource(0, (0, 1, 2)))
    return advance(filter, belief, {"radar": z}, 0, 1.0, with_residuals=True)[1]


GAUSSIAN = [kind for kind in CAUSAL if filter_kinds()[kind].smooths and not filter_kinds()[kind].learned_dynamics]
CASES = [(kind, small_options(kind), False) for kind in GAUSSIAN] + [
    ("kf", {"r_scale": 5}, False),
    ("kf", {"r_scale": 5}, True),
    ("alpha_kf", {"alpha": 0.2, "samples": 64, "sampling": "fixed"}, False),
    ("alpha_kf", {"alpha": 0.4, "fixed_point": 2, "samples": 64, "sampling": "fixed"}, False),
    ("adaptive_alpha_kf", {"scheme": "windowed_nis", "window": 20}, False),
    ("adaptive_alpha_kf", {"scheme": "windowed_nis", "window": 20, "arithmetic": "float32"}, False),
    ("adaptive_alpha_kf", {"scheme": "gate"}, False),
    ("adaptive_two_step", {}, True),
]


@pytest.mark.parametrize(("kind", "options", "edited"), CASES)
def test_with_one_channel_the_nis_is_the_square_of_its_residual_in_sigmas(kind, options, edited):
    history = judged(kind, options, edited)
    residuals, read = history.residuals_by["radar"], history.dof > 0
    assert read.sum() == RUNS * EPOCHS - EPOCHS // 3
    squares = np.square(residuals.residual / residuals.sigma)[..., 0]
    rtol = 1e-4 if options.get("arithmetic") == "float32" else 1e-9
    if "two_step" in kind:  # it predicts y = [x; g(x)], which starts with a covariance of its own and forgets it
        read[:, :20], rtol = False, 1e-3
    np.testing.assert_allclose(squares[read], history.believed_nis_by["radar"][read], rtol=rtol)
    assert np.isnan(history.believed_nis_by["radar"][history.dof == 0]).all()


def test_it_is_the_noise_that_gives_the_gain():
    """Of S = P + R the update leaves P - P^2 / S: so R follows from the variances before and after it."""
    options = {"alpha": 0.2, "samples": 4096, "sampling": "fixed"}
    for kind, chosen, scale in (("kf", {"r_scale": 5}, 5), ("alpha_kf", options, 5), ("kf", {}, 1)):
        history = judged(kind, chosen)
        P = F @ history.covariance[0, -2] @ F.T + Q
        S = P[0, 0] ** 2 / (P[0, 0] - history.covariance[0, -1, 0, 0])
        np.testing.assert_allclose(S - P[0, 0], scale * R[0, 0], rtol=0.01)
        np.testing.assert_allclose(history.residuals_by["radar"].sigma[0, -1, 0] ** 2, S, rtol=0.01)


def test_noise_found_in_a_window_is_that_of_the_measurements():
    """At three times the sigma stated, the last 40 believed NIS have mean 1 within 4 sigma, and the stated ones not."""
    history = judged("adaptive_alpha_kf", {"scheme": "windowed_nis", "window": 20})
    chance = 4 * np.sqrt(2 / np.isfinite(history.nis[:, 20:]).sum())
    assert abs(np.nanmean(history.believed_nis_by["radar"][:, 20:]) - 1) < chance < 1 < np.nanmean(history.nis) / 4

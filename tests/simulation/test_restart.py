"""Where a run that has locked itself out starts again."""

from dataclasses import replace

import numpy as np
from small_campaign import TEXT

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.simulation.chunks import chunks
from relnav_sim.simulation.restart import FixRestart
from relnav_sim.streams import RandomSource


def test_a_fix_that_was_taken_before_its_epoch_is_moved_on():
    """By constant velocity over the time since: x = F x_then with F = [[I, t I], [0, I]], and its covariance."""
    made = parse_campaign(TEXT.partition("filters:")[0] + "filters: {ekf: {kind: ekf}}")
    config = made.cases[0].config
    chunk = next(chunks(config, RandomSource(made.seed, (0, 1))))
    A = np.random.default_rng(1).normal(size=(2, 6, 6))
    belief = Gaussian(np.tile([0.0, -2000, 100, 0.05, -0.3, 0.1], (2, 1)), A @ A.swapaxes(1, 2))
    restart, k = FixRestart(config.filters["ekf"], config, None), 7
    restart.take(chunk)
    then = restart("radar", belief, Step(k, 1.0))
    late_s = np.zeros(chunk.z["radar"].shape[:2])
    late_s[:, k] = 0.0, 0.8
    restart.take(replace(chunk, late={"radar": late_s}))
    now = restart("radar", belief, Step(k, 1.0))
    for run in range(2):
        F = np.eye(6)
        F[:3, 3:] = late_s[run, k] * np.eye(3)
        np.testing.assert_allclose(now.mean[run], F @ then.mean[run], rtol=1e-13)
        np.testing.assert_allclose(now.covariance[run], F @ then.covariance[run] @ F.T, rtol=1e-12, atol=1e-12)

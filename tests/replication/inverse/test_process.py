import numpy as np
import pytest
from taking_turns import taking_turns

from relnav_sim import LinearDynamics, Step, fit_gp_dynamics
from relnav_sim.arrays import Array
from replication.inverse.mf_upf_process import _misfit, learned


def _pairs() -> tuple[Array, Array, LinearDynamics]:
    """Return 300 states of a slow oscillator with a weak spring that its model leaves out, and its model."""
    rng = np.random.default_rng(4)
    h, n = 5.0, 1e-3
    F = np.eye(6) + h * np.eye(6, k=3) - h * n**2 * np.eye(6, k=-3)
    x = [np.array([300.0, -370.0, -400.0, -0.2, -0.6, 0.1])]
    for _ in range(1200):
        x.append(F @ x[-1] - np.concatenate([np.zeros(3), 1e-12 * x[-1][:3] ** 3]))
    states = np.array(x)
    now = np.sort(rng.choice(1200, 300, replace=False))
    noise = rng.normal(0, [1e-3] * 3 + [1e-6] * 3, (2, 300, 6))
    return states[now] + noise[0], states[now + 1] + noise[1], LinearDynamics(F, 1e-12 * np.eye(6))


@pytest.mark.parametrize(("target", "standardised"), taking_turns([("residual",), ("absolute",)], [True, False]))
def test_what_is_learned_is_what_relnav_learns(target: str, standardised: bool) -> None:
    now, after, motion = _pairs()
    ours = learned(now, after, target, motion, False, standardised, True)
    theirs = fit_gp_dynamics(
        now,
        after,
        5.0,
        motion if target == "residual" else None,
        target,
        variance="inducing",
        added_noise=1e-12 * np.eye(6),
        restarts=0,
        regression={"standardised": standardised, "fitted_points": 75},
    )
    at = now[None, ::7] + np.array([0.5] * 3 + [5e-4] * 3)
    scale = np.sqrt(np.diagonal(theirs.process_noise(at, Step(0)), axis1=2, axis2=3))
    off = (ours.propagate(at, Step(0)) - theirs.propagate(at, Step(0))) / scale
    assert np.abs(off).max() < 0.1
    ratio = np.diagonal(ours.process_noise(at, Step(0)), axis1=2, axis2=3) / scale**2
    np.testing.assert_allclose(ratio, 1, atol=0.05)


def test_derivatives_of_the_likelihood_are_its_differences() -> None:
    rng = np.random.default_rng(5)
    x, Y = rng.standard_normal((30, 2)), rng.standard_normal((30, 3))
    squares = (x.T[:, :, None] - x.T[:, None]) ** 2
    theta = np.array([0.3, 0.5, -0.2, -2.0])
    _, slopes = _misfit(theta, squares, Y)
    steps = 1e-5 * np.eye(4)
    differences = [
        (_misfit(theta + step, squares, Y)[0] - _misfit(theta - step, squares, Y)[0]) / 2e-5 for step in steps
    ]
    np.testing.assert_allclose(slopes, differences, rtol=1e-6)

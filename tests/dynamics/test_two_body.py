import numpy as np
import pytest

from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.two_body import NonlinearOptions


@pytest.mark.parametrize("e", [0.0, 0.1, 0.7])
@pytest.mark.parametrize("i_deg", [0.5, 51.6, 97.6])
@pytest.mark.parametrize("separation", [100.0, 100e3])
def test_one_period_against_the_truth(scene, e, i_deg, separation):
    s = scene(e, i_deg)
    steps = 300
    step = s.period_s / steps
    x0 = s.deputies(separation)
    truth = s.truth(x0, np.arange(steps + 1) * step)[1]
    dynamics, x = NonlinearOptions().build(DynamicsContext(s.orbit, s.noise, step)), x0
    worst = 0.0
    for k in range(1, steps + 1):
        x = dynamics.propagate(x, Step(k))
        worst = max(worst, np.abs(x - truth[:, k])[:, :3].max())
    # The truth is the difference of two orbits, each good to 1e-6 m.
    assert worst < 5e-6


@pytest.mark.parametrize("e", [0.0, 0.7])
@pytest.mark.parametrize("step_s", [0.2, 1.0, 10.0, 60.0])
def test_truncation_of_a_step(scene, e, step_s):
    s = scene(e)
    x = s.deputies(100e3)
    whole = NonlinearOptions().build(DynamicsContext(s.orbit, s.noise, step_s)).propagate(x, Step(1))
    parts = NonlinearOptions().build(DynamicsContext(s.orbit, s.noise, step_s / 10))
    for k in range(1, 11):
        x = parts.propagate(x, Step(k))
    # Rounding of positions of 1e5 m, ten times, is 1.5e-10 m; of velocities of 200 m/s 3e-13 m/s.
    assert np.abs(whole - x)[:, :3].max() < 1e-9
    assert np.abs(whole - x)[:, 3:].max() < 2e-12


def test_linear_at_the_chief(scene):
    """At the chief itself the transition is Yamanaka and Ankersen's."""
    from relnav_sim.dynamics.elliptic import YamanakaAnkersenOptions

    s = scene(0.5)
    exact, linear = (
        o().build(DynamicsContext(s.orbit, s.noise, 60.0)) for o in (NonlinearOptions, YamanakaAnkersenOptions)
    )
    at_chief = np.zeros((1, 6))
    for epoch in (1, 50, 600):
        F = exact.transition(at_chief, Step(epoch))[0]
        np.testing.assert_allclose(F, linear.transition(at_chief, Step(epoch)), rtol=1e-11, atol=1e-11)
        assert np.array_equal(exact.propagate(at_chief, Step(epoch)), at_chief)

import itertools

import numpy as np
import pytest

from relnav_sim.astro.constants import J2, J3, J4
from relnav_sim.dynamics.chief_segments import NominalChief
from relnav_sim.dynamics.context import Arrival, ChiefFixes, DynamicsContext
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.orbit_filter import OrbitFilter, OrbitFilterOptions
from relnav_sim.dynamics.two_body import NonlinearOptions
from relnav_sim.dynamics.two_body_j2 import NonlinearJ2Options


def predicted(dynamics, x, steps):
    path = [x]
    for k in range(1, steps + 1):
        path.append(dynamics.propagate(path[-1], Step(k)))
    return np.stack(path, axis=1)


def one_period():
    """Yield every combination; those that are not slow are nine in which each value meets each of another kind."""
    for (a, e), (b, i_deg) in itertools.product(enumerate([0.0, 0.1, 0.7]), enumerate([0.5, 51.6, 97.6])):
        for (c, separation), (d, zonals) in itertools.product(enumerate([100.0, 100e3]), enumerate([2, 4])):
            quick = c == (a + b) % 2 and d == (2 * a + b) // 2 % 2
            yield pytest.param(e, i_deg, separation, zonals, marks=() if quick else pytest.mark.slow)


@pytest.mark.parametrize(("e", "i_deg", "separation", "zonals"), list(one_period()))
def test_one_period_against_the_truth(scene, e, i_deg, separation, zonals):
    s = scene(e, i_deg, zonals=4)
    steps = 200
    step = s.period_s / steps
    x0 = s.deputies(separation)
    _, truth = s.truth(x0, np.arange(steps + 1) * step, zonals=(J2, J3, J4)[: zonals - 1])
    x = predicted(NonlinearJ2Options(zonals=zonals).build(DynamicsContext(s.orbit, s.noise, step)), x0, steps)
    # The truth is the difference of two orbits, each good to 1e-6 m, and the nominal chief is no better.
    assert np.abs(x - truth)[..., :3].max() < 2e-5


def test_with_the_chief_estimated_from_fixes(scene):
    """Each run has its own chief; its errors of metres leave decimetres at 12 km after a revolution."""
    s = scene(0.001)
    steps, step, runs = 580, 10.0, 8
    before = 300
    x0 = s.deputies(12e3, runs)
    times = np.arange(before + steps + 1) * step
    chief, truth = s.truth(x0, times, zonals=(J2, J3, J4))
    sigmas = np.repeat([30.0, 0.15], 3)
    fixes = chief + np.random.default_rng(0).normal(size=(runs, len(times), 6)) * sigmas
    estimates = OrbitFilter(OrbitFilterOptions(), s.orbit, sigmas, step, runs).advance(fixes)
    dynamics = NonlinearJ2Options().build(DynamicsContext(s.orbit, s.noise, step)).with_chief(estimates[:, before:], 0)
    x = predicted(dynamics, truth[:, before], steps)
    error = np.linalg.norm((x - truth[:, before:])[..., :3], axis=-1).max(axis=1)
    # J3 and J4 alone leave 1.5 m here; point masses about the nominal orbit leave 100 m.
    assert error.max() < 5
    without = predicted(NonlinearOptions().build(DynamicsContext(s.orbit, s.noise, step)), x0, steps)
    assert np.linalg.norm((without - truth[:, : steps + 1])[..., :3], axis=-1).max() > 50


@pytest.mark.parametrize("zonals", [2, 4])
def test_propagate_after_transition_keeps_its_bits(scene, zonals):
    """The Jacobian's own path serves the mean at the same states, and no others."""
    s = scene(0.1, zonals=4)
    x = s.deputies(12e3, 3)
    warm, cold = (NonlinearJ2Options(zonals=zonals).build(DynamicsContext(s.orbit, s.noise, 10.0)) for _ in range(2))
    for states in (x, x[:1], x + 1.0):
        warm.transition(x, Step(3))
        assert np.array_equal(warm.propagate(states, Step(3)), cold.propagate(states, Step(3)))
    warm.transition(x, Step(3))
    assert np.array_equal(warm.propagate(x, Step(4)), cold.propagate(x, Step(4)))


def test_runs_have_their_own_chief(scene):
    s = scene(0.0)
    x = s.deputies(12e3, 3)
    chief = np.repeat(s.truth(x, np.array([0.0, 10.0]), zonals=(J2,))[0], 3, axis=0)
    chief[1] += np.array([1e3, 0, 0, 0, 0, 0])
    dynamics = NonlinearJ2Options().build(DynamicsContext(s.orbit, s.noise, 10.0))
    together = dynamics.with_chief(chief, 4)
    for run in range(3):
        alone = dynamics.with_chief(chief[run : run + 1], 4)
        for epoch in (5, 6):
            mine = slice(run, run + 1)
            assert np.array_equal(alone.propagate(x[mine], Step(epoch))[0], together.propagate(x, Step(epoch))[run])
            assert np.array_equal(alone.transition(x[mine], Step(epoch))[0], together.transition(x, Step(epoch))[run])


def test_a_step_depends_on_the_chief_at_its_start_alone(scene):
    s = scene(0.0)
    x = s.deputies(12e3, 2)
    chief = np.repeat(s.truth(x, np.arange(9) * 10.0, zonals=(J2,))[0], 2, axis=0)
    whole = NonlinearJ2Options().build(DynamicsContext(s.orbit, s.noise, 10.0)).with_chief(chief, 0)
    for first, last in ((0, 5), (4, 9)):
        dynamics = whole.with_chief(chief[:, first:last], first)
        for epoch in range(first + 1, last + 1):
            assert np.array_equal(dynamics.propagate(x, Step(epoch)), whole.propagate(x, Step(epoch)))


def test_it_goes_by_the_fixes_that_it_is_fed(scene):
    s = scene(0.0)
    x = s.deputies(12e3, 2)
    sigmas = np.repeat([30.0, 0.15], 3)
    chief, _ = s.truth(x, np.arange(9) * 10.0, zonals=(J2,))
    fixes = chief + np.random.default_rng(0).normal(size=(2, 9, 6)) * sigmas
    options = NonlinearJ2Options()
    estimates = OrbitFilter(options.chief_orbit, s.orbit, sigmas, 10.0, 2).advance(fixes)
    whole = options.build(DynamicsContext(s.orbit, s.noise, 10.0)).with_chief(estimates, 0)
    dynamics = options.build(DynamicsContext(s.orbit, s.noise, 10.0, ChiefFixes(sigmas, 2)))
    for first, last in ((0, 5), (5, 9)):
        dynamics.feed(Arrival(first, fixes[:, first:last]))
        for epoch in range(max(first, 1), last):
            assert np.array_equal(dynamics.propagate(x, Step(epoch)), whole.propagate(x, Step(epoch)))


def test_an_epoch_without_the_chief_is_refused(scene):
    s = scene(0.0)
    x = s.deputies(100.0, 2)
    dynamics = NonlinearJ2Options().build(DynamicsContext(s.orbit, s.noise, 1.0)).with_chief(np.zeros((2, 3, 6)), 10)
    with pytest.raises(ValueError, match="needs the chief's state at epoch 13; there are those of epochs 10 to 12"):
        dynamics.propagate(x, Step(14))


def test_nominal_chief_follows_j2(scene):
    s = scene(0.1)
    nominal = NominalChief(s.orbit, 10.0)
    chief, _ = s.truth(np.zeros((1, 6)), np.arange(601) * 10.0, zonals=(J2,))
    for epoch in (600, 3, 512, 0):
        np.testing.assert_allclose(nominal.at(epoch)[0], chief[0, epoch], atol=1e-5)
    # One step before the first epoch, for a filter whose first measurement is at epoch 0.
    later = nominal.at(-1)[0]
    assert np.linalg.norm(later[:3] - (chief[0, 0] - 10 * np.append(chief[0, 0, 3:], np.zeros(3)))[:3]) < 500

"""What every registered dynamics promises: shapes, bits, Jacobian, linearity, noise."""

import numpy as np
import pytest

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions
from relnav_sim.dynamics.registry import dynamics_kinds

ORBIT = ChiefOrbit(7.2e6, 0.02, 0.9, 0.3, 0.4, 0.5, 3.986004418e14, 6378137.0, 1.08262668e-3)
NOISE = ProcessNoiseOptions(acceleration_psd_m2_s3=1e-8)
SIZES = np.repeat([5e3, 5.0], 3)
STEP = Step(700, 10.0)


# Learned dynamics need a track to learn from; they have tests of their own.
KINDS = sorted(kind for kind, options in dynamics_kinds().items() if "training_track" not in options.needs)


@pytest.fixture(params=KINDS)
def dynamics(request):
    return dynamics_kinds()[request.param]().build(DynamicsContext(ORBIT, NOISE, 10.0))


@pytest.fixture
def states():
    states = np.random.default_rng(7).normal(size=(20, 13, 6)) * SIZES
    states.setflags(write=False)  # what dynamics are given is not theirs to change
    return states


def test_shapes(dynamics, states):
    assert dynamics.dimension == 6
    assert dynamics.propagate(states, STEP).shape == states.shape
    assert dynamics.propagate(states[:, 0], STEP).shape == (20, 6)
    assert dynamics.transition(states[:, 0], STEP).shape in {(6, 6), (20, 6, 6)}
    Q = dynamics.process_noise(states[:, 0], STEP)
    assert Q.shape == (6, 6)
    assert np.linalg.eigvalsh(Q)[0] > 0


def test_bits_do_not_depend_on_the_block(dynamics, states):
    whole = dynamics.propagate(states, STEP)
    for run in (0, 7, 19):
        assert np.array_equal(dynamics.propagate(states[run : run + 1], STEP)[0], whole[run])
        assert np.array_equal(dynamics.propagate(states[run : run + 1, 4], STEP)[0], whole[run, 4])
        F = dynamics.transition(states[run : run + 1, 0], STEP)
        together = dynamics.transition(states[:, 0], STEP)
        assert np.array_equal(F.reshape(6, 6), together if together.ndim == 2 else together[run])


def test_order_of_calls_does_not_matter(dynamics, states):
    first = dynamics.propagate(states, STEP)
    dynamics.propagate(states, Step(3, 10.0))
    assert np.array_equal(dynamics.propagate(states, STEP), first)


def test_transition_is_the_jacobian_of_propagate(dynamics, states):
    mean = states[:, 0]
    # Central differences of 10 m and 10 mm/s: third derivatives (1e-19 / m^2) times 100 m^2, and rounding at 1e-10.
    for j, size in enumerate(np.repeat([10.0, 0.01], 3)):
        aside = np.zeros(6)
        aside[j] = size
        slope = (dynamics.propagate(mean + aside, STEP) - dynamics.propagate(mean - aside, STEP)) / (2 * size)
        expected = np.broadcast_to(dynamics.transition(mean, STEP), (20, 6, 6))[..., j]
        assert np.abs(slope - expected)[:, :3].max() < 2e-12 / size * 10
        assert np.abs(slope - expected)[:, 3:].max() < 2e-14 / size * 10


def test_linear_dynamics_are_linear(dynamics, states):
    if not dynamics.linear:
        pytest.skip("not linear")
    mean = states[:, 0]
    expected = np.einsum("ij,bj->bi", dynamics.transition(mean, STEP), mean)
    np.testing.assert_allclose(dynamics.propagate(mean, STEP), expected, rtol=1e-13)


def test_two_half_steps_make_one(dynamics, states, request):
    kind = request.node.callspec.params["dynamics"]
    halves = dynamics_kinds()[kind]().build(DynamicsContext(ORBIT, NOISE, 5.0))
    x = states[:, 0]
    for epoch in (1399, 1400):
        x = halves.propagate(x, Step(epoch, 5.0))
    # The quadratic map leaves out third-order terms of the flow, 1e-8 m at 12 km.
    tolerance = 1e-6 if kind == "cw_second_order" else 1e-9
    assert np.abs(x - dynamics.propagate(states[:, 0], STEP))[:, :3].max() < tolerance

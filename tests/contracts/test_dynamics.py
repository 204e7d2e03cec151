"""What every registered dynamics promises: shapes, bits, Jacobian, linearity, noise."""

import numpy as np
import pytest

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.epoch import Epoch
from relnav_sim.dynamics.chief_segments import NominalChief
from relnav_sim.dynamics.context import Arrival, ChiefFixes, DynamicsContext, TrainingTrack
from relnav_sim.dynamics.field_motion import REST_GRADIENT
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions
from relnav_sim.dynamics.registry import build_dynamics, dynamics_kinds

ORBIT = ChiefOrbit(7.2e6, 0.02, 0.9, 0.3, 0.4, 0.5, 3.986004418e14, 6378137.0, 1.08262668e-3)
NOISE = ProcessNoiseOptions(acceleration_psd_m2_s3=1e-8)
SIZES = np.repeat([5e3, 5.0], 3)
STEP = Step(700, 10.0)
EPOCH = Epoch.parse("2025-03-20T12:00:00 UTC")


# What is learned of a track is no closed motion: its Jacobian, linearity and steps have tests of their own.
LEARNED = sorted(kind for kind, options in dynamics_kinds().items() if "training_track" in options.needs)
KINDS = sorted(dynamics_kinds().keys() - set(LEARNED))
ABOUT_CHIEF = sorted(kind for kind, options in dynamics_kinds().items() if "chief_fixes" in options.needs)


@pytest.fixture(params=KINDS)
def dynamics(request):
    return dynamics_kinds()[request.param]().build(DynamicsContext(ORBIT, NOISE, 10.0, epoch=EPOCH))


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


def test_transition_is_the_jacobian_of_propagate(dynamics, states, request):
    mean = states[:, 0]
    # The gradient of a field's other harmonics is left out, in 10 s: its square by half, and once.
    left = REST_GRADIENT if request.node.callspec.params["dynamics"] == "nonlinear_field" else 0.0
    # Central differences of 10 m and 10 mm/s: third derivatives (1e-19 / m^2) times 100 m^2, and rounding at 1e-10.
    for j, size in enumerate(np.repeat([10.0, 0.01], 3)):
        aside = np.zeros(6)
        aside[j] = size
        slope = (dynamics.propagate(mean + aside, STEP) - dynamics.propagate(mean - aside, STEP)) / (2 * size)
        expected = np.broadcast_to(dynamics.transition(mean, STEP), (20, 6, 6))[..., j]
        assert np.abs(slope - expected)[:, :3].max() < 2e-12 / size * 10 + 50 * left * (1 if j < 3 else 10 / 3)
        assert np.abs(slope - expected)[:, 3:].max() < 2e-14 / size * 10 + 10 * left * (1 if j < 3 else 5)


def test_linear_dynamics_are_linear(dynamics, states):
    if not dynamics.linear:
        pytest.skip("not linear")
    mean = states[:, 0]
    expected = np.einsum("ij,bj->bi", dynamics.transition(mean, STEP), mean)
    np.testing.assert_allclose(dynamics.propagate(mean, STEP), expected, rtol=1e-13)


def test_two_half_steps_make_one(dynamics, states, request):
    kind = request.node.callspec.params["dynamics"]
    halves = dynamics_kinds()[kind]().build(DynamicsContext(ORBIT, NOISE, 5.0, epoch=EPOCH))
    x = states[:, 0]
    for epoch in (1399, 1400):
        x = halves.propagate(x, Step(epoch, 5.0))
    # The quadratic map leaves out third-order terms of the flow, 1e-8 m at 12 km.
    tolerance = 1e-6 if kind == "cw_second_order" else 1e-9
    assert np.abs(x - dynamics.propagate(states[:, 0], STEP))[:, :3].max() < tolerance


@pytest.mark.parametrize("kind", dynamics_kinds())
def test_the_options_say_what_they_are(kind):
    options = dynamics_kinds()[kind]
    assert issubclass(options, DynamicsOptions) and options().kind == kind
    assert options.__doc__ and all(field.description for field in options.model_fields.values())
    costs = options.step_cost_us, options.step_overhead_us, options.shared_overhead_us, options.shared_epoch_bytes
    assert min(costs) >= 0


@pytest.mark.parametrize("kind", ABOUT_CHIEF)
def test_fed_with_fixes_a_run_does_not_depend_on_its_block(kind, states):
    nominal = NominalChief(ORBIT, 10.0)
    chief = np.stack([nominal.at(epoch)[0] for epoch in range(8)])
    sigmas = np.repeat([30.0, 0.1], 3)
    fixes = chief + np.random.default_rng(2).normal(size=(3, 8, 6)) * sigmas
    fixes[1, 3:5] = np.nan

    def moved(runs):
        context = DynamicsContext(ORBIT, NOISE, 10.0, ChiefFixes(sigmas, len(runs)), epoch=EPOCH)
        fed, x, ends = build_dynamics(dynamics_kinds()[kind](), context), states[[0] * len(runs), 0], []
        for first in (0, 4):
            fed.feed(Arrival(first, fixes[runs, first : first + 4]))
            ends += [fed.propagate(x, Step(epoch, 10.0)) for epoch in range(max(first, 1), first + 4)]
        return np.stack(ends, axis=1)

    together = moved([0, 1, 2])
    assert together.shape == (3, 7, 6) and np.isfinite(together).all()
    for run in range(3):
        assert np.array_equal(moved([run])[0], together[run])
    assert not np.array_equal(together[0], together[1])  # the same state about another estimate of the chief


@pytest.mark.parametrize("kind", ABOUT_CHIEF)
def test_about_given_states_of_the_chief_each_run_has_its_own(kind, states):
    nominal = NominalChief(ORBIT, 10.0)
    chief = np.stack([nominal.at(epoch) for epoch in range(20)])
    given = build_dynamics(dynamics_kinds()[kind](), DynamicsContext(ORBIT, NOISE, 10.0, epoch=EPOCH))
    mean = states[:, 0]
    F = given.with_chief(chief, first_epoch=0).transition(mean, Step(1, 10.0))
    for epoch in (0, 7, 19):
        first = 0 if "epoch" in dynamics_kinds()[kind].needs else epoch  # the others are the same at any time
        alone = given.with_chief(chief[epoch : epoch + 1], first_epoch=first)
        expected = alone.transition(mean[epoch : epoch + 1], Step(first + 1, 10.0))[0]
        assert np.array_equal(F[epoch], expected)


@pytest.fixture(scope="module", params=LEARNED)
def learned(request):
    options = dynamics_kinds()[request.param]()
    wanted = options.training_request(ORBIT)
    motion = dynamics_kinds()["nonlinear"]().build(DynamicsContext(ORBIT, NOISE, 10.0))
    track = [np.array([50.0, -2000.0, 100.0, 0.05, -0.1, 0.02])]
    for epoch in range(1, int(np.ceil(wanted.duration_s / 10.0)) + 1):
        track.append(motion.propagate(track[-1][None], Step(epoch, 10.0))[0])
    times = 10.0 * np.arange(1.0 - len(track), 1.0)
    known = TrainingTrack(np.array(track), times, ORBIT)
    return build_dynamics(options, DynamicsContext(ORBIT, NOISE, 10.0, learn=lambda fit: fit(known))), np.array(
        track[::100]
    )


@pytest.mark.slow  # the fit takes seconds
def test_learned_dynamics_have_the_shapes_and_bits_of_the_others(learned):
    dynamics, mean = learned
    mean.setflags(write=False)
    runs = len(mean)
    particle_set = np.repeat(mean[:, None], 3, axis=1)
    assert dynamics.propagate(particle_set, STEP).shape == particle_set.shape
    end, Q = dynamics.propagate(mean, STEP), dynamics.process_noise(mean, STEP)
    F = np.broadcast_to(dynamics.transition(mean, STEP), (runs, 6, 6))
    assert end.shape == mean.shape and Q.shape in {(6, 6), (runs, 6, 6)}
    for run in range(runs):
        alone = mean[run : run + 1]
        assert np.array_equal(dynamics.propagate(alone, STEP)[0], end[run])
        assert np.array_equal(dynamics.transition(alone, STEP).reshape(6, 6), F[run])

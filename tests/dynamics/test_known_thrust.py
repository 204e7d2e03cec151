"""Known thrust around any dynamics: against the truth, the exact input matrix, and derivatives."""

import json

import numpy as np
import pytest

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.epoch import Epoch
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.known_thrust import KnownThrust, kicks_of
from relnav_sim.dynamics.orbit_filter import OrbitFilter, OrbitFilterOptions
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions, van_loan
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.streams import RandomSource
from relnav_sim.truth import TruthOptions, nominal_chief, truth_trajectory
from relnav_sim.truth.thrust import planned, step_forces

ORBIT = ChiefOrbit(7.2e6, 0.02, 0.9, 0.3, 0.4, 0.5, 3.986004418e14, 6378137.0, 1.08262668e-3)
NOISE = ProcessNoiseOptions(acceleration_psd_m2_s3=1e-8)
KINDS = sorted(kind for kind, options in dynamics_kinds().items() if "training_track" not in options.needs)
SIZES = np.repeat([5e3, 5.0], 3)
STEP = Step(4, 10.0)
EPOCH = Epoch.parse("2026-01-01T00:00:00 UTC")


def base(kind, orbit=ORBIT, step_s=10.0):
    return dynamics_kinds()[kind]().build(DynamicsContext(orbit, NOISE, step_s, epoch=EPOCH))


def forces(runs=20, seed=1, size=0.05):
    """Forces in the steps to epochs 3, 4 and 5: none in the first."""
    f = size * np.random.default_rng(seed).normal(size=(runs, 3, 2, 2, 3))
    f[:, 0] = 0
    return f


@pytest.fixture
def states():
    return np.random.default_rng(7).normal(size=(20, 13, 6)) * SIZES


@pytest.mark.parametrize("kind", KINDS)
def test_without_thrust_it_is_the_base_to_the_bit(kind, states):
    alone, told = base(kind), KnownThrust(base(kind), ORBIT, 10.0)
    for _ in range(2):
        assert np.array_equal(told.propagate(states, Step(3, 10.0)), alone.propagate(states, Step(3, 10.0)))
        assert np.array_equal(
            told.transition(states[:, 0], Step(3, 10.0)), alone.transition(states[:, 0], Step(3, 10.0))
        )
        told.take(forces(), 3)


@pytest.mark.parametrize("kind", KINDS)
def test_transition_and_input_matrix_are_the_derivatives(kind, states):
    told, mean = KnownThrust(base(kind), ORBIT, 10.0), states[:, 0]
    told.take(forces(), 3)
    F = np.broadcast_to(told.transition(mean, STEP), (20, 6, 6))
    for j, size in enumerate(np.repeat([10.0, 0.01], 3)):
        aside = np.zeros(6)
        aside[j] = size
        slope = (told.propagate(mean + aside, STEP) - told.propagate(mean - aside, STEP)) / (2 * size)
        # The deputy's axes turn with its state by 1 / a per metre: dv / a, 2 m/s / 7e6 m, times the step is left out.
        assert np.abs(slope - F[..., j])[:, :3].max() < (3e-6 if j < 3 else 3e-3)
        assert np.abs(slope - F[..., j])[:, 3:].max() < (3e-7 if j < 3 else 3e-4)
    G = np.broadcast_to(told.input_matrix(mean, STEP), (20, 6, 3))
    for j in range(3):
        more = forces()
        more[:, 1, 1, :, j] += 1e-4
        pushed = KnownThrust(base(kind), ORBIT, 10.0)
        pushed.take(more, 3)
        change = pushed.propagate(mean, STEP) - told.propagate(mean, STEP)
        # In the deputy's own axes, which stand at 5 km / a = 7e-4 rad times some spread to the chief's.
        np.testing.assert_allclose(change / 1e-4, G[..., j], atol=0.005 * np.abs(G).max())


def test_a_constant_force_is_van_loans_input_matrix():
    """Of a circular orbit's linear dynamics; the kicks' error falls with the square of the angle turned in a step."""
    orbit = ChiefOrbit(7e6, 0.0, 0.9, 0.0, 0.0, 0.0, 3.986004418e14, 6378137.0, 0.0)
    B = np.vstack([np.zeros((3, 3)), np.eye(3)])
    errors = []
    for step_s in (5.0, 10.0, 20.0):
        A = np.zeros((9, 9))
        A[:6, :6], A[:6, 6:] = cw_system(orbit.mean_motion_rad_s), B
        G = van_loan(A, np.eye(9), np.zeros((9, 9)), step_s)[0][:6, 6:]
        ours = KnownThrust(base("cw", orbit, step_s), orbit, step_s).input_matrix(np.zeros((1, 6)), Step(1, step_s))
        errors.append(np.abs(ours - G)[3:].max() / step_s)
    assert errors[0] < 2e-5
    np.testing.assert_allclose(np.array(errors[1:]) / errors[:-1], 4, rtol=0.01)


MANOEUVRES = {
    "impulse at an epoch": {"time_s": 100.0, "delta_v_m_s": [0.1, 0.5, -0.2]},
    "impulse between": {"time_s": 103.4, "delta_v_m_s": [0.1, 0.5, -0.2]},
    "burn": {"time_s": 101.7, "duration_s": 133.0, "acceleration_m_s2": [1e-3, 2e-3, 3e-3]},
    "chief, impulse at an epoch": {"craft": "chief", "time_s": 100.0, "delta_v_m_s": [0.1, 0.5, -0.8]},
    "chief, burn": {"craft": "chief", "time_s": 101.3, "duration_s": 150.0, "acceleration_m_s2": [1e-3, -2e-3, 3e-3]},
}


@pytest.mark.parametrize("name", MANOEUVRES)
@pytest.mark.parametrize("step_s, position_m, velocity_m_s", [(1.0, 4e-3, 4e-5), (5.0, 1.5e-2, 6e-5)])
def test_against_the_truth(name, step_s, position_m, velocity_m_s):
    """Exact dynamics about the true chief, told of the true thrust, 12 km away; the truth knows no kicks in a burn.

    The chief's kick turns the frame: without that the errors were 1.6 m and 1e-3 m/s.
    """
    craft = {"mass_kg": 100, "area_m2": 1}
    data = {
        "chief": {**craft, "orbit": {"a_km": 7137, "e": 0.01, "i_deg": 42}},
        "deputy": {**craft, "relative": {"position_m": [100, 12000, -50], "velocity_m_s": [0.1, 0.2, -0.3]}},
        "forces": {"zonals": 2, "drag": "none"},
        "manoeuvres": {"one": MANOEUVRES[name]},
    }
    options = TruthOptions.model_validate_json(json.dumps(data), strict=True)
    times = np.arange(0, 301, step_s)
    truth = truth_trajectory(options, 300.0, RandomSource(0, (0,))).at(times)
    orbit = nominal_chief(options)
    exact = base("nonlinear_j2", orbit, step_s).with_chief(truth.chief, 0)
    told = KnownThrust(exact, orbit, step_s)
    thrust = planned(options.manoeuvres["one"])
    known = np.zeros((1, len(times), 2, 2, 3))
    known[:, :, thrust.craft] = step_forces(thrust, times, step_s)
    told.take(known, 0)
    state = truth.relative[:, 0]
    for k in range(1, len(times)):
        state = told.propagate(state, Step(k, step_s))
    error = np.abs(state - truth.relative[:, -1])
    if "at an epoch" in name:
        position_m, velocity_m_s = 5e-4, 1e-6
    assert error[:, :3].max() < position_m
    assert error[:, 3:].max() < velocity_m_s


def test_bits_do_not_depend_on_what_other_runs_do(states):
    mixed = forces()
    mixed[5:, 1] = 0
    noise = np.random.default_rng(2).normal(size=(20, 3, 6, 6)) ** 2
    whole = KnownThrust(base("nonlinear"), ORBIT, 10.0)
    whole.take(mixed, 3, noise)
    for run in (2, 9, 19):
        alone = KnownThrust(base("nonlinear"), ORBIT, 10.0)
        alone.take(mixed[run : run + 1], 3, noise[run : run + 1])
        one = states[run : run + 1]
        assert np.array_equal(alone.propagate(one, STEP)[0], whole.propagate(states, STEP)[run])
        F = whole.transition(states[:, 0], STEP)
        assert np.array_equal(alone.transition(one[:, 0], STEP)[0], F[run])
        Q = whole.process_noise(states, STEP)
        assert np.array_equal(alone.process_noise(one, STEP)[0], Q[run])


def test_noise_is_added_to_q_and_keeps_its_shape(states):
    told = KnownThrust(base("cw"), ORBIT, 10.0)
    Q = told.process_noise(states[:, 0], STEP)
    told.take(forces(1), 3, np.tile(np.eye(6), (3, 1, 1)))
    np.testing.assert_array_equal(told.process_noise(states[:, 0], STEP), Q + np.eye(6))
    told.take(forces(), 3, np.tile(np.eye(6), (20, 3, 1, 1)))
    assert told.process_noise(states, STEP).shape == told.process_noise(states[:, 0], STEP).shape == (20, 6, 6)


def test_kicks_and_unknown_steps():
    before, after = kicks_of(np.array([[1.0, 2.0, 3.0], [2.0, 2.0, 0.0]]), 2.0)
    np.testing.assert_array_equal(before, [2, 2, 0])
    np.testing.assert_array_equal(after, [0, 2, 6])
    told = KnownThrust(base("cw"), ORBIT, 10.0)
    told.take(forces(), 3)
    with pytest.raises(
        ValueError, match="the thrust of the step to epoch 6 is not known; there is that of epochs 3 to 5"
    ):
        told.propagate(np.zeros((20, 6)), Step(6, 10.0))


def test_the_chiefs_orbit_filter_follows_its_known_thrust():
    """Five seconds after 2 m/s it still believes in the old velocity, unless it is told."""
    craft = {"mass_kg": 100, "area_m2": 1}
    data = {
        "chief": {**craft, "orbit": {"a_km": 7137, "e": 0.01, "i_deg": 42}},
        "deputy": {**craft, "relative": {"position_m": [0, 100, 0], "velocity_m_s": [0, 0, 0]}},
        "forces": {"zonals": 2, "drag": "none"},
        "manoeuvres": {"one": {"craft": "chief", "time_s": 200.3, "delta_v_m_s": [0.5, 1.5, -1.2]}},
    }
    options = TruthOptions.model_validate_json(json.dumps(data), strict=True)
    times = np.arange(0, 206.0)
    chief = truth_trajectory(options, 300.0, RandomSource(0, (0,))).at(times).chief
    fixes = chief + np.repeat([10.0, 0.5], 3) * np.random.default_rng(3).normal(size=(20, 206, 6))
    forces = step_forces(planned(options.manoeuvres["one"]), times, 1.0)
    errors = []
    for known in (None, forces):
        sigmas = np.repeat([10.0, 0.5], 3)
        follower = OrbitFilter(OrbitFilterOptions(), nominal_chief(options).up_to(2), sigmas, 1.0, 20)
        errors.append(np.linalg.norm((follower.advance(fixes, known) - chief)[:, -1, 3:], axis=-1).mean())
    assert errors[0] > 1.0
    assert errors[1] < 0.2

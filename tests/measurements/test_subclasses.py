"""A class that changes one part of a measurement is believed in all that filters ask of it."""

import copy
import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.measurements.converted_radar import ConvertedRadar
from relnav_sim.measurements.sight import Sight
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar
from relnav_sim.measurements.tangent_sight import TangentSight

SIGMAS = np.array([4.0, 1e-3, 1e-3])
NOISE = SightNoise(np.ones(1), SIGMAS[None], SIGMAS, np.zeros((3, 3)))
MEAN0, COV0 = np.array([0.0, 5000.0, 200.0, 0.0, 0.0, 0.0]), np.diag([10.0] * 3 + [0.1] * 3) ** 2
MADE = {
    SphericalRadar: lambda kind: kind(np.eye(3), NOISE),
    TangentSight: lambda kind: kind(Sight(np.eye(3), "chief", None), NOISE),
    ConvertedRadar: lambda kind: kind(np.eye(3), NOISE),
}
READING = {SphericalRadar: [5010.0, 0.05, 0.04], TangentSight: [5010.0, 0.05, 0.04], ConvertedRadar: [5, 5010, 190]}


class Biased:
    def predict(self, states, epoch):
        return super().predict(states, epoch) + np.array([50.0, 0.0, 0.0])


class Steep:
    def jacobian(self, states, epoch):
        return 2 * super().jacobian(states, epoch)


class Noisy:
    def noise(self, mean, epoch):
        return 100 * super().noise(mean, epoch)


class Backwards:
    def residual(self, z, predicted):
        return -super().residual(z, predicted)


class Parts:
    """A measurement of which only the parts are known."""

    def __init__(self, base):
        self.dimension, self.take = base.dimension, base.take
        self.angles, self.depends_on, self.whole = base.angles, base.depends_on, base.whole
        self.predict, self.jacobian, self.noise, self.residual = base.predict, base.jacobian, base.noise, base.residual
        self.mixture = base.mixture


def estimate(kind, options, measurement, z):
    filter = create_filter(kind, LinearDynamics(np.eye(6), 1e-3 * np.eye(6)), measurement, **options)
    return run_filter(filter, z, MEAN0, COV0).mean


@pytest.mark.parametrize(("kind", "options"), [("ekf", {}), ("alpha_kf", {"samples": 64, "sampling": "fixed"})])
@pytest.mark.parametrize("change", [Biased, Steep, Noisy, Backwards])
@pytest.mark.parametrize("base", MADE)
def test_a_measurement_of_which_one_part_is_changed(kind, options, change, base):
    changed, plain = MADE[base](type("Changed", (change, base), {})), MADE[base](base)
    z = np.tile(READING[base], (1, 3, 1))
    found = estimate(kind, options, changed, z)
    np.testing.assert_allclose(found, estimate(kind, options, Parts(changed), z), rtol=1e-9, atol=1e-9)
    if kind == "ekf":
        assert np.abs(found - estimate(kind, options, plain, z)).max() > 1e-3


# What `noise` calls where the attitude has an error.
WITHIN = {SphericalRadar: "_covariance", ConvertedRadar: "_covariances", TangentSight: "_turned"}
SAMPLING = {"samples": 64, "sampling": "fixed"}


@pytest.mark.parametrize(("kind", "options"), [("ekf", {}), ("ukf", {}), ("alpha_kf", SAMPLING)])
@pytest.mark.parametrize("base", MADE)
def test_what_a_part_calls_is_replaced_as_the_part_itself_is(kind, options, base, monkeypatch):
    def noisy(self, *arguments):
        return 100 * getattr(base, WITHIN[base])(self, *arguments)

    monkeypatch.setitem(globals(), "NOISE", replace(NOISE, attitude=1e-6 * np.eye(3)))
    within, changed = type("Within", (base,), {WITHIN[base]: noisy}), type("Changed", (Noisy, base), {})
    z = np.tile(READING[base], (1, 3, 1))
    found, expected, plain = (estimate(kind, options, MADE[base](each), z) for each in (within, changed, base))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    assert np.abs(found - plain).max() > 1e-3


def test_angles_of_a_class_are_those_that_are_wrapped():
    class Wound(SphericalRadar):
        """Azimuth counted on beyond a turn."""

        angles = ()

    radar, state = Wound(np.eye(3), NOISE), MEAN0[None]
    z = radar.predict(state, 0) + np.array([0.0, 2 * np.pi, 0.0])
    assert radar.linearised(z, state, 0)[0][0, 1] == pytest.approx(2 * np.pi)
    assert SphericalRadar(np.eye(3), NOISE).linearised(z, state, 0)[0][0, 1] == pytest.approx(0, abs=1e-12)


def test_a_class_that_says_more_keeps_what_it_says():
    class Told(SphericalRadar):
        def predict(self, states, epoch):
            raise AssertionError("what is linearised in one go does not ask for it")

        def linearised(self, z, mean, epoch):
            return np.zeros((len(z), 3)), np.eye(3, 6), np.eye(3)

    class Heir(Told):
        pass

    for kind in (Told, Heir):
        radar = kind(np.eye(3), NOISE)
        assert (radar.linearised(np.ones((2, 3)), np.ones((2, 6)), 0)[0] == 0).all()
    assert Heir.linearised is Told.linearised


def given(base, name, value):
    """Return a measurement of which one part is replaced in that object alone."""
    measurement = MADE[base](base)
    setattr(measurement, name, value(measurement))
    return measurement


ASSIGNED = {
    "predict": lambda own: partial(plus, own.predict, np.array([50.0, 0.0, 0.0])),
    "jacobian": lambda own: partial(times, 2, own.jacobian),
    "noise": lambda own: partial(times, 100, own.noise),
    "residual": lambda own: partial(times, -1, own.residual),
}


def plus(function, what, *arguments):
    return function(*arguments) + what


def times(factor, function, *arguments):
    return factor * function(*arguments)


@pytest.mark.parametrize(("kind", "options"), [("ekf", {}), ("alpha_kf", SAMPLING)])
@pytest.mark.parametrize("name", ASSIGNED)
@pytest.mark.parametrize("base", MADE)
@pytest.mark.parametrize("sent", [False, True])
def test_a_part_assigned_to_one_measurement_is_as_one_of_its_class(kind, options, name, base, sent):
    changed, z = given(base, name, ASSIGNED[name]), np.tile(READING[base], (1, 3, 1))
    changed = pickle.loads(pickle.dumps(changed)) if sent else changed
    found = estimate(kind, options, changed, z)
    np.testing.assert_allclose(found, estimate(kind, options, Parts(changed), z), rtol=1e-9, atol=1e-9)
    if kind == "ekf":
        assert np.abs(found - estimate(kind, options, MADE[base](base), z)).max() > 1e-3


def test_angles_and_private_functions_assigned_to_one_measurement_count(monkeypatch):
    radar, state = MADE[SphericalRadar](SphericalRadar), MEAN0[None]
    z = radar.predict(state, 0) + np.array([0.0, 2 * np.pi, 0.0])
    radar.angles = ()
    assert radar.linearised(z, state, 0)[0][0, 1] == pytest.approx(2 * np.pi)
    monkeypatch.setitem(globals(), "NOISE", replace(NOISE, attitude=1e-6 * np.eye(3)))
    z = np.tile(READING[SphericalRadar], (1, 3, 1))
    within = given(SphericalRadar, "_covariance", lambda own: partial(times, 100, own._covariance))
    noisy = given(SphericalRadar, "noise", ASSIGNED["noise"])
    expected = estimate("ekf", {}, noisy, z)
    np.testing.assert_allclose(estimate("ekf", {}, within, z), expected, rtol=1e-9, atol=1e-9)
    assert np.abs(expected - estimate("ekf", {}, MADE[SphericalRadar](SphericalRadar), z)).max() > 1e-3


@pytest.mark.parametrize("name", ["propagate", "transition", "process_noise"])
def test_a_part_assigned_to_linear_dynamics_counts(name):
    class Derived(LinearDynamics):
        pass

    dynamics = LinearDynamics(np.eye(6), 1e-3 * np.eye(6))
    other = partial(times, 1.01, getattr(dynamics, name))
    setattr(Derived, name, lambda self, *arguments: other(*arguments))
    setattr(dynamics, name, other)
    z, radar = np.tile(READING[SphericalRadar], (1, 3, 1)), MADE[SphericalRadar](SphericalRadar)
    flown = [
        run_filter(create_filter("ekf", each, radar), z, MEAN0, COV0).mean
        for each in (dynamics, Derived(np.eye(6), 1e-3 * np.eye(6)), LinearDynamics(np.eye(6), 1e-3 * np.eye(6)))
    ]
    np.testing.assert_array_equal(flown[0], flown[1])
    assert np.abs(flown[0] - flown[2]).max() > 1e-6


@pytest.mark.parametrize("name", ["predict", "correct", "update"])
def test_a_function_assigned_to_one_filter_is_called(name):
    def made():
        return create_filter("ekf", LinearDynamics(np.eye(6), 1e-3 * np.eye(6)), MADE[SphericalRadar](SphericalRadar))

    calls = []

    def counted(*arguments, **by_name):
        calls.append(name)
        return own(*arguments, **by_name)

    changed, z = made(), np.tile(READING[SphericalRadar], (1, 3, 1))
    own = getattr(changed, name)
    setattr(changed, name, counted)
    found = run_filter(changed, z, MEAN0, COV0)
    assert len(calls) >= 2
    np.testing.assert_array_equal(found.mean, run_filter(made(), z, MEAN0, COV0).mean)


def test_a_function_of_another_dynamics_object_counts():
    z, radar, Q = np.tile(READING[SphericalRadar], (1, 3, 1)), MADE[SphericalRadar](SphericalRadar), 1e-3 * np.eye(6)
    other = LinearDynamics(1.01 * np.eye(6), Q)
    changed = LinearDynamics(np.eye(6), Q)
    changed.propagate = other.propagate
    wrapped = LinearDynamics(np.eye(6), Q)
    wrapped.propagate = lambda states, step: other.propagate(states, step)
    found, expected = (
        run_filter(create_filter("ekf", each, radar), z, MEAN0, COV0).mean for each in (changed, wrapped)
    )
    np.testing.assert_array_equal(found, expected)
    assert not changed.moves_by_transition and changed.known_steps(0, 2) is None


@pytest.mark.parametrize("name", ASSIGNED)
@pytest.mark.parametrize(("kind", "options"), [("ekf", {}), ("alpha_kf", SAMPLING)])
def test_a_part_assigned_to_the_measurement_of_a_filter_counts(kind, options, name):
    z, Q = np.tile(READING[SphericalRadar], (1, 3, 1)), 1e-3 * np.eye(6)
    filter = create_filter(kind, LinearDynamics(np.eye(6), Q), MADE[SphericalRadar](SphericalRadar), **options)
    setattr(filter.measurement, name, ASSIGNED[name](MADE[SphericalRadar](SphericalRadar)))
    expected = estimate(kind, options, given(SphericalRadar, name, ASSIGNED[name]), z)
    np.testing.assert_allclose(run_filter(filter, z, MEAN0, COV0).mean, expected, rtol=1e-12)


def test_a_copy_follows_from_its_own_parts():
    radar, state = MADE[SphericalRadar](SphericalRadar), MEAN0[None]
    radar.noise = lambda mean, epoch: 5 * np.eye(3)
    other = copy.copy(radar)
    other.noise = lambda mean, epoch: 7 * np.eye(3)
    z = radar.predict(state, 0)
    assert radar.linearised(z, state, 0)[2][0, 0] == 5 and other.linearised(z, state, 0)[2][0, 0] == 7

"""A class that changes one part of a measurement is believed in all that filters ask of it."""

from dataclasses import replace

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

"""The crosslink: range and range rate, and what the clocks do to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from relnav_sim import ForceModel, propagate, rtn_from_eci
from relnav_sim.sensors import SensorSuite, sensor_measurement
from relnav_sim.sensors.availability import sensed
from relnav_sim.sensors.suite import streams_of

Array = NDArray[np.float64]
LINK = {"kind": "crosslink", "range_sigma_m": 0.5, "range_rate_sigma_m_s": 0.01}
EXACT = {**LINK, "range_sigma_m": 1e-9, "range_rate_sigma_m_s": 1e-12}
CLOCK = {"clock_bias_sigma_m": 30.0, "clock_drift_sigma_m_s": 0.2}
STEP_S = 1.0


@dataclass(frozen=True)
class Flight:
    """Two craft on orbits of their own: epochs (K,), ECI states (1, K, 6)."""

    times_s: Array
    chief: Array
    deputy: Array

    def part(self, first: int, epochs: int) -> Flight:
        window = slice(first, first + epochs)
        return Flight(self.times_s[window], self.chief[:, window], self.deputy[:, window])


@pytest.fixture(scope="module")
def flight() -> Flight:
    times = np.arange(64) * STEP_S
    chief = np.array([[7.0e6, 0.0, 0.0, 0.0, 5300.0, 5300.0]])
    deputy = chief + np.array([200.0, 300.0, -100.0, 0.3, -0.5, 0.8])
    earth = ForceModel(3.986004418e14, 6378137.0, zonals=())
    states = propagate(np.concatenate([chief, deputy]), times, earth)
    return Flight(times, states[:1], states[1:])


def sensors(scene, **options):
    return scene.sensors(radar=None, link={**LINK, **options})


def read(scene, flight, runs=2, chunk=64, **options):
    suite = SensorSuite(sensors(scene, **options), scene.source(runs), STEP_S)
    parts = [suite.measure(flight.part(k, chunk), k)["link"] for k in range(0, 64, chunk)]
    return np.concatenate(parts, axis=1)


@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_it_reads_the_distance_and_its_derivative(scene, flight, host):
    z = read(scene, flight, **EXACT, host=host)
    distance = np.linalg.norm(flight.deputy[0, :, :3] - flight.chief[0, :, :3], axis=1)
    assert np.allclose(z[..., 0], distance, rtol=0, atol=1e-7)
    assert np.allclose(z[:, 1:-1, 1], (distance[2:] - distance[:-2]) / (2 * STEP_S), rtol=0, atol=2e-5)


def test_residuals_of_the_true_state_are_the_noise_a_filter_is_told(scene, flight):
    """The state's velocity is that of RTN components, so the range rate needs no rate of the frame."""
    runs = 200
    z = read(scene, flight, runs, noise={"kind": "mixture", "scale": 3, "fraction": 0.2})
    model = sensor_measurement("link", sensors(scene), scene.ORBIT, STEP_S)
    relative = rtn_from_eci(flight.chief, flight.deputy)
    nu = z - model.predict(relative, 0)
    N = runs * 64
    assert (np.abs(nu.mean(axis=(0, 1))) < 4 * np.sqrt(2.6) * np.array([0.5, 0.01]) / np.sqrt(N)).all()
    # Kurtosis of the mixture: (0.8 + 0.2 81) 3 / 2.6^2 = 7.54, so the variance varies by sqrt(6.54 / N).
    ratio = nu.var(axis=(0, 1)) / (2.6 * np.square([0.5, 0.01]))
    assert (np.abs(ratio - 1) < 4 * np.sqrt(6.54 / N)).all()


def test_clocks_add_a_bias_and_a_drift_of_each_run(scene, flight):
    runs = 200
    plain, off = read(scene, flight, runs), read(scene, flight, runs, **CLOCK)
    error = off - plain
    drift = error[:, 0, 1]
    assert np.allclose(error[..., 1], drift[:, None], rtol=0, atol=1e-12)
    assert np.allclose(error[..., 0], error[:, :1, 0] + drift[:, None] * flight.times_s, rtol=0, atol=1e-9)
    squared = np.stack([error[:, 0, 0] / 30.0, drift / 0.2]) ** 2
    low, high = chi2.ppf([1e-4, 1 - 1e-4], runs)
    assert ((low < squared.sum(axis=1)) & (squared.sum(axis=1) < high)).all()
    options = sensors(scene, **CLOCK)["link"]
    streams = streams_of("link", options, "chief", scene.source(runs), STEP_S)
    assert np.allclose(options.slow_errors(sensed(flight, "chief", STEP_S), streams), error, rtol=0, atol=1e-9)
    drifting = {**LINK, "noise": [{"kind": "gaussian"}, {"kind": "gauss_markov", "tau_s": 60}]}
    unknown = sensors(scene, **drifting)["link"].slow_errors(sensed(flight, "chief", STEP_S), streams)
    assert np.isnan(unknown).all()


def test_bits_do_not_depend_on_block_and_chunks(scene, flight):
    whole = read(scene, flight, 5, **CLOCK)
    assert np.array_equal(read(scene, flight, 5, chunk=16, **CLOCK), whole)
    assert np.array_equal(read(scene, flight, (3,), **CLOCK), whole[3:4])


def test_where_the_craft_meet_nothing_is_read(scene, flight):
    together = Flight(flight.times_s, flight.chief, flight.chief.copy())
    with np.errstate(all="raise"):
        assert np.isnan(read(scene, together, **CLOCK)).all()
    assert np.isnan(read(scene, flight, range_limits_m=[1, 300])).all()


def test_a_range_that_would_not_be_positive_is_no_reading_whatever_the_clocks(scene, flight):
    close = Flight(flight.times_s, flight.chief, flight.chief + np.array([0, 1.0, 0, 0, 0, 0]))
    runs = 400
    z = read(scene, close, runs, range_sigma_m=1.0, **CLOCK)
    assert np.array_equal(np.isnan(z[..., 0]), np.isnan(z[..., 1]))
    expected = float(sensors(scene, range_sigma_m=1.0)["link"].no_echo(np.array(1.0)))
    assert abs(np.isnan(z[..., 0]).mean() - expected) < 4 * np.sqrt(expected * (1 - expected) / (runs * 64))
    assert (z[np.isfinite(z)] < 0).any()  # the clocks' error may well put a range below zero


def test_without_a_range_rate_sigma_it_reads_the_range_alone(scene, flight):
    alone = {**EXACT, "range_rate_sigma_m_s": None}
    z = read(scene, flight, **alone, **{**CLOCK, "clock_drift_sigma_m_s": 0.0})
    distance = np.linalg.norm(flight.deputy[0, :, :3] - flight.chief[0, :, :3], axis=1)
    error = z[..., 0] - distance
    assert z.shape == (2, 64, 1)
    assert np.allclose(error, error[:, :1], rtol=0, atol=1e-7)
    assert np.abs(error[:, 0]).min() > 0.1
    made = sensors(scene, range_rate_sigma_m_s=None, clock_bias_sigma_m=30.0)["link"]
    assert made.channel_names == ("range",)
    assert [error.kind for error in made.drawn_errors()] == ["range_bias"]
    model = sensor_measurement("link", sensors(scene, range_rate_sigma_m_s=None), scene.ORBIT, STEP_S)
    assert np.array_equal(model.noise(np.zeros((1, 6)), 0), [[0.25]])


def test_a_drift_of_clocks_needs_a_range_rate(scene):
    with pytest.raises(ValueError, match="give range_rate_sigma_m_s"):
        sensors(scene, range_rate_sigma_m_s=None, **CLOCK)
    with pytest.raises(ValueError, match="channel"):
        parts = [{"kind": "gaussian"}, {"kind": "bias", "value": [1.0, 2.0]}]
        sensors(scene, range_rate_sigma_m_s=None, noise=parts)

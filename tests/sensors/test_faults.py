"""Faults of sensors: what they do to readings, and that a run's readings still do not depend on how it is split."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from pydantic import ValidationError

from relnav_sim import eci_from_rtn
from relnav_sim.sensors import SensorSuite
from relnav_sim.sensors.gnss import GnssOptions
from relnav_sim.sensors.noise import GaussianNoise, OutageNoise, RampNoise, StepNoise, StuckNoise, WrongTargetNoise
from relnav_sim.sensors.radar import RadarOptions
from relnav_sim.streams import RandomSource

EPOCHS, STEP_S = 40, 2.0


@dataclass(frozen=True)
class States:
    times_s: np.ndarray
    chief: np.ndarray
    deputy: np.ndarray

    def part(self, which):
        return States(self.times_s[which], self.chief[:, which], self.deputy[:, which])


def states():
    times = np.arange(EPOCHS) * STEP_S
    r, rate = 6.878e6, np.sqrt(3.986004418e14 / 6.878e6**3)
    turn = rate * times
    zero = np.zeros(EPOCHS)
    chief = np.stack(
        [r * np.cos(turn), r * np.sin(turn), zero, -r * rate * np.sin(turn), r * rate * np.cos(turn), zero], axis=1
    )[None]
    relative = np.broadcast_to(np.array([0.0, -1000.0, 50.0, 0, 0, 0]), chief.shape)
    return States(times, chief, eci_from_rtn(chief, relative))


def read(*faults, runs=3, ends=(EPOCHS,), **options):
    noise = (GaussianNoise(), *faults)
    radar = RadarOptions(range_sigma_m=2.0, angle_sigma_deg=0.1, noise=noise, **options)
    suite = SensorSuite({"radar": radar}, RandomSource(3, tuple(range(runs))), STEP_S)
    parts, first = [], 0
    for end in ends:
        parts.append(suite.measure(states().part(slice(first, end)), first)["radar"])
        first = end
    return np.concatenate(parts, axis=1)


SIGMAS = np.array([2.0, np.radians(0.1), np.radians(0.1)])
TIMES = np.arange(EPOCHS) * STEP_S


def test_a_step_adds_its_size_from_its_beginning_to_its_end():
    added = (read(StepNoise(from_s=20.0, until_s=50.0, value=(10.0, 0.0, -3.0))) - read()) / SIGMAS
    on = (TIMES >= 20) & (TIMES < 50)
    np.testing.assert_allclose(added, np.where(on[:, None], [10.0, 0.0, -3.0], 0.0)[None].repeat(3, 0), atol=1e-9)


def test_a_ramp_grows_from_nothing():
    added = (read(RampNoise(from_s=20.0, rate_per_s=(0.5, 0.0, 0.0))) - read()) / SIGMAS
    np.testing.assert_allclose(added[..., 0], np.maximum(TIMES - 20, 0)[None].repeat(3, 0) / 2, atol=1e-9)
    assert not np.abs(added[..., 1:]).max() > 1e-9


@pytest.mark.parametrize("period_s", [None, 6.0])
def test_stuck_readings_repeat_the_last_sound_one_of_each_run(period_s):
    sound, stuck = read(period_s=period_s), read(StuckNoise(from_s=21.0, until_s=50.0), period_s=period_s)
    on = (TIMES >= 21) & (TIMES < 50)
    assert np.array_equal(stuck[:, ~on], sound[:, ~on], equal_nan=True)
    assert np.array_equal(np.isnan(stuck), np.isnan(sound))  # the epochs of the readings stay
    due = on & ~np.isnan(sound[0, :, 0])
    last = np.flatnonzero((TIMES < 21) & ~np.isnan(sound[0, :, 0]))[-1]
    assert (stuck[:, due] == sound[:, [last]]).all()
    assert len(np.unique(stuck[:, due][:, 0, 0])) == 3


def test_stuck_from_the_start_repeats_the_first_reading():
    sound = read(OutageNoise(windows_s=((0.0, 10.0),)))
    stuck = read(OutageNoise(windows_s=((0.0, 10.0),)), StuckNoise(from_s=0.0))
    assert np.isnan(stuck[:, :5]).all() and (stuck[:, 5:] == sound[:, [5]]).all()


def test_a_wrong_target_is_read_where_it_is():
    """Range and angles of an object 30 m up and 40 m ahead of the true target; by the geometry of the nadir frame."""
    difference = read(WrongTargetNoise(from_s=20.0, offset_m=(30.0, 40.0, 0.0))) - read()
    on = TIMES >= 20
    assert not np.abs(difference[:, ~on]).max() > 0
    x, y, z = -960.0, -50.0, -30.0  # along-track, minus orbit normal, nadir
    fx, fy, fz = -1000.0, -50.0, 0.0
    expected = np.array(
        [
            np.sqrt(x * x + y * y + z * z) - np.sqrt(fx * fx + fy * fy + fz * fz),
            np.arctan2(y, x) - np.arctan2(fy, fx),
            np.arctan2(-z, np.hypot(x, y)) - np.arctan2(-fz, np.hypot(fx, fy)),
        ]
    )
    np.testing.assert_allclose(difference[:, on], np.broadcast_to(expected, (3, on.sum(), 3)), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "fault",
    [
        StepNoise(from_s=20.0, value=1.0),
        RampNoise(from_s=20.0, rate_per_s=0.1),
        StuckNoise(from_s=21.0, until_s=60.0),
        WrongTargetNoise(from_s=20.0, offset_m=(0.0, 0.0, 9.0)),
    ],
    ids=lambda fault: fault.kind,
)
def test_readings_depend_neither_on_chunks_nor_on_the_block(fault):
    whole = read(fault)
    assert np.array_equal(whole, read(fault, ends=(1, 7, 12, 33, EPOCHS)), equal_nan=True)
    assert np.array_equal(whole[:1], read(fault, runs=1), equal_nan=True)


def test_wrong_faults_are_refused_in_words():
    with pytest.raises(ValidationError, match="not after its begin at 20 s"):
        StepNoise(from_s=20.0, until_s=20.0, value=1.0)
    with pytest.raises(ValidationError, match="the ramp has 2 values; this sensor has 3 channels"):
        read(RampNoise(from_s=1.0, rate_per_s=(1.0, 2.0)))
    with pytest.raises(ValidationError, match="wrong_target is for sensors that measure the other craft"):
        GnssOptions(
            position_sigma_m=1, velocity_sigma_m_s=1, noise=WrongTargetNoise(from_s=0.0, offset_m=(1.0, 0.0, 0.0))
        )

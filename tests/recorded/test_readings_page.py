"""docs/readings.md: its files are read, and its table of units is the one that is read by."""

import re
from pathlib import Path

import numpy as np
import pytest

from relnav_sim.astro.epoch import Epoch
from relnav_sim.campaign.file_model import sensors_from
from relnav_sim.campaign.loader import load_document
from relnav_sim.recorded.readings_files import load_readings
from relnav_sim.recorded.units import FACTORS
from relnav_sim.sensors import readings_layout, sensor_kinds

PAGE = (Path(__file__).parents[2] / "docs" / "readings.md").read_text(encoding="utf-8")
EPOCH = Epoch.parse("2010-07-27T00:00:00 UTC")


def blocks(kind):
    return re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def read(tmp_path):
    (yaml,) = blocks("yaml")
    layout = readings_layout(sensors_from(load_document(yaml).data["sensors"]))

    def read_text(text, epoch=EPOCH):
        (tmp_path / "pass").write_text(text)
        (readings,) = load_readings([tmp_path / "pass"], layout, epoch)
        return readings

    return read_text


def test_the_first_file(read):
    readings = read(blocks("csv")[0], epoch=None)
    np.testing.assert_array_equal(readings.sensors["radar"].times_s, [0, 0.2, 7.5])
    assert np.isnan(readings.sensors["radar"].values[1]).tolist() == [False, True, True]
    assert len(readings.sensors["gnss"].times_s) == 2


def test_the_file_with_comments(read):
    for epoch in (EPOCH, None):
        readings = read(blocks("csv")[1], epoch)
        assert readings.run == 3
        np.testing.assert_array_equal(readings.start.covariance, np.diag([25, 25, 25, 0.01, 0.01, 0.01]))
        radar = readings.sensors["radar"]
        assert radar.times_s.tolist() == [0, 1.5]  # GPS time is 15 s before UTC
        assert radar.values[:, 0].tolist() == pytest.approx([12003.1, 12002.9], rel=1e-15)
        assert readings.sensors["deputy_accelerometer"].values[0, 1] == pytest.approx(2e-5, rel=1e-15)


def test_the_message(read):
    (message,) = blocks("tdm")
    readings = read(message)
    radar = readings.sensors["radar"]
    assert radar.times_s.tolist() == [10.25, 12.25]
    np.testing.assert_allclose(radar.values[0], [12003.1, np.radians(-179.98), np.radians(0.03)], rtol=1e-13)
    assert "there and back" in readings.notes[0]


def test_a_public_header_without_a_sensor_s_name(read):
    readings = read("gps_time,range_m\n2010-07-27T00:00:15,227379.1269\n2010-07-27T00:00:25,227380.6907\n")
    assert readings.sensors["radar"].times_s.tolist() == [0, 10]
    assert readings.sensors["radar"].values[:, 0].tolist() == [227379.1269, 227380.6907]


def test_units():
    table = PAGE[PAGE.index("| what | endings |") : PAGE.index("Angles outside of")]
    told = [set(re.findall(r"`_(\w+)`", row)) for row in table.splitlines()[2:] if "`" in row]
    assert told == [set(endings) for endings in FACTORS.values()]


def test_every_kind_of_sensor_is_there():
    table = PAGE[PAGE.index("| sensor | channels |") : PAGE.index("An accelerometer's measurements")]
    kinds = [name for name, options in sensor_kinds().items() if options.__module__.startswith("relnav_sim.")]
    assert all(kind in table for kind in kinds)

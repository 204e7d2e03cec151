"""Tracking Data Messages: what a sensor of a campaign measures is read, all else is refused by name or told."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relnav_sim.astro.epoch import Epoch
from relnav_sim.measurements.channel import Channel
from relnav_sim.recorded.readings import Readings, ReadingsError, SensorReadings
from relnav_sim.recorded.readings_files import load_readings
from relnav_sim.recorded.tdm_writing import fits_tdm, write_tdm

RANGE, RATE = Channel("range", "m", ""), Channel("range_rate", "m/s", "")
ANGLES = (Channel("azimuth", "rad", "", angle=True), Channel("elevation", "rad", "", angle=True))
LAYOUT = {
    "radar": (RANGE, *ANGLES),
    "camera": ANGLES,
    "link": (RANGE, RATE),
    "gnss": tuple(Channel(f"position_{axis}", "m", "") for axis in "xyz"),
}
EPOCH = Epoch.parse("2016-12-31T23:59:50 UTC")

# Across the leap second at the end of 2016: 23:59:60 is a second of its own.
MESSAGE = """\
CCSDS_TDM_VERS = 2.0
COMMENT written by hand
CREATION_DATE = 2017-01-02T00:00:00
ORIGINATOR = TEST
META_START
TIME_SYSTEM = UTC
START_TIME = 2016-12-31T23:59:50
STOP_TIME = 2017-01-01T00:01:00
PARTICIPANT_1 = radar
PARTICIPANT_2 = deputy
MODE = SEQUENTIAL
PATH = 2,1
RANGE_UNITS = km
ANGLE_TYPE = AZEL
META_STOP
DATA_START
RANGE = 2016-12-31T23:59:59.5 1.25
ANGLE_1 = 2016-12-31T23:59:59.5 191.5
ANGLE_2 = 2016-12-31T23:59:59.5 -12
RANGE = 2016-12-31T23:59:60.5 1.5
RANGE = 2017-01-01T00:00:00 1.75
DATA_STOP
"""


@pytest.fixture
def load(tmp_path):
    def load_text(text, sort=False, layout=LAYOUT, epoch=EPOCH, **participants):
        path = tmp_path / "pass.tdm"
        path.write_text(text)
        (readings,) = load_readings([path], layout, epoch, sort, participants)
        return readings

    return load_text


@pytest.fixture
def refused(load, tmp_path):
    def sentence(text, **options):
        with pytest.raises(ReadingsError) as error:
            load(text, **options)
        assert "\n" not in str(error.value)
        return str(error.value).replace(f"{tmp_path}/", "")

    return sentence


def test_reads_range_and_angles_over_a_leap_second(load):
    readings = load(MESSAGE)
    radar = readings.sensors["radar"]
    assert radar.times_s.tolist() == [9.5, 10.5, 11.0]
    np.testing.assert_allclose(radar.values[:, 0], [1250, 1500, 1750], rtol=1e-15)
    np.testing.assert_allclose(radar.values[0, 1:], np.radians([-168.5, -12]), rtol=1e-15)
    assert np.isnan(radar.values[1:, 1:]).all()
    assert radar.where(1).endswith("pass.tdm:20")
    assert (readings.run, readings.notes) == (0, ())


def test_azimuth_and_elevation_are_those_of_a_sensor_with_x_north_y_east_z_down():
    """The radar's own sight: azimuth from x to y, elevation to minus z, as at a ground station."""
    from relnav_sim.astro.line_of_sight import sight_vector

    north, east, down = sight_vector(1.0, math.radians(30), math.radians(10))
    assert math.atan2(east, north) == pytest.approx(math.radians(30))
    assert -down == pytest.approx(math.sin(math.radians(10)))


class TestSegments:
    def test_a_segment_each_for_two_sensors(self, load):
        second = MESSAGE[MESSAGE.index("META_START") :].replace("= radar", "= link").replace("ANGLE_1", "CARRIER_POWER")
        second = second.replace("ANGLE_2", "DOPPLER_INSTANTANEOUS").replace(" -12", " -0.25")
        readings = load(MESSAGE + second)
        assert list(readings.sensors) == ["radar", "link"]
        np.testing.assert_array_equal(readings.sensors["link"].values[0], [1250, -250])
        (note,) = readings.notes
        assert note.endswith("CARRIER_POWER is left out: no sensor of relnav reads it")

    def test_segments_of_one_sensor_follow_each_other(self, load, refused):
        again = MESSAGE[MESSAGE.index("META_START") :]
        later = again.replace("2016-12-31T23:59:59.5", "2017-01-01T00:00:10").replace(
            "2017-01-01T00:00:00 ", "2017-01-01T00:00:20 "
        )
        later = later.replace("2016-12-31T23:59:60.5", "2017-01-01T00:00:15")
        assert load(MESSAGE + later).sensors["radar"].times_s.tolist() == [9.5, 10.5, 11.0, 21.0, 26.0, 31.0]
        assert "radar.range goes back in time: 9.5 s comes after 11.0 s" in refused(MESSAGE + again)
        assert load(MESSAGE + again, sort=True).sensors["radar"].times_s.tolist() == [9.5, 10.5, 11.0]


class TestWhichSensor:
    def test_by_name_by_option_or_by_what_it_reads(self, load, refused):
        foreign = MESSAGE.replace("= radar", "= ANT-7")
        sentence = refused(foreign, layout={"a": LAYOUT["radar"], "b": LAYOUT["radar"]})
        assert sentence == (
            "pass.tdm:5: which sensor the segment with participants 'ANT-7' and 'deputy' is of is not clear: it may "
            "be of a and b; give --participant NAME=SENSOR"
        )
        assert list(load(foreign, layout={"a": LAYOUT["radar"], "b": LAYOUT["radar"]}, **{"ANT-7": "b"}).sensors) == [
            "b"
        ]
        # Only the radar reads all of range and angles.
        assert list(load(foreign).sensors) == ["radar"]
        one = load(foreign, layout={"camera": ANGLES, "gnss": LAYOUT["gnss"]})
        assert list(one.sensors) == ["camera"]
        assert one.notes[0].endswith("pass.tdm:17: RANGE is left out: camera does not read it")

    def test_a_sensor_that_reads_nothing_of_it(self, refused):
        assert refused(MESSAGE, layout={"radar": (RATE,)}) == (
            "pass.tdm:5: the segment holds RANGE, ANGLE_1 and ANGLE_2, of which the sensor radar reads none; RANGE, "
            "ANGLE_1, ANGLE_2 and DOPPLER_INSTANTANEOUS are read"
        )


class TestUnits:
    def test_there_and_back_counts_by_half(self, load):
        readings = load(MESSAGE.replace("PATH = 2,1", "PATH = 1,2,1"))
        assert readings.sensors["radar"].values[0, 0] == 625
        assert readings.notes[0].endswith("pass.tdm:12: the range is there and back, and counts by half")

    def test_seconds_of_light(self, load):
        one = load(MESSAGE.replace("UNITS = km", "UNITS = s").replace(" 1.25", " 1e-6"))
        assert one.sensors["radar"].values[0, 0] == pytest.approx(299.792458, rel=1e-15)

    @pytest.mark.parametrize(("applied", "wanted"), [("NO", 1250 - 200), ("YES", 1250)])
    def test_corrections(self, load, refused, applied, wanted):
        text = MESSAGE.replace("RANGE_UNITS", "CORRECTION_RANGE = -0.2\nRANGE_UNITS")
        one = load(text.replace("META_STOP", f"CORRECTIONS_APPLIED = {applied}\nMETA_STOP"))
        assert one.sensors["radar"].values[0, 0] == pytest.approx(wanted, rel=1e-15)
        assert "may be applied or not; say so" in refused(text)


REFUSED = {
    ("CCSDS_TDM_VERS = 2.0", "CCSDS_TDM_VERS = 9.0"): "1: version '9.0' of the TDM is unknown; 1.0 and 2.0 are read",
    (
        "TIME_SYSTEM = UTC",
        "TIME_SYSTEM = TDB",
    ): "6: TIME_SYSTEM = 'TDB' is none of the time scales that are read, UTC, TAI, GPS and TT",
    ("TIME_SYSTEM = UTC\n", ""): "5: TIME_SYSTEM is none of the time scales that are read, UTC, TAI, GPS and TT",
    ("PARTICIPANT_1 = radar\nPARTICIPANT_2 = deputy\n", ""): "5: PARTICIPANT_1 is missing",
    (
        "MODE = SEQUENTIAL",
        "MODE = SINGLE_DIFF",
    ): "11: MODE = 'SINGLE_DIFF' is a difference of signals, which no sensor of relnav reads",
    ("PATH = 2,1", "PATH = 1,2,3,2,1"): "12: PATH = '1,2,3,2,1' makes RANGE no range between two craft",
    ("PATH = 2,1\n", ""): "5: PATH is missing: it says whether RANGE is one way (1,2) or there and back (1,2,1)",
    ("RANGE_UNITS = km", "RANGE_UNITS = RU"): "13: RANGE_UNITS = 'RU' can't be turned to metres; km and s can",
    (
        "RANGE_UNITS = km",
        "RANGE_MODULUS = 32768",
    ): "13: RANGE_MODULUS = '32768' leaves the range ambiguous; resolve it, and write 0",
    (
        "RANGE_UNITS = km",
        "TRANSMIT_DELAY_1 = 1e-6",
    ): "13: TRANSMIT_DELAY_1 = '1e-6' is not applied, and relnav does not; correct the range by it, and leave it out",
    (
        "ANGLE_TYPE = AZEL",
        "ANGLE_TYPE = RADEC",
    ): "14: ANGLE_TYPE = 'RADEC' is not read: only AZEL, azimuth and elevation in "
    "the sensor's own axes, is; convert the angles",
    ("ANGLE_TYPE = AZEL\n", ""): "5: ANGLE_TYPE is missing",
    ("ANGLE_TYPE", "ANGLE_TIPE"): "14: 'ANGLE_TIPE' is no keyword of the metadata; did you mean ANGLE_TYPE?",
    ("ANGLE_TYPE = AZEL", "PATH = 2,1"): "14: PATH is given twice, first in line 12",
    ("ANGLE_2 =", "ANGEL_2 ="): "19: 'ANGEL_2' is no keyword of the data; did you mean ANGLE_1?",
    ("59:59.5 1.25", "59:59.5 1,25"): "17: RANGE '1,25' has a decimal comma; write a decimal point",
    ("59:59.5 1.25", "59:59.5 NaN"): "17: RANGE 'NaN' is no number; leave a missing measurement out",
    ("59:59.5 1.25", "59:59.5"): "17: RANGE has '2016-12-31T23:59:59.5'; it must be a time and a number",
    (
        "59:59.5 1.25",
        "59:61 1.25",
    ): "17: epoch '2016-12-31T23:59:61': there is no such time of day; it is at most 23:59:59",
    (
        "RANGE = 2017-01-01T00:00:00",
        "RANGE = 2017-01-01T00:01:01",
    ): "21: 2017-01-01T00:01:01 is not within START_TIME and STOP_TIME of the segment",
    (
        "RANGE = 2017-01-01T00:00:00",
        "RANGE = 2016-12-31T23:59:58",
    ): "21: RANGE goes back in time to 2016-12-31T23:59:58, after line 20; put the lines in order, or give --sort",
    (
        "RANGE = 2017-01-01T00:00:00",
        "RANGE = 2016-12-31T23:59:60.5",
    ): "21: RANGE is given twice at 2016-12-31T23:59:60.5, after line 20; put the lines in order, or give --sort",
    ("DATA_STOP\n", ""): "21: the file ends in the data; a segment is META_START to DATA_STOP",
    ("META_STOP\n", ""): "15: DATA_START stands in the metadata; a segment is META_START to DATA_STOP",
    ("ORIGINATOR = TEST", "ORIGINATOR"): "4: 'ORIGINATOR' is no line of the form KEYWORD = value",
    (
        "DATA_STOP\n",
        "DATA_STOP\nRANGE = 1 2\n",
    ): "23: RANGE stands after the data; a segment is META_START to DATA_STOP",
}


@pytest.mark.parametrize("change", REFUSED, ids=range(len(REFUSED)))
def test_refused(refused, change):
    assert change[0] in MESSAGE
    assert refused(MESSAGE.replace(*change, 1)) == f"pass.tdm:{REFUSED[change]}"


def test_a_range_rate_there_and_back_is_refused(refused):
    text = (
        MESSAGE.replace("PATH = 2,1", "PATH = 1,2,1")
        .replace("= radar", "= link")
        .replace("RANGE = ", "DOPPLER_INSTANTANEOUS = ")
    )
    assert "leaves open whether the rate is one way or there and back; give PATH = 1,2" in refused(text)


def test_without_a_calendar(refused):
    assert "give it a truth.epoch" in refused(MESSAGE, epoch=None)


@settings(deadline=None, max_examples=150)
@given(st.data())
def test_a_damaged_message_is_refused_in_a_sentence(tmp_path_factory, data):
    text = MESSAGE
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(text)))
        new = data.draw(st.text(alphabet="0123456789.,=AEMNRT_:\n\r\t \0²", max_size=3))
        text = text[:place] + new + text[place + data.draw(st.integers(0, 12)) :]
    path = tmp_path_factory.mktemp("damaged") / "pass.tdm"
    path.write_bytes(text.encode())
    try:
        (readings,) = load_readings([path], LAYOUT, EPOCH)
    except ReadingsError as error:
        assert str(error).startswith(f"{path}:")
        assert "\n" not in str(error)
        return
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    for one in readings.sensors.values():
        for row in range(len(one.times_s)):
            keyword, _, value = lines[int(one.where(row).rpartition(":")[2]) - 1].partition("=")
            assert keyword.strip() in {"RANGE", "ANGLE_1", "ANGLE_2", "DOPPLER_INSTANTANEOUS"}
            assert math.isfinite(float(value.split()[1]))


ranges = st.floats(0.0, 1e9)
angles = st.floats(-math.pi, math.pi, exclude_min=True)


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(ranges, angles, angles, st.integers(0, 7)), min_size=1, max_size=8), st.integers(1, 10**9))
def test_what_is_written_is_read_to_the_last_digits(tmp_path_factory, rows, step_ns):
    values = np.array([row[:3] for row in rows])
    # Some channels are missing, never all.
    for row, (*_, missing) in zip(values, rows, strict=True):
        row[[bool(missing % 7 >> bit & 1) for bit in range(3)]] = np.nan
    times = np.arange(len(rows)) * step_ns * 1e-9
    one = SensorReadings(times, values, (), np.zeros((len(rows), 2), dtype=int))
    path = tmp_path_factory.mktemp("tdm") / "a.tdm"
    write_tdm(path, Readings({"radar": one}, run=5), LAYOUT, EPOCH, {"radar": "deputy"}, EPOCH)
    (read,) = load_readings([path], LAYOUT, EPOCH)
    assert read.run == 5
    np.testing.assert_allclose(read.sensors["radar"].times_s, times, rtol=0, atol=1e-12 + 1e-16 * times[-1])
    # Two roundings each way.
    np.testing.assert_allclose(read.sensors["radar"].values, values, rtol=4 * 2.0**-52, atol=1e-300)


def test_what_fits():
    assert [name for name, quantities in LAYOUT.items() if fits_tdm(quantities)] == ["radar", "camera", "link"]

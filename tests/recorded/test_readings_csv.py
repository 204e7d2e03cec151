"""Measurements in CSV: every number comes back, and every mistake is told with its line."""

import csv
import math
import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relnav_sim.astro.epoch import Epoch
from relnav_sim.measurements.channel import Channel
from relnav_sim.recorded.readings import Readings, ReadingsError, SensorReadings, Start
from relnav_sim.recorded.readings_csv import write_csv
from relnav_sim.recorded.readings_files import load_readings

RADAR = (Channel("range", "m", "range"), Channel("azimuth", "rad", "", angle=True))
GNSS = tuple(Channel(f"{what}_x", unit, "") for what, unit in (("position", "m"), ("velocity", "m/s")))
LAYOUT = {
    "radar": RADAR,
    "gnss": GNSS,
    "tracker.2": (Channel("quaternion_w", "", ""),),
    "chief_imu": (Channel("force_radial", "m/s^2", ""),),
}
EPOCH = Epoch.parse("2010-07-27T00:00:00 GPS")


@pytest.fixture
def load(tmp_path):
    def load_text(text, name="pass.csv", epoch=None, sort=False, layout=LAYOUT):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        (readings,) = load_readings([path], layout, epoch, sort)
        return readings

    return load_text


@pytest.fixture
def refused(load, tmp_path):
    def sentence(text, **options):
        with pytest.raises(ReadingsError) as error:
            load(text, **options)
        said = str(error.value)
        assert "\n" not in said
        return said.replace(f"{tmp_path}/", "")

    return sentence


def bits(array):
    return np.asarray(array, dtype=float).tobytes()


finite = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=True, width=64)
angle = st.floats(-math.pi, math.pi, exclude_min=True, allow_subnormal=True)


@st.composite
def recordings(draw):
    sensors = {}
    for name, quantities in LAYOUT.items():
        times = draw(st.lists(finite, max_size=5, unique=True))
        # Zeros of either sign are one time.
        times = sorted({0.0 if time == 0 else time for time in times})
        rows = [
            [draw(st.one_of(st.just(math.nan), angle if each.angle else finite)) for each in quantities] for _ in times
        ]
        read = [place for place, row in enumerate(rows) if not all(map(math.isnan, row))]
        if read:
            values = np.array(rows)[read].reshape(len(read), len(quantities))
            sensors[name] = SensorReadings(np.array(times)[read], values, (), np.zeros((len(read), 2), dtype=int))
    root = np.array(draw(st.lists(st.floats(-1e3, 1e3), min_size=36, max_size=36))).reshape(6, 6)
    start = Start(np.array(draw(st.lists(finite, min_size=6, max_size=6))), root @ root.T)
    return Readings(sensors, draw(st.one_of(st.none(), st.just(start))), draw(st.integers(0, 10**9 - 1)))


@settings(deadline=None, max_examples=75)
@given(recordings())
def test_what_is_written_is_read_to_the_bit(tmp_path_factory, recorded):
    path = tmp_path_factory.mktemp("csv") / "flight.csv"
    write_csv(path, recorded, LAYOUT, {"campaign": "any: thing", "case": "base", "seed": "1"})
    if not recorded.sensors:
        with pytest.raises(ReadingsError):
            load_readings([path], LAYOUT)
        return
    (read,) = load_readings([path], LAYOUT)
    assert read.run == recorded.run
    assert list(read.sensors) == list(recorded.sensors)
    for name, one in recorded.sensors.items():
        assert bits(read.sensors[name].times_s) == bits(one.times_s)
        there = ~np.isnan(one.values)
        assert (~np.isnan(read.sensors[name].values) == there).all()
        assert bits(read.sensors[name].values[there]) == bits(one.values[there])
    assert (read.start is None) == (recorded.start is None)
    if recorded.start is not None:
        assert bits(read.start.mean) == bits(recorded.start.mean)
        assert bits(read.start.covariance) == bits(recorded.start.covariance)


WHOLE = """\
# relnav
# run: 3
time_s,radar.range_km,radar.azimuth_deg,gnss.position_x_m
0.0,1.25,10.5,7000000.125
0.5,,-3e1,
1.5,1.5,,7000001.5
"""


def test_units_gaps_and_lines(load):
    readings = load(WHOLE)
    radar, gnss = readings.sensors["radar"], readings.sensors["gnss"]
    assert readings.run == 3
    assert radar.times_s.tolist() == [0.0, 0.5, 1.5]
    np.testing.assert_allclose(radar.values[:, 0], [1250, np.nan, 1500], rtol=0)
    np.testing.assert_allclose(radar.values[:, 1], np.radians([10.5, -30, np.nan]), rtol=1e-15)
    assert radar.where(2).endswith("pass.csv:6")
    assert gnss.times_s.tolist() == [0.0, 1.5]
    assert gnss.where(1).endswith("pass.csv:6")
    assert readings.notes == ()


def _cells(text):
    """Return an independent measurement of a text: cells by line, and the header."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    rows = {
        line: next(csv.reader([content]))
        for line, content in enumerate(lines, 1)
        if content.strip() and not content.lstrip().startswith("#")
    }
    header = rows[min(rows)]
    return rows, [name.strip() for name in header]


FACTORS = {"radar.range_km": ("radar", 0, 1e3), "radar.azimuth_deg": ("radar", 1, math.pi / 180)}
FACTORS |= {"gnss.position_x_m": ("gnss", 0, 1.0)}


@settings(deadline=None, max_examples=150)
@given(st.data())
def test_a_damaged_file_is_refused_or_says_what_its_cells_say(tmp_path_factory, data):
    text = WHOLE
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(text)))
        length = data.draw(st.integers(0, 3))
        new = data.draw(st.text(alphabet='0123456789.,;"#eE+-nafi:\n\r\t _\0\ufeff²٣', max_size=3))
        text = text[:place] + new + text[place + length :]
    path = tmp_path_factory.mktemp("damaged") / "pass.csv"
    path.write_bytes(text.encode())
    try:
        (readings,) = load_readings([path], LAYOUT)
    except ReadingsError as error:
        assert str(error).startswith(f"{path}:")
        assert "\n" not in str(error)
        return
    rows, header = _cells(text.removeprefix("\ufeff"))
    for name, one in readings.sensors.items():
        for row in range(len(one.times_s)):
            line = int(one.where(row).rpartition(":")[2])
            cells = [cell.strip() for cell in rows[line]]
            assert float(cells[header.index("time_s")]) == one.times_s[row]
            for column, cell in zip(header, cells, strict=True):
                if column in FACTORS and FACTORS[column][0] == name and cell:
                    _, channel, factor = FACTORS[column]
                    wanted = float(cell) * factor
                    given = one.values[row, channel]
                    if channel == 1 and name == "radar":
                        assert math.isclose(math.sin(given - wanted), 0, abs_tol=1e-9 * max(1, abs(wanted)))
                    else:
                        assert struct.pack("d", given) == struct.pack("d", wanted)


class TestForms:
    def test_byte_order_mark_line_ends_and_quotes(self, load):
        whole = load(WHOLE)
        for text in (
            "\ufeff" + WHOLE,
            WHOLE.replace("\n", "\r\n"),
            WHOLE.replace("\n", "\r"),
            WHOLE.replace("1.25", '"1.25"').replace("radar.range_km", '"radar.range_km"'),
            WHOLE.replace(",", " , "),
            WHOLE.replace("\n0.5", "\n\n# a remark\n0.5"),
        ):
            read = load(text)
            assert bits(read.sensors["radar"].values) == bits(whole.sensors["radar"].values)

    def test_fortran_exponents(self, load):
        one = load("time_s,radar.range_m\n1D1,1.5d3\n").sensors["radar"]
        assert (one.times_s[0], one.values[0, 0]) == (10.0, 1500.0)

    def test_a_channel_without_its_sensor(self, load, refused):
        assert load("time_s,range_m\n0,1\n").sensors["radar"].values[0, 0] == 1
        two = {"radar": RADAR, "lidar": RADAR}
        assert refused("time_s,range_m\n0,1\n", layout=two) == (
            "pass.csv:1: the column 'range_m' may be radar.range_m and lidar.range_m; name the sensor"
        )

    def test_the_longest_sensor_name_counts(self, load):
        layout = {"a": (Channel("b.range", "m", ""),), "a.b": (Channel("range", "m", ""),)}
        assert list(load("time_s,a.b.range_m\n0,1\n", layout=layout).sensors) == ["a.b"]

    def test_calendar_times(self, load, refused):
        text = "time_utc,radar.range_m\n2010-07-26T23:59:45,1\n2010-07-26T23:59:45.25Z,2\n"
        assert load(text, epoch=EPOCH).sensors["radar"].times_s.tolist() == [0.0, 0.25]
        assert load(text.replace("time_utc", "utc_time"), epoch=EPOCH).sensors["radar"].times_s.tolist() == [0.0, 0.25]
        assert "give it a truth.epoch" in refused(text)
        own = load("# epoch: 2010-07-26T23:59:44 UTC\n" + text)
        assert own.sensors["radar"].times_s.tolist() == [1.0, 1.25]
        wrong = refused("time_gps,radar.range_m\n2010-07-32T00:00:00,1\n", epoch=EPOCH)
        assert wrong.startswith("pass.csv:2: ") and "calendar" in wrong

    def test_seconds_count_from_the_file_s_epoch(self, load):
        text = "# epoch: 2010-07-27T00:01:00 GPS\ntime_s,radar.range_m\n1,1\n"
        assert load(text, epoch=EPOCH).sensors["radar"].times_s.tolist() == [61.0]
        assert load(text).sensors["radar"].times_s.tolist() == [1.0]

    def test_angles_are_within_a_turn(self, load):
        one = load("time_s,radar.azimuth_deg\n0,256.64\n1,-180\n2,180\n").sensors["radar"]
        np.testing.assert_allclose(one.values[:, 1], np.radians([-103.36, 180, 180]), rtol=1e-14)

    def test_a_file_that_may_be_cut_short(self, load):
        (note,) = load(WHOLE.rstrip("\n")).notes
        assert note.endswith("pass.csv:6: the last line has no end; see that the file is whole")


WRONG = {
    "": "pass.csv: it is empty",
    "# only: this\n": "pass.csv: it holds no header, the line that names the columns",
    "time_s,radar.range_m\n": "pass.csv: it holds no row of measurements after the header",
    "time_s,radar.range_m\n0,\n": "pass.csv: no cell holds a measurement",
    "0,1\n1,2\n": "pass.csv:1: no column gives the time; the header must name one of time_s, time_utc, time_gps, "
    "time_tai and time_tt",
    "time_s;radar.range_m\n0;1,5\n": "pass.csv:1: the columns seem to be separated by ';'; separate them by commas, "
    "and write decimal points",
    "time_s,time_utc,radar.range_m\n0,0,1\n": "pass.csv:1: time_s and time_utc both give the time; leave one of them",
    "time_s\n0\n": "pass.csv:1: no column holds measurements; name them SENSOR.CHANNEL_UNIT, as radar.range_m",
    "time_s,radar.rnge_m\n0,1\n": "pass.csv:1: the column 'radar.rnge_m' is no channel of a sensor of the campaign; "
    "did you mean radar.range_m?",
    "time_s,radr.range_m\n0,1\n": "pass.csv:1: the column 'radr.range_m' is no channel of a sensor of the campaign; "
    "did you mean radar.range_m?",
    "time_s,radar.range\n0,1\n": "pass.csv:1: the column 'radar.range' names no unit; radar.range is in one of _m, "
    "_km, _cm and _mm",
    "time_s,radar.range_kms\n0,1\n": "pass.csv:1: the column 'radar.range_kms' has the unit 'kms'; radar.range is in "
    "one of _m, _km, _cm and _mm; did you mean radar.range_km?",
    "time_s,radar.azimuth_degrees\n0,1\n": "pass.csv:1: the column 'radar.azimuth_degrees' has the unit 'degrees'; "
    "radar.azimuth is in one of _rad, _mrad, _urad, _deg, _arcmin and _arcsec; did you mean radar.azimuth_deg?",
    "time_s,radar.range_m,radar.range_km\n0,1,1\n": "pass.csv:1: the column 'radar.range_km' gives what "
    "'radar.range_m' gives; leave one of them",
    "time_s,radar.range_m,radar.range_m\n0,1,1\n": "pass.csv:1: the column 'radar.range_m' gives what 'radar.range_m' "
    "gives; leave one of them",
    "time_s,radar.range_m,\n0,1,\n": "pass.csv:1: the column '' has no name",
    "time_s,radar.range_m\n0,1\n1\n": "pass.csv:3: the row has 1 cells, the header 2",
    "time_s,radar.range_m\n0,1,5\n": "pass.csv:2: the row has 3 cells, the header 2; a decimal comma? write a decimal "
    "point",
    'time_s,radar.range_m\n0,"1,5"\n': "pass.csv:2: radar.range_m: '1,5' has a decimal comma; write a decimal point",
    "time_s,radar.range_m\n0,nan\n": "pass.csv:2: radar.range_m: 'nan' is no number; leave a missing measurement out",
    "time_s,radar.range_m\n0,-Infinity\n": "pass.csv:2: radar.range_m: '-Infinity' is no number; leave a "
    "missing measurement out",
    "time_s,radar.range_m\n0,1_000\n": "pass.csv:2: radar.range_m: '1_000' is no number",
    "time_s,radar.range_m\n0,1e999\n": "pass.csv:2: radar.range_m: '1e999' is too large for a number of 64 bits",
    "time_s,radar.range_km\n0,1e306\n": "pass.csv:2: radar.range or its time is too large for a number of 64 bits in "
    "SI units",
    "time_s,radar.range_m\n0,٣\n": "pass.csv:2: radar.range_m: '٣' is no number",
    "time_s,radar.range_m\n,1\n": "pass.csv:2: time_s: '' is no number",
    'time_s,radar.range_m\n0,"1\n': "pass.csv:2: quotes do not pair up (unexpected end of data); a row is one line",
    "time_s,radar.range_m\n0,1\n0.0,2\n": "pass.csv:3: radar.range is given twice: 0.0 s comes after 0.0 s "
    "(pass.csv:2); put the rows in order, or give --sort",
    "time_s,radar.range_m\n1,1\n0.5,2\n": "pass.csv:3: radar.range goes back in time: 0.5 s comes after 1.0 s "
    "(pass.csv:2); put the rows in order, or give --sort",
    "# runn: 3\ntime_s,radar.range_m\n0,1\n": "pass.csv:1: '# runn:' is unknown; did you mean '# run:'?",
    "# run: -3\ntime_s,radar.range_m\n0,1\n": "pass.csv:1: the run '-3' must be a whole number from 0 up",
    "# run: 3\n# run: 3\ntime_s,radar.range_m\n0,1\n": "pass.csv:2: '# run:' is given twice, first in line 1",
    "time_s,radar.range_m\n# run: 3\n0,1\n": "pass.csv:2: '# run:' must stand before the header",
    "# start_mean_m_m_s: 1 2 3\n# start_covariance_m_m_s: 1\ntime_s,radar.range_m\n0,1\n": "pass.csv:1: "
    "start_mean_m_m_s has 3 numbers; it must have 6",
    "# start_mean_m_m_s: 1 2 3 4 5 6\ntime_s,radar.range_m\n0,1\n": "pass.csv:1: '# start_mean_m_m_s:' needs "
    "'# start_covariance_m_m_s:' too",
    f"# start_mean_m_m_s: 1 2 3 4 5 6\n# start_covariance_m_m_s: {'-1 ' * 36}\ntime_s,radar.range_m\n0,1\n": "pass.csv"
    ":2: the start's covariance is not symmetric and positive",
    "# epoch: 2010-07-27T00:00:00\ntime_s,radar.range_m\n0,1\n": "pass.csv:1: epoch '2010-07-27T00:00:00' names no "
    "time scale; write 2010-07-27T00:00:00 UTC, or TAI, GPS or TT",
    b"time_s,radar.range_m\n0,1\xff\n": "pass.csv:2: it is no text in UTF-8; save it as such",
    "time_s,radar.range_m\n0,1\0\n": "pass.csv:2: it holds a zero byte, so it is no text",
    "time_s,radar.range_m\n".encode("utf-16"): "pass.csv: it is UTF-16; give a text file in UTF-8, CSV or CCSDS TDM",
    "<?xml?><tdm/>": "pass.csv:1: it is XML; measurements are in CSV or in a CCSDS TDM of KEYWORD = value lines",
    "CCSDS_OEM_VERS = 2.0\n": "pass.csv:1: it is a CCSDS OEM; measurements are in CSV or in a CCSDS TDM",
}


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_refused(refused, text):
    assert refused(text) == WRONG[text]


class TestSorting:
    def test_rows_out_of_order_and_repeated(self, load, refused):
        text = "time_s,radar.range_m,radar.azimuth_rad\n2,3,\n1,2,0.5\n2,3,\n2,,0.25\n"
        assert "--sort" in refused(text)
        one = load(text, sort=True).sensors["radar"]
        assert one.times_s.tolist() == [1, 2]
        assert one.values.tolist() == [[2, 0.5], [3, 0.25]]
        assert one.where(0).endswith(":3")

    def test_two_values_at_one_time_are_never_chosen_from(self, refused):
        text = "time_s,radar.range_m\n1,2\n1,3\n"
        assert refused(text, sort=True) == (
            "pass.csv:3: radar.range has two different values at 1.0 s, the other at pass.csv:2; leave out the "
            "wrong one"
        )


class TestSeveralFiles:
    @pytest.fixture
    def write(self, tmp_path):
        def written(name, text):
            path = tmp_path / name
            path.write_text(text)
            return path

        return written

    def test_a_file_a_sensor_and_one_after_the_other(self, write):
        paths = [
            write("a.csv", "time_s,radar.range_m\n0,1\n1,2\n"),
            write("b.csv", "time_s,radar.range_m\n2,3\n"),
            write("c.csv", "time_s,gnss.position_x_m\n0,7\n"),
            write("d.csv", "time_s,radar.azimuth_rad\n1,0.5\n"),
        ]
        (readings,) = load_readings(paths, LAYOUT)
        np.testing.assert_array_equal(readings.sensors["radar"].values, [[1, np.nan], [2, 0.5], [3, np.nan]])
        assert readings.sensors["radar"].where(2).endswith("b.csv:2")
        assert list(readings.sensors) == ["radar", "gnss"]
        with pytest.raises(ReadingsError, match=r"a\.csv:2: radar\.range goes back in time: .*b\.csv:2\)"):
            load_readings([paths[1], paths[0]], LAYOUT)
        (sorted_,) = load_readings(reversed(paths), LAYOUT, sort=True)
        assert bits(sorted_.sensors["radar"].values) == bits(readings.sensors["radar"].values)

    def test_runs(self, write):
        text = "time_s,radar.range_m\n0,1\n"
        two, five = write("2.csv", f"# run: 2\n{text}"), write("5.csv", f"# run: 5\n{text}")
        none = write("none.csv", "time_s,gnss.position_x_m\n0,1\n")
        assert [each.run for each in load_readings([five, two], LAYOUT)] == [2, 5]
        (joined,) = load_readings([none, two], LAYOUT)
        assert (joined.run, set(joined.sensors)) == (2, {"radar", "gnss"})
        with pytest.raises(ReadingsError, match="names no run, and other files are of several"):
            load_readings([none, two, five], LAYOUT)

    def test_a_file_may_hold_the_start_alone(self, write):
        radar = write("radar.csv", "time_s,radar.range_m\n0,1\n")
        start = Start(np.arange(6.0), np.eye(6))
        write_csv(radar.with_name("start.csv"), Readings({}, start, 4), LAYOUT)
        (readings,) = load_readings([radar, radar.with_name("start.csv")], LAYOUT)
        assert (readings.run, readings.start.mean.tolist()) == (4, [0, 1, 2, 3, 4, 5])
        with pytest.raises(ReadingsError, match="no cell holds a measurement"):
            load_readings([radar.with_name("start.csv")], LAYOUT)

    def test_starts_and_epochs_agree(self, write):
        start = f"# start_mean_m_m_s: 1 2 3 4 5 6\n# start_covariance_m_m_s: {'0 ' * 36}\n"
        radar = write("radar.csv", f"{start}time_s,radar.range_m\n0,1\n")
        gnss = write("gnss.csv", f"{start.replace('1 2', '2 2')}time_s,gnss.position_x_m\n0,1\n")
        assert load_readings([radar, radar], LAYOUT, sort=True)[0].start.mean.tolist() == [1, 2, 3, 4, 5, 6]
        with pytest.raises(ReadingsError, match="its start is another one than that of"):
            load_readings([radar, gnss], LAYOUT)
        early = write("early.csv", "# epoch: 2010-07-27T00:00:00 GPS\ntime_s,radar.range_m\n0,1\n")
        late = write("late.csv", "# epoch: 2010-07-27T00:00:01 GPS\ntime_s,radar.range_m\n0,1\n")
        with pytest.raises(ReadingsError, match="give the campaign a truth"):
            load_readings([early, late], LAYOUT)
        (readings,) = load_readings([early, late], LAYOUT, EPOCH)
        assert readings.sensors["radar"].times_s.tolist() == [0, 1]


def test_a_campaign_s_own_comments_do_no_harm(tmp_path):
    one = SensorReadings(np.zeros(1), np.ones((1, 2)), (), np.zeros((1, 2), dtype=int))
    recorded = Readings({"radar": one})
    write_csv(tmp_path / "a.csv", replace(recorded, run=7), LAYOUT, {"case": "x: 4\n# run: 8", "seed": "1"})
    assert load_readings([tmp_path / "a.csv"], LAYOUT)[0].run == 7

"""OEM in keyword = value notation: what is read, as the `oem` package reads it, and what is refused with its line."""

from pathlib import Path

import numpy as np
import oem
import pytest
from orbit_files import EPOCH, circular, oem_text

from relnav_sim import EphemerisError, load_ephemeris

TIMES = np.arange(0.0, 1260.0, 60.0)
STATES = circular(TIMES)
COVARIANCE = """COVARIANCE_START
EPOCH = 2021-07-10T16:00:00
COV_REF_FRAME = RTN
1.0
0.0 1.0
0.0 0.0 1.0
0.0 0.0 0.0 1.0
0.0 0.0 0.0 0.0 1.0
0.0 0.0 0.0 0.0 0.0 1.0
COVARIANCE_STOP
"""
GOOD = oem_text(TIMES, STATES)


def written(folder: Path, text: str) -> Path:
    path = folder / "a.oem"
    path.write_text(text, encoding="utf-8")
    return path


def refusal(folder: Path, text: str) -> str:
    with pytest.raises(EphemerisError) as caught:
        load_ephemeris(written(folder, text))
    return str(caught.value).removeprefix(f"{folder}/")


def test_rows_are_those_that_the_oem_package_reads(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    found = load_ephemeris(path)
    expected = oem.OrbitEphemerisMessage.open(path)
    peer = np.array([[*state.position, *state.velocity] for state in expected.states]) * 1e3
    np.testing.assert_allclose(found.states, peer, rtol=1e-15, atol=0)
    np.testing.assert_allclose(found.states, STATES, rtol=1e-15, atol=0)
    np.testing.assert_array_equal(found.times_s, TIMES)
    assert (found.epoch, found.frame) == (EPOCH, "EME2000")
    assert (found.spans[0].interpolation.kind, found.spans[0].interpolation.degree) == ("LAGRANGE", 7)


@pytest.mark.parametrize("version", ["1.0", "2.0", "3.0"])
def test_versions(tmp_path: Path, version: str) -> None:
    text = oem_text(TIMES, STATES, version=version)
    if version == "3.0":
        text = text.replace("ORIGINATOR", "CLASSIFICATION = public\nMESSAGE_ID = 1\nORIGINATOR", 1)
    assert len(load_ephemeris(written(tmp_path, text)).times_s) == len(TIMES)


@pytest.mark.parametrize("scale", ["UTC", "TAI", "GPS", "TT"])
def test_time_systems_name_the_same_instants(tmp_path: Path, scale: str) -> None:
    found = load_ephemeris(written(tmp_path, oem_text(TIMES, STATES, scale=scale)))
    assert found.epoch == EPOCH
    np.testing.assert_array_equal(found.times_s, TIMES)


def test_days_of_the_year_are_read(tmp_path: Path) -> None:
    found = load_ephemeris(written(tmp_path, GOOD.replace("2021-07-10T", "2021-191T")))
    assert found.epoch == EPOCH


def test_time_counts_through_a_leap_second(tmp_path: Path) -> None:
    text = GOOD.replace("2021-07-10T16:0", "2016-12-31T23:5").replace("2021-07-10T16:1", "2017-01-01T00:0")
    text = text.replace("2021-07-10T16:20", "2017-01-01T00:10")
    assert load_ephemeris(written(tmp_path, text)).times_s[-1] == TIMES[-1] + 1


def test_comments_accelerations_and_covariance_are_passed_over(tmp_path: Path) -> None:
    lines = oem_text(TIMES, STATES, after=COVARIANCE).splitlines()
    lines = [f"{line} 0.001 -0.002 0.003" if line.startswith("2021") else line for line in lines]
    lines[3:3] = ["", "COMMENT a comment = that looks like more", "COMMENT"]
    lines[18:18] = ["COMMENT between rows"]
    np.testing.assert_allclose(load_ephemeris(written(tmp_path, "\n".join(lines))).states, STATES, rtol=1e-15)


def test_segments_are_interpolated_each_by_itself(tmp_path: Path) -> None:
    later = circular(TIMES, ahead_rad=0.1)
    text = oem_text(TIMES, STATES) + oem_text(TIMES + TIMES[-1], later, head=False, more="INTERPOLATION = LINEAR\n")
    found = load_ephemeris(written(tmp_path, text))
    assert [span.interpolation.kind for span in found.spans] == ["LAGRANGE", "LINEAR"]
    np.testing.assert_array_equal(found.at(TIMES[-1]), found.states[len(TIMES) - 1])
    middle = found.at(TIMES[-1] + 30.0)
    np.testing.assert_allclose(middle, (later[0] + later[1]) / 2, rtol=1e-14)


def test_between_segments_there_is_no_orbit(tmp_path: Path) -> None:
    after = oem_text(TIMES + 3600, circular(TIMES + 3600), head=False)
    path = written(tmp_path, GOOD + after)
    found = load_ephemeris(path)
    np.testing.assert_allclose(found.at([30.0, 3630.0]), circular(np.array([30.0, 3630.0])), rtol=1e-9)
    with pytest.raises(EphemerisError, match=r"does not cover 2021-07-10T16:30:00 UTC; it covers .* and .*"):
        found.at(1800.0)
    later = load_ephemeris(path, start="2021-07-10T17:05:00 UTC")
    np.testing.assert_allclose(later.at(3930.0), circular(np.array([3930.0]))[0], rtol=1e-9)
    for needed in ({"start": "2021-07-10T16:30:00 UTC"}, {"stop": "2021-07-10T16:30:00 UTC"}):
        with pytest.raises(EphemerisError, match=r"a\.oem:4: the orbit is useable from"):
            load_ephemeris(path, **needed)
    with pytest.raises(EphemerisError, match=r"a\.oem:4: the orbit is useable from"):
        load_ephemeris(path, start="2021-07-10T16:10:00 UTC", stop="2021-07-10T17:10:00 UTC")


def test_only_the_useable_time_may_be_asked_for(tmp_path: Path) -> None:
    more = "USEABLE_START_TIME = 2021-07-10T16:02:00\nUSEABLE_STOP_TIME = 2021-07-10T16:18:00\n"
    found = load_ephemeris(written(tmp_path, oem_text(TIMES, STATES, more=more)))
    np.testing.assert_allclose(found.at([120.0, 1080.0]), STATES[[2, 18]], rtol=1e-15)
    for time in (119.0, 1081.0):
        with pytest.raises(
            EphemerisError, match=r"a\.oem does not cover 2021-07-10T16:\d\d:\d\d UTC; it covers 2021-07"
        ):
            found.at(time)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("CCSDS_OEM_VERS = 2.0", "CCSDS_OEM_VERS = 4.0", "a.oem:1: the version 4.0 is not read"),
        ("CCSDS_OEM_VERS = 2.0", "CCSDS_TDM_VERS = 2.0", "a.oem:1: the file is a CCSDS TDM; an orbit is read from"),
        ("ORIGINATOR", "ORIGINATR", "a.oem:3: 'ORIGINATR' is no keyword of this part; did you mean ORIGINATOR?"),
        ("ORIGINATOR = TEST\n", "", "a.oem:2: the header ends here without ORIGINATOR"),
        ("ORIGINATOR = TEST", "ORIGINATOR =", "a.oem:3: ORIGINATOR has no value"),
        ("OBJECT_ID = 2021-001A\n", "", "a.oem:13: the metadata end here without OBJECT_ID"),
        ("OBJECT_ID", "OBJECT_NAME", "a.oem:6: OBJECT_NAME stands here a second time"),
        (
            "CENTER_NAME = EARTH",
            "CENTER_NAME = MARS BARYCENTER",
            "a.oem:7: CENTER_NAME is MARS BARYCENTER; relnav reads",
        ),
        ("REF_FRAME = EME2000", "REF_FRAME = TEME", "a.oem:8: the frame 'TEME' is not read; it must be EME2000, ICRF"),
        ("REF_FRAME = EME2000", "REF_FRAME = TOD", "a.oem:8: the frame 'TOD' is not read"),
        ("TIME_SYSTEM = UTC", "TIME_SYSTEM = TDB", "a.oem:9: the time system 'TDB' is not read; it must be one of UTC"),
        ("STOP_TIME = 2021-07-10T16:20:00", "STOP_TIME = 2021-07-10T16:10:00", "a.oem:35: this epoch is outside START"),
        (
            "START_TIME = 2021-07-10",
            "START_TIME = 2021-13-10",
            "a.oem:10: epoch '2021-13-10T16:00:00': the calendar has no",
        ),
        ("LAGRANGE", "SPLINE", "a.oem:12: the interpolation 'SPLINE' is not known; it must be LAGRANGE"),
        ("DEGREE = 7", "DEGREE = seven", "a.oem:13: the interpolation degree is 'seven'; it must be a whole number"),
        ("DEGREE = 7", "DEGREE = 21", "a.oem:4: 21 rows where LAGRANGE of degree 21 needs 22; give more rows"),
        ("INTERPOLATION_DEGREE = 7\n", "", "a.oem:12: the interpolation LAGRANGE needs a degree"),
        ("INTERPOLATION = LAGRANGE\n", "", "a.oem:12: a degree is given without INTERPOLATION"),
        ("META_STOP", "", "a.oem:15: '2021-07-10T16:00:00 "),
        ("2021-07-10T16:03:00 ", "2021-07-10T16:03:00 nan ", "a.oem:18: 8 words stand where an epoch and 6 numbers"),
        (
            "2021-07-10T16:03:00",
            "2021-07-10T16:02:00",
            "a.oem:18: the epoch 2021-07-10T16:02:00 is the same as the one of",
        ),
        (
            "2021-07-10T16:03:00",
            "2021-07-10T16:01:30",
            "a.oem:18: the epoch 2021-07-10T16:01:30 comes before the one of",
        ),
        ("2021-07-10T16:03:00", "2021-07-10 16:03:00", "a.oem:18: 8 words stand"),
        ("2021-07-10T16:03:00", "2021-07-10T16:63:00", "a.oem:18: epoch '2021-07-10T16:63:00': there is no such time"),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    assert old in GOOD
    assert refusal(tmp_path, GOOD.replace(old, new, 1)).startswith(sentence)


@pytest.mark.parametrize("word", ["nan", "inf", "1e999", "1_0", "0x10", "6,9", "one"])
def test_what_is_no_finite_number_is_refused(tmp_path: Path, word: str) -> None:
    lines = GOOD.splitlines()
    lines[20] = " ".join([*lines[20].split()[:3], word, *lines[20].split()[4:]])
    assert refusal(tmp_path, "\n".join(lines)).startswith(f"a.oem:21: a position or velocity is {word!r}; it must be")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (
            "COV_REF_FRAME = RTN",
            "BADHEADER 1234",
            "a.oem:38: 2 words stand where row 1 of a covariance should, with 1 number",
        ),
        ("COV_REF_FRAME = RTN", "BADHEADER = 1234", "a.oem:38: 'BADHEADER' is no keyword of this part"),
        ("EPOCH = 2021-07-10T16:00:00\n", "", "a.oem:37: a covariance needs its EPOCH"),
        ("0.0 1.0\n", "0.0 x\n", "a.oem:40: an element of a covariance is 'x'"),
        ("\nCOVARIANCE_STOP", "", "a.oem:44: the file ends here; "),
    ],
)
def test_a_malformed_covariance_is_refused(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    text = oem_text(TIMES, STATES, after=COVARIANCE)
    assert old in text
    assert refusal(tmp_path, text.replace(old, new, 1)).startswith(sentence)


def test_gaps_are_refused_unless_they_are_not_needed(tmp_path: Path) -> None:
    kept = np.delete(np.arange(len(TIMES)), [8, 9, 10, 11])
    path = written(tmp_path, oem_text(TIMES[kept], STATES[kept], more=""))
    with pytest.raises(
        EphemerisError, match=r"a\.oem:21: a gap of 300 s lies before this row, where rows are 60 s apart"
    ):
        load_ephemeris(path)
    part = load_ephemeris(path, stop="2021-07-10T16:02:00 UTC")
    np.testing.assert_allclose(part.at([90.0]), circular(np.array([90.0])), rtol=1e-9)


def test_steps_may_follow_an_eccentric_orbit(tmp_path: Path) -> None:
    times = np.cumsum(60 * 1.15 ** np.abs(np.arange(-15, 16)))
    assert len(load_ephemeris(written(tmp_path, oem_text(times, circular(times), more=""))).times_s) == len(times)


def test_overlapping_and_mixed_segments_are_refused(tmp_path: Path) -> None:
    after = oem_text(TIMES + 600, STATES, head=False)
    assert refusal(tmp_path, GOOD + after).startswith(
        "a.oem:36: this segment is useable from 2021-07-10T16:10:00 UTC on"
    )
    after = oem_text(TIMES + 1260, STATES, head=False)
    for old, new, what in (("2021-001A", "2021-001B", "object"), ("EME2000", "ICRF", "frame")):
        sentence = refusal(tmp_path, GOOD + after.replace(old, new))
        assert sentence == f"a.oem:36: the {what} of this segment is {new}, before it is {old}"


def test_part_of_a_file_is_refused_where_it_does_not_cover_what_is_needed(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    with pytest.raises(EphemerisError) as caught:
        load_ephemeris(path, start="2021-07-10T16:10:00 UTC", stop="2021-07-10T16:21:00 UTC")
    assert str(caught.value) == (
        f"{path}:4: the orbit is useable from 2021-07-10T16:00:00 UTC to 2021-07-10T16:20:00 UTC; it is needed from "
        "2021-07-10T16:10:00 UTC to 2021-07-10T16:21:00 UTC"
    )


def test_bytes_that_are_no_text_are_refused_with_their_line(tmp_path: Path) -> None:
    path = tmp_path / "a.oem"
    path.write_bytes(GOOD.encode()[:100] + b"\xff\xfe")
    with pytest.raises(EphemerisError, match=r"a\.oem:5: the file is not text"):
        load_ephemeris(path)


def test_rows_that_end_long_before_the_metadata_are_told(tmp_path: Path) -> None:
    stop = oem_text(TIMES, STATES).partition("STOP_TIME = ")[2].partition("\n")[0]
    told = load_ephemeris(
        written(tmp_path, GOOD.replace(f"STOP_TIME = {stop}", "STOP_TIME = 2021-07-10T18:00:00"))
    ).notes
    assert told == (
        f"{tmp_path}/a.oem:{len(GOOD.splitlines())}: the last row stands before STOP_TIME by 6000 s: "
        "rows may be missing.",
    )
    (early,) = load_ephemeris(
        written(tmp_path, GOOD.replace("START_TIME = 2021-07-10T16", "START_TIME = 2021-07-10T15"))
    ).notes
    assert "a.oem:15: the first row stands after START_TIME by 3600 s" in early
    assert load_ephemeris(written(tmp_path, GOOD)).notes == ()

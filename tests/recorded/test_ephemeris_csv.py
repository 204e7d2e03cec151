"""Tables of states: columns, units, frames and time scales as stated, and refusals with their line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from orbit_files import EPOCH, calendar, circular

from relnav_sim import EphemerisError, load_ephemeris

TIMES = np.arange(0.0, 600.0, 30.0)
STATES = circular(TIMES)
HEADER = "time_utc,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"


def table(header: str = HEADER, scale: str = "UTC", above: str = "# frame: EME2000\n", factor: float = 1.0) -> str:
    rows = [
        ",".join([time, *map(repr, (state * factor).tolist())])
        for time, state in zip(calendar(TIMES, scale), STATES, strict=True)
    ]
    return "\n".join([f"{above}{header}", *rows, ""])


GOOD = table()


def loaded(folder: Path, text: str, **stated: Any) -> Any:
    (folder / "a.csv").write_text(text, encoding="utf-8")
    return load_ephemeris(folder / "a.csv", **stated)


def refusal(folder: Path, text: str, **stated: Any) -> str:
    with pytest.raises(EphemerisError) as caught:
        loaded(folder, text, **stated)
    return str(caught.value).removeprefix(f"{folder}/")


@pytest.mark.parametrize(
    ("text", "stated"),
    [
        (GOOD, {}),
        (table(above=""), {"frame": "EME2000"}),
        (table(above="\ufeff# A comment\n#frame = EME2000\n\n"), {"frame": "eme2000"}),
        (table(header=HEADER.replace("time_utc", "gps_time"), scale="GPS"), {}),
        (table(header=HEADER.replace("time_utc", "time"), scale="TAI"), {"time_scale": "TAI"}),
        (table(header=HEADER.replace("time_utc", "epoch"), above="# time_scale: UTC\n# frame: J2000\n"), {}),
        (table(header=HEADER.replace("_m", "_km"), factor=1e-3), {}),
        (table(header=HEADER.replace("_m", "_eme2000_m"), above=""), {}),
        (table(header=HEADER.upper().replace(",", " , ")), {}),
    ],
)
def test_tables_say_the_same_in_several_ways(tmp_path: Path, text: str, stated: dict[str, str]) -> None:
    found = loaded(tmp_path, text, **stated)
    np.testing.assert_allclose(found.states, STATES, rtol=1e-15)
    np.testing.assert_array_equal(found.times_s, TIMES)
    assert found.epoch == EPOCH


def test_seconds_count_from_a_stated_epoch(tmp_path: Path) -> None:
    rows = [
        ",".join(map(repr, [time + 10, *state])) for time, state in zip(TIMES.tolist(), STATES.tolist(), strict=True)
    ]
    text = "\n".join([HEADER.replace("time_utc", "time_s"), *rows])
    for above, stated in (("# epoch: 2021-07-10T15:59:50 UTC\n", {}), ("", {"epoch": "2021-07-10T15:59:50 UTC"})):
        found = loaded(tmp_path, above + text, frame="EME2000", **stated)
        assert found.epoch == EPOCH
        np.testing.assert_array_equal(found.times_s, TIMES)
    sentence = refusal(tmp_path, text, frame="EME2000")
    assert sentence.startswith("a.csv:1: nothing says the epoch from which time_s counts; write a line # epoch: ")
    assert refusal(tmp_path, f"# epoch: soon\n{text}", frame="ICRF").startswith("a.csv:1: 'soon' is no epoch")


def test_columns_may_stand_in_any_order_among_others(tmp_path: Path) -> None:
    order = [3, 0, 6, 1, 5, 2, 4]
    lines = [line.split(",") for line in GOOD.splitlines()[1:]]
    text = "\n".join(["# frame: EME2000", *(",".join([*(words[i] for i in order), "7"]) for words in lines)])
    found = loaded(tmp_path, text.replace("vx_m_s,7", "vx_m_s,clock_us", 1).replace(",7\n", ",clock_us\n", 1))
    np.testing.assert_allclose(found.states, STATES, rtol=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("time_utc,", "when,", "a.csv:2: no column is a time; name one time_utc, time_gps"),
        ("time_utc,", "time,", "a.csv:2: nothing says the time scale; name the column time_utc"),
        ("x_m,y_m", "x,y_m", "a.csv:2: no column gives x with its unit; name it x_m or x_km"),
        ("vx_m_s", "vx", "a.csv:2: no column gives vx with its unit; name it vx_m_s or vx_km_s"),
        ("vx_m_s", "vx_m", "a.csv:2: the column 'vx_m' has a unit of position"),
        ("x_m,y_m", "x_m_s,y_m", "a.csv:2: the column 'x_m_s' has a unit of velocity"),
        ("y_m,", "x_m,", "a.csv:2: the column 'x_m' stands here twice"),
        ("y_m,", "x_km,", "a.csv:2: the column 'x_km' gives x a second time"),
        ("x_m,y_m", "x_itrf_m,y_m", "a.csv:2: some columns are in ITRF and others not"),
        ("# frame: EME2000\n", "", "a.csv:1: nothing says the frame; write a line # frame: ITRF"),
        ("EME2000", "TEME", "a.csv:2: the frame 'TEME' is not read"),
        ("2021-07-10T16:01:00,", "2021-07-10T16:00:30,", "a.csv:5: the time is the same as the one of line 4"),
        ("2021-07-10T16:01:00,", "2021-07-10T16:00:29,", "a.csv:5: the time comes before the one of line 4"),
        ("2021-07-10T16:01:00,", "2021-07-10T16:01:00,,", "a.csv:5: the row has 8 columns; the header has 7"),
        ("2021-07-10T16:01:00,", "10/07/2021,", "a.csv:5: '10/07/2021' is no epoch; write it as"),
        ("\n2021-07-10T16:01:00,", "\n2021-07-10T16:01:00 GPS,", "a.csv:5: epoch '2021-07-10T16:01:00 GPS': its time"),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    assert old in GOOD
    assert refusal(tmp_path, GOOD.replace(old, new, 1)).startswith(sentence)


@pytest.mark.parametrize("word", ["", "nan", "-inf", "1e400", "one", "1_000"])
def test_what_is_no_finite_number_is_refused(tmp_path: Path, word: str) -> None:
    lines = GOOD.splitlines()
    lines[9] = ",".join([*lines[9].split(",")[:2], word, *lines[9].split(",")[3:]])
    assert refusal(tmp_path, "\n".join(lines)).startswith(f"a.csv:10: y is {word!r}; it must be a finite number")


@pytest.mark.parametrize(
    ("stated", "sentence"),
    [
        ({"frame": "ITRF"}, "a.csv:2: the frame is EME2000 by a comment and ITRF by the caller"),
        ({"time_scale": "GPS"}, "a.csv:2: the time scale is UTC by its column and GPS by the caller"),
        ({"velocity_frame": "ITRF"}, "a.csv:2: the velocity frame 'ITRF' is not known; it must be EME2000"),
    ],
)
def test_what_the_caller_states_must_agree(tmp_path: Path, stated: dict[str, str], sentence: str) -> None:
    assert refusal(tmp_path, GOOD, **stated).startswith(sentence)


@pytest.mark.parametrize("text", ["", "\n\n", "# frame: ITRF\n"])
def test_empty_files_are_refused(tmp_path: Path, text: str) -> None:
    assert refusal(tmp_path, text).startswith("a.csv:1: the file is empty; a table begins with a header")


def test_a_header_alone_is_refused(tmp_path: Path) -> None:
    assert refusal(tmp_path, f"{HEADER}\n", frame="ICRF") == "a.csv:1: no rows follow the header"

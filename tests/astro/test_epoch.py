"""Instants of the calendar against pyerfa's own conversions of dates, and what is refused."""

from datetime import datetime

import erfa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relnav_sim.astro.epoch import SCALES, Epoch

moments = st.datetimes(datetime(1972, 1, 1), datetime(2026, 1, 1))
epochs = st.builds(Epoch, st.integers(-27 * 365 * 86400 * 10**12, 99 * 365 * 86400 * 10**12))


def erfa_tt(scale, moment):
    """Terrestrial Time of a clock's reading, two-part Julian date, by pyerfa."""
    d = erfa.dtf2d(
        scale if scale == "UTC" else "TAI",
        moment.year, moment.month, moment.day, moment.hour, moment.minute, moment.second + moment.microsecond * 1e-6,
    )  # fmt: skip
    if scale == "TT":
        return d
    if scale == "GPS":
        d = (d[0], d[1] + 19 / 86400)
    return erfa.taitt(*(erfa.utctai(*d) if scale == "UTC" else d))


@settings(deadline=None, max_examples=200)
@given(moments, st.sampled_from(SCALES))
def test_dates_are_those_of_pyerfa(moment, scale):
    """To the rounding of a fraction of a day, which is 1e-11 s."""
    ours, theirs = Epoch.parse(f"{moment.isoformat()} {scale}").tt, erfa_tt(scale, moment)
    assert abs((ours[0] - theirs[0]) + (ours[1] - theirs[1])) * 86400 < 5e-11


@settings(deadline=None, max_examples=200)
@given(epochs, st.sampled_from(SCALES))
def test_text_says_all(epoch, scale):
    assert Epoch.parse(epoch.text(scale)) == epoch
    assert Epoch.parse(epoch.text(scale).rpartition(" ")[0], scale=scale) == epoch


@settings(deadline=None, max_examples=200)
@given(epochs, st.floats(-1e9, 1e9))
def test_an_instant_moved_is_as_far_away(epoch, seconds):
    """To half a picosecond, or the last bit of the seconds."""
    moved = epoch.later(seconds)
    assert abs(moved.seconds_since(epoch) - seconds) <= 0.5e-12 + 1.2e-16 * abs(seconds)
    assert (moved >= epoch) == (round(seconds * 1e12) >= 0)


def test_known_instants():
    """GPS time began with UTC on 1980-01-06; on 2010-07-27 it was 15 s ahead of UTC, and 19 s behind TAI."""
    assert Epoch.parse("1980-01-06T00:00:00 GPS") == Epoch.parse("1980-01-06T00:00:00 UTC")
    epoch = Epoch.parse("2010-07-27T00:00:00 GPS")
    assert epoch.text() == "2010-07-26T23:59:45 UTC"
    assert epoch.text("TAI") == "2010-07-27T00:00:19 TAI"
    assert epoch.text("tt") == "2010-07-27T00:00:51.184 TT"
    assert Epoch.parse("2000-01-01T12:00:00 TT").tt == (2451544.5, 0.5)


def test_leap_seconds():
    """The day 2016-12-31 of UTC had 86401 s."""
    before, within, after = (
        Epoch.parse(f"{text} UTC") for text in ("2016-12-31T23:59:59", "2016-12-31T23:59:60.25", "2017-01-01T00:00:00")
    )
    assert within.seconds_since(before) == 1.25
    assert after.seconds_since(before) == 2
    assert (before.tai_minus_utc_s, within.tai_minus_utc_s, after.tai_minus_utc_s) == (36, 36, 37)
    assert [epoch.text() for epoch in (before, within, after)] == [
        "2016-12-31T23:59:59 UTC", "2016-12-31T23:59:60.25 UTC", "2017-01-01T00:00:00 UTC",
    ]  # fmt: skip
    assert after.seconds_since(Epoch.parse("2016-12-31T00:00:00 UTC")) == 86401


def test_digits_beyond_a_picosecond_are_rounded():
    assert Epoch.parse("2010-07-27T00:00:59.9999999999999Z") == Epoch.parse("2010-07-27T00:01:00Z")
    assert Epoch.parse("2010-07-27T00:00:00.1234567890126Z").text() == "2010-07-27T00:00:00.123456789013 UTC"


def test_forms():
    """A day of the year, as CCSDS files have it; Z; seconds or the time of day left out."""
    epoch = Epoch.parse("2010-07-27T00:00:00 UTC")
    for text in ("2010-208T00:00:00 UTC", "2010-07-27T00:00:00Z", "2010-07-27T00:00:00.000Z UTC", " 2010-07-27 utc "):
        assert Epoch.parse(text) == epoch
    assert Epoch.parse("2010-07-27 00:00 UTC") == epoch
    assert Epoch.parse("2012-366T00:00:00 UTC") == Epoch.parse("2012-12-31T00:00:00 UTC")
    assert Epoch.parse("2010-208T00:00:00.0000Z", scale="TAI") == Epoch.parse("2010-07-27T00:00:00 TAI")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("2010-07-27T00:00:00", "names no time scale; write 2010-07-27T00:00:00 UTC, or TAI, GPS or TT"),
        ("2010-07-27T00:00:00 UT1", "the time scale 'UT1' is unknown"),
        ("2010-07-27T00:00:00Z GPS", "Z stands for UTC"),
        ("2010-02-30T00:00:00 UTC", "no such day"),
        ("2010-366T00:00:00 UTC", "no such day"),
        ("2010-000T00:00:00 UTC", "no such day"),
        ("2010-07-27T24:00:00 UTC", "no such time of day"),
        ("2010-07-27T12:00:60 UTC", "no such time of day"),
        ("2016-12-31T23:59:60 TAI", "no such time of day"),
        ("2015-12-31T23:59:60 UTC", "no leap second"),
        ("1971-07-27T00:00:00 UTC", "before 1972"),
        ("3010-07-27T00:00:00 UTC", "years go from 1901 to 2099"),
        ("2010-07-27T00:00:00." + 5000 * "9" + " UTC", "is no epoch; write it as"),
        ("27.7.2010 UTC", "is no epoch; write it as"),
        ("", "is no epoch; write it as"),
        (20100727, "is no epoch; write it as"),
    ],
)
def test_what_is_no_epoch_is_refused(text, sentence):
    with pytest.raises(ValueError, match=sentence.replace("(", r"\(")):
        Epoch.parse(text)


def test_what_else_is_refused():
    epoch = Epoch.parse("1971-07-27T00:00:00 TAI")
    with pytest.raises(ValueError, match="before 1972"):
        epoch.text("UTC")
    with pytest.raises(ValueError, match="no year from 1 to 9999"):
        epoch.later(-9e10).text("TAI")
    with pytest.raises(ValueError, match="must be a time below"):
        epoch.later(float("nan"))
    with pytest.raises(ValueError, match="must be a time below"):
        epoch.later(1e15)
    with pytest.raises(ValueError, match="elsewhere"):
        Epoch.parse("2010-07-27T00:00:00 UTC", scale="GPS")


def test_before_1972_an_instant_is_told_in_tai():
    first = Epoch.parse("1972-01-01T00:00:00 UTC")
    assert first.text() == "1972-01-01T00:00:00 UTC"
    assert first.later(-1e-3).text() == "1972-01-01T00:00:09.999 TAI"

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from relnav_sim.campaign.loader import load_document
from relnav_sim.campaign.scalars import RefusedScalarError, resolve


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0", 0),
        ("-7", -7),
        ("+7", 7),
        ("1e-3", 1e-3),
        ("1E-3", 1e-3),
        ("1e+3", 1e3),
        ("7e6", 7e6),
        ("-2e5", -2e5),
        ("6378.137e3", 6378.137e3),
        ("1.0e-3", 1e-3),
        (".5", 0.5),
        ("5.", 5.0),
        ("0.50", 0.5),
        ("-0.0", 0.0),
    ],
)
def test_numbers_of_yaml_1_2_are_numbers(text, value):
    read = load_document(f"key: {text}").data["key"]
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    "text",
    [
        *["no", "yes", "on", "off", "No", "YES", "y", "n", "nan", "inf", "2025-10-30", "2025-10-30T12:30:00Z"],
        *["1.2.3", "e5", "1e", "--1", "+", ".", "..", "1 000", "12 km", "=", "<<", "0x", "0b2", "0o8"],
    ],
)
def test_what_is_no_number_and_no_boolean_is_text(text):
    assert load_document(f"key: {text}").data == {"key": text}


@pytest.mark.parametrize("text", ["true", "True", "TRUE"])
def test_true_is_a_boolean(text):
    assert resolve(text) is True


@pytest.mark.parametrize("text", ["", "~", "null", "Null", "NULL"])
def test_nothing_is_none(text):
    assert load_document(f"key: {text}").data == {"key": None}


@pytest.mark.parametrize(
    ("text", "advice"),
    [
        ("010", "write 10"),
        ("-007", "write -7"),
        ("00", "write 0"),
        ("00.5", "leading zero"),
        ("010e2", "leading zero"),
        ("1_000", "write 1000"),
        ("1_000.5", "write 1000.5"),
        ("0x1F", "write 31"),
        ("-0x1F", "write -31"),
        ("0o17", "write 15"),
        ("0b101", "write 5"),
        ("0x_1F", "write 31"),
        ("12:30", "base-60"),
        ("1:30:00", "base-60"),
        ("190:20:30.15", "base-60"),
        ("1,000", "decimal point"),
        ("1,5", "decimal point"),
        (".nan", "finite"),
        (".NaN", "finite"),
        (".inf", "finite"),
        ("-.Inf", "finite"),
        ("1e400", "larger than"),
        ("-1e400", "larger than"),
        ("9" * 60, "digits"),
        ("0." + "3" * 60, "digits"),
    ],
)
def test_traps_are_refused_with_advice(text, advice):
    with pytest.raises(RefusedScalarError, match=advice):
        resolve(text)
    document = load_document(f"good: 1\nbad: {text}")
    assert [(problem.path, problem.line) for problem in document.problems] == [(("bad",), 2)]


def test_quotes_make_any_trap_text():
    assert load_document('a: "010"\nb: \'12:30\'\nc: "true"').data == {"a": "010", "b": "12:30", "c": "true"}


@given(st.floats(allow_nan=False, allow_infinity=False))
@example(5e-324)
@example(1.7976931348623157e308)
def test_every_finite_float_survives_its_own_spelling(value):
    assert math.copysign(1, resolve(repr(value))) == math.copysign(1, value)
    assert resolve(repr(value)) == value


@given(st.integers(min_value=-(10**30), max_value=10**30))
def test_every_integer_survives_its_own_spelling(value):
    assert resolve(str(value)) == value


@given(st.text(alphabet="0123456789_.,:+-eExXoObBnaifT~", max_size=50))
def test_any_spelling_resolves_or_is_refused(text):
    try:
        value = resolve(text)
    except RefusedScalarError as refusal:
        assert str(refusal)
    else:
        assert value is None or isinstance(value, str | int | float | bool)
        assert not isinstance(value, float) or math.isfinite(value)

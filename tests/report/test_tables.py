import csv
import io
import math

import pytest

from relnav_sim.report.campaign_facts import filters_table
from relnav_sim.report.tables import Column, Number, Row, Table, Words, comma_separated, decimals_for, markdown
from relnav_sim.results import open_results
from relnav_sim.wording import MINUS, shown_number


def table(rows: tuple[Row, ...]) -> Table:
    columns = (Column("mean", "ekf"), Column("std", "ekf"), Column("why", numeric=False))
    return Table("case_000", "Errors", "A caption.", "error", columns, rows)


ROWS = (
    Row("x", (Number(-0.0481, -0.06, -0.03, 3), Number(0.5), Words("a|b")), "m"),
    Row("time", (Number(18.25, decimals=1, span=2), Words("<b>")), "s"),
)


@pytest.mark.parametrize(
    ("value", "decimals", "shown"),
    [
        (0.0481, 3, "0.048"),
        (-0.0481, 2, f"{MINUS}0.05"),
        (-0.0004, 3, "0.000"),
        (1234.5, 0, "1234"),
        (2.5e7, 2, "2.50e+07"),
        (math.inf, 2, "∞"),
    ],
)
def test_numbers_are_shown_as_people_write_them(value: float, decimals: int, shown: str) -> None:
    assert shown_number(value, decimals) == shown


def test_a_missing_number_is_a_dash() -> None:
    assert Number(math.nan).text == shown_number(math.nan, 2) == "\N{EN DASH}"


@pytest.mark.parametrize(
    ("half_width", "decimals"), [(0.0011, 4), (0.0029, 4), (0.0031, 3), (0.01, 3), (0.5, 1), (20.0, 0), (1e-9, 6)]
)
def test_the_interval_sets_the_decimals(half_width: float, decimals: int) -> None:
    assert decimals_for([1.0], [half_width]) == decimals


def test_without_intervals_three_digits_are_shown() -> None:
    assert decimals_for([0.0123], [math.nan]) == 4
    assert decimals_for([123.4], [math.nan]) == 0
    assert decimals_for([math.nan], [math.nan]) == 0


def test_markdown_escapes_what_would_break_the_table() -> None:
    lines = markdown(table(ROWS)).splitlines()
    assert lines[0] == "### Errors"
    assert lines[2] == "| error | unit | ekf mean | ekf std | why |"
    assert lines[4] == rf"| x | m | {MINUS}0.048 \[{MINUS}0.060, {MINUS}0.030\] | 0.500 | a\|b |"
    assert lines[5] == "| time | s | 18.2 |  | &lt;b&gt; |"


def test_csv_holds_every_digit_and_the_interval_in_columns_of_its_own() -> None:
    rows = list(csv.reader(io.StringIO(comma_separated(table(ROWS)))))
    assert rows[0] == [
        "error", "unit", "ekf mean", "ekf mean low 95", "ekf mean high 95",
        "ekf std", "ekf std low 95", "ekf std high 95", "why",
    ]  # fmt: skip
    assert rows[1] == ["x", "m", "-0.0481", "-0.06", "-0.03", "0.5", "", "", "a|b"]
    assert rows[2] == ["time", "s", "18.25", "", "", "", "", "", "<b>"]


def test_a_row_that_does_not_fill_the_columns_is_refused() -> None:
    with pytest.raises(ValueError, match="row x does not span"):
        table((Row("x", (Number(1.0),)),))


def test_groups_are_counted_for_the_heading() -> None:
    columns = (Column("mean", "kf"), Column("std", "kf"), Column("mean", "ekf"), Column("std", "ekf"))
    assert Table("t", "", "", "", columns, ()).groups == (("kf", 2), ("ekf", 2))
    assert Table("t", "", "", "", (Column("kind"),), ()).groups == ()


def test_the_table_of_filters_says_what_each_was_told_whatever_its_name_and_wherever_it_stands(make_result) -> None:
    """A name may hold dots, which no path can; a campaign may vary one filter, or all, as a whole."""
    plain = make_result(filters={"kf": 1.0, "ekf.tight": 1.0}, runs=3)
    with open_results(plain) as results:
        assert [row.cells[0].text for row in filters_table(results).rows] == ["ekf", "ekf"]
    varied = {"filters.kf": {"kind": "kf"}}, {"filters": {"kf": {"kind": "ukf"}}}
    for variables, kind in zip(varied, ("kf", "ukf"), strict=True):
        with open_results(make_result(filters={"kf": 1.0}, runs=3, variables=[variables])) as results:
            assert [row.cells[0].text for row in filters_table(results).rows] == [kind]


@pytest.mark.parametrize(
    ("number", "interval"),
    [
        (Number(3.77, 0.206, 7.42, 0), "[0.2, 7]"),
        (Number(0.06, 0.0015, 0.11, 2), "[0.002, 0.11]"),
        (Number(0.3, -0.04, 0.7, 1), f"[{MINUS}0.04, 0.7]"),
        (Number(5.0, 0.0, 16.0, 0), "[0, 16]"),
        (Number(-3.0, -7.0, -1e-9, 0), f"[{MINUS}7, {MINUS}1e-09]"),
    ],
)
def test_zero_is_in_the_shown_interval_exactly_where_it_is_in_the_interval(number: Number, interval: str) -> None:
    assert number.shown_interval == interval
    ends = [float(end.replace(MINUS, "-")) for end in number.shown_interval[1:-1].split(", ")]
    assert (ends[0] <= 0 <= ends[1]) == (number.low <= 0 <= number.high)

"""Text of a hostile result does nothing: no control character on the terminal or a page, no formula in a CSV file."""

import csv
import unicodedata
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relnav_sim.campaign import CampaignError, parse_campaign
from relnav_sim.cli.app import app
from relnav_sim.printable import visible
from relnav_sim.results.csv_cells import csv_cell

ResultMaker = Callable[..., Path]
ACTING = "\x1b[31m\x07\x9b1m\x85\u200f\u202e\u2066\u2028\x7f"
LABEL = f"=HYPERLINK(1){ACTING}"


def acting(text: str) -> list[str]:
    """The characters of a text that are no signs, but for the ends of lines."""
    return [letter for letter in text if letter not in "\n\t" and unicodedata.category(letter) in {"Cc", "Cf", "Zl"}]


@pytest.fixture
def hostile(make_result: ResultMaker) -> Path:
    return make_result(
        name=f"evil{ACTING}",
        labels=[LABEL, "@SUM(1)"],
        runs=3,
        times=5,
        filters={f"ekf{ACTING}": 1.0, "-2+3": 1.1},
        text=f"# {ACTING}\nname: x\n",
    )


@pytest.mark.usefixtures("unrendered")
def test_the_terminal_gets_signs_only(hostile: Path, tmp_path: Path) -> None:
    for words in (
        ["inspect", str(hostile)],
        ["inspect", str(hostile), "--campaign"],
        ["compare", f"{hostile}:-2+3", str(hostile), "--format", "md"],
        ["compare", f"{hostile}:nope", str(hostile)],
        ["figure", str(hostile), "rms", "--case", "nope"],
        ["report", str(hostile), "--out", str(tmp_path / "out"), "--format", "html,md,csv,latex"],
        ["report", str(tmp_path / f"no{ACTING[:5]}.h5")],
    ):
        done = CliRunner().invoke(app, words)
        assert done.exit_code in (0, 2, 3), done.output
        assert acting(done.stdout + done.stderr) == [], words
    assert "\\x1b[31m" in CliRunner().invoke(app, ["inspect", str(hostile)]).stdout
    pages = [path for path in (tmp_path / "out").rglob("*") if path.suffix in {".html", ".md", ".csv", ".tex"}]
    assert len(pages) > 10
    for page in pages:
        assert acting(page.read_text(encoding="utf-8")) == [], page


@pytest.mark.usefixtures("unrendered")
def test_text_that_spreadsheets_compute_has_an_apostrophe(hostile: Path, tmp_path: Path) -> None:
    out = tmp_path / "summary.csv"
    for words in (["export", "--out", str(out)], ["report", "--out", str(tmp_path / "out"), "--format", "csv"]):
        assert CliRunner().invoke(app, [*words, str(hostile)]).exit_code == 0
    with open(out, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["case_label"] for row in rows} == {f"'{visible(LABEL)}", "'@SUM(1)"}
    assert any(float(row["r_mean_m"]) > 0 and float(row["x_mean_m"]) < 0 for row in rows), "numbers stay numbers"
    for path in [out, *(tmp_path / "out" / "tables").glob("*.csv")]:
        with open(path, encoding="utf-8", newline="") as file:
            for cell in (cell for row in csv.reader(file) for cell in row if cell[:1] in "=+-@"):
                assert cell == "" or float(cell) is not None


@pytest.mark.parametrize(
    ("value", "cell"),
    [
        ("=1+1", "'=1+1"), ("+x", "'+x"), ("-x", "'-x"), ("@x", "'@x"), ("  =x", "'  =x"), ("\t=x", "'\t=x"),
        ("-1.5e-3", "-1.5e-3"), ("x=1", "x=1"), ("", ""), (-1.5, -1.5), (float("nan"), ""), (True, True), (3, 3),
        ("-inf", "-inf"),
    ],
)  # fmt: skip
def test_cells(value: object, cell: object) -> None:
    assert csv_cell(value) == cell


def test_text_stays_text() -> None:
    text = "Störung µs ± 3\u00a0\u03c3, عربى, 轨道\r\nnext\tline"
    assert visible(text) == text
    assert visible("a\rb\x1b\ud800") == "a\\rb\\x1b\\ud800"


@pytest.mark.parametrize("escape", ["\\x1b", "\\x9b", "\\u202e", "\\u200f", "\\u2028", "\\x7f", "\\x85"])
def test_a_campaign_holds_no_character_that_does_something(escape: str) -> None:
    with pytest.raises(CampaignError, match="control characters"):
        parse_campaign(f'name: "a{escape}b"\n')

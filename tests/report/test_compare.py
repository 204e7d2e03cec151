"""`relnav compare`: paired by case and run, and told why where not."""

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

from relnav_sim.cli.app import app
from relnav_sim.report.compare import Compared, Side, compare
from relnav_sim.report.tables import Number
from relnav_sim.results import open_results, seal

ResultMaker = Callable[..., Path]


def compared(a: Path, b: Path, first: str | None = None, second: str | None = None) -> Compared:
    with open_results(a) as one, open_results(b) as other:
        return compare(Side(one, "a", first), Side(other, "b", second))


@pytest.fixture(scope="module")
def written(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two results of one campaign with their own filters, and 20 and 15 runs, in a folder each."""
    folder = tmp_path_factory.mktemp("two")
    for name, filters, runs in (("a", {"ekf": 1.0, "kf": 1.2}, 20), ("b", {"ukf": 0.9, "kf": 1.2}, 15)):
        (folder / name).mkdir()
        invent(folder / name, filters=filters, runs=runs, failed={"kf": [2]})
    return folder


@pytest.fixture
def two(written: Path, tmp_path: Path) -> tuple[Path, Path]:
    """Return copies of the two results, which a test may change."""
    shutil.copytree(written, tmp_path, dirs_exist_ok=True)
    return tmp_path / "a" / "invented.h5", tmp_path / "b" / "invented.h5"


def test_two_filters_across_results_are_paired_by_run(two: tuple[Path, Path]) -> None:
    found = compared(*two, "ekf", "ukf")
    with open_results(two[0]) as a, open_results(two[1]) as b:
        one = a.statistic(0, "ekf", "rms")[:15, 1, 6]
        other = b.statistic(0, "ukf", "rms")[:, 1, 6]
    assert found.table is not None and found.reasons == ()
    row = found.table.rows[0]
    difference = row.cells[4]
    assert isinstance(difference, Number) and isinstance(row.cells[2], Number)
    assert difference.value == pytest.approx((one - other).mean(), rel=1e-12)
    assert row.cells[2].value == pytest.approx(one.mean(), rel=1e-12)
    theirs = stats.ttest_rel(one, other).confidence_interval(0.95)
    assert (difference.low, difference.high) == pytest.approx((theirs.low, theirs.high), rel=0.3)
    assert row.cells[6].text == "worse" and row.cells[8].text == "15 runs, decided"


def test_without_names_the_filters_that_both_have(two: tuple[Path, Path]) -> None:
    found = compared(*two)
    assert found.table is not None
    assert {row.cells[0].text for row in found.table.rows} == {"kf"}
    assert [row.cells[6].text for row in found.table.rows] == ["equal", "equal", "undecided"]


def test_why_not(two: tuple[Path, Path], invent: ResultMaker, tmp_path: Path) -> None:
    assert compared(*two, "ekf").reasons == ("case base: b has no run of ekf",)
    (tmp_path / "c").mkdir()
    more = invent(
        tmp_path / "c", filters={"kf": 1.0}, labels=("a=1", "a=2"), runs=3, failed={"kf": range(3)}, settle_s=100.0
    )
    found = compared(two[0], more, "kf")
    assert found.table is None
    assert any("no completed run in common" in reason for reason in found.reasons)
    assert "case a=2: only in b, with these settings" in found.reasons
    assert "the campaigns differ in statistics.settle_s" in found.reasons


def test_other_seeds_are_not_paired(two: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    with open_results(two[0]) as a, open_results(two[1]) as b:
        monkeypatch.setattr(b, "seed", 8)
        found = compare(Side(a, "a"), Side(b, "b"))
    assert found.table is None and found.reasons[0].startswith("the seeds differ (7 and 8)")


@pytest.mark.parametrize("form", ["text", "md", "csv", "latex"])
def test_the_command(two: tuple[Path, Path], form: str) -> None:
    found = CliRunner().invoke(app, ["compare", f"{two[0]}:ekf", f"{two[1]}:ukf", "--format", form])
    assert found.exit_code == 0, found.output
    assert {"text": "worse", "md": "|:--", "csv": "difference low 95", "latex": "\\toprule"}[form] in found.output


def test_two_filters_of_one_result(two: tuple[Path, Path]) -> None:
    found = CliRunner().invoke(app, ["compare", f"{two[0]}:kf", f"{two[0]}:ekf"])
    assert found.exit_code == 0 and "kf against ekf" in " ".join(found.output.split())


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["{a}:pf", "{b}"], "has no filter 'pf'; there are ekf, kf"),
        (["{a}:kf", "{b}", "--filter", "kf"], "not both"),
        (["{a}:ekf", "{b}:ekf"], "has no filter 'ekf'; there are ukf, kf"),
        (["nowhere.h5", "{b}"], "nowhere.h5"),
    ],
)
def test_mistakes(two: tuple[Path, Path], words: list[str], sentence: str) -> None:
    arguments = [word.format(a=two[0], b=two[1]) for word in words]
    found = CliRunner().invoke(app, ["compare", *arguments])
    assert found.exit_code in (2, 3) and sentence in found.output and "Traceback" not in found.output


def test_equal_figures_have_no_difference(two: tuple[Path, Path]) -> None:
    found = compared(two[0], two[0], "kf", "kf")
    assert found.table is not None
    values = [row.cells[4].value for row in found.table.rows if isinstance(row.cells[4], Number)]
    np.testing.assert_array_equal(values, 0)


def test_the_same_numbers_are_called_identical(two: tuple[Path, Path], tmp_path: Path) -> None:
    sentence = "both sides are identical: the same runs and numbers, bit for bit"
    copy = tmp_path / "copy.h5"
    shutil.copy(two[0], copy)
    assert sentence in compared(two[0], two[0]).notes and sentence in compared(two[0], copy, "kf", "kf").notes
    assert sentence not in compared(two[0], two[0], "ekf", "kf").notes and sentence not in compared(*two).notes
    with h5py.File(copy, "r+") as file:
        del file.attrs[seal.ATTRIBUTE]  # else the change itself is noticed first
        file.attrs["git_dirty"] = 1  # identical all the same
    shown = CliRunner().invoke(app, ["inspect", str(two[0]), str(copy)]).output
    assert "identical: the same" in shown and "comparable" not in shown
    table = compared(two[0], copy).table
    assert table is not None and {row.cells[6].text for row in table.rows} == {"equal"}
    assert {row.cells[8].text for row in table.rows} == {"equal in all 20 runs", "equal in all 19 runs"}
    with h5py.File(copy, "r+") as file:
        rms = file["case_000/kf/rms"]
        rms[3, 0, 0] = np.nextafter(rms[3, 0, 0], 1)
    assert sentence not in compared(two[0], copy).notes
    assert "identical" not in CliRunner().invoke(app, ["inspect", str(two[0]), str(copy)]).output

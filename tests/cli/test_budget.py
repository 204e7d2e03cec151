"""`relnav budget`: the table, what it names, and how it refuses. The example of docs/error-budget.md is run."""

import csv
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relnav_sim.cli.app import app

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "error-budget.md").read_text(encoding="utf-8")


SHORT = ["--set", "clock.duration_s=20", "--set", "statistics.settle_s=10"]


def invoke(*words):
    return CliRunner().invoke(app, ["budget", *map(str, words)])


@pytest.fixture
def demo(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "campaigns").mkdir()
    path = Path("campaigns/demo.yaml")
    path.write_text((ROOT / path).read_text(encoding="utf-8"), encoding="utf-8")
    return path


def test_the_example_of_the_page(demo):
    command, table = re.search(r"\$ relnav budget ([^\n]*)\n(.*?)```", PAGE, re.DOTALL).groups()
    done = invoke(*command.split())
    assert done.exit_code == 0, done.output
    first, _, phases = done.stdout.partition("position sigma at the end of each phase")
    printed = {line[:39].strip(): line[39:].split() for line in first.splitlines() if line[:39].strip()}
    assert "120 s: steady state; 600 s: end" in phases and "radar range noise" in phases
    rows = [line for line in table.splitlines() if re.search(r"\d %", line)]
    assert len(rows) > 12
    for row in rows:
        name, numbers = row[:39].strip(), row[39:].split()
        for stated, found in zip(numbers, printed[name], strict=True):
            if re.fullmatch(r"-?[\d.]+", stated) and abs(float(stated)) > 1e-4:
                assert float(found) == pytest.approx(float(stated), rel=0.02), row


def test_the_series_as_csv(demo):
    done = invoke(demo, "--filter", "ekf", "--csv", "budget.csv", *SHORT)
    assert done.exit_code == 0, done.output
    with open("budget.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    at_end = {row["source"]: float(row["variance_y_m2"]) for row in rows if float(row["time_s"]) == 20}
    total, _ = at_end.pop("total"), at_end.pop("formal")
    assert sum(at_end.values()) == pytest.approx(total, rel=1e-10)
    assert {row["ends"] for row in rows} == {"", "steady state", "end"}
    assert "exists already" in invoke(demo, "--csv", "budget.csv").stderr


@pytest.mark.parametrize(
    "words, sentence",
    [
        (["--filter", "imm"], "relnav: filter 'imm' has no error budget: its gain depends on the measurements"),
        (["--filter", "ekg"], "relnav: there is no filter 'ekg'; there are kf, ekf, ukf, imm"),
        (["--case", "2"], "relnav: the campaign has no case '2'; its cases are 0 to 1"),
        (["--figure", "budget.svg"], "relnav: --figure takes a name that ends with .png or .pdf, not budget.svg"),
        (["--result", "results/none.h5"], "relnav: results/none.h5: No such file"),
    ],
)
def test_refusals_are_sentences(demo, words, sentence):
    done = invoke(demo, *SHORT, *words)
    assert done.exit_code in (2, 3) and done.stderr.startswith(sentence) and len(done.stderr.splitlines()) == 1


def test_beside_a_monte_carlo(demo):
    short = ["--set", "clock.duration_s=60", "--set", "statistics.settle_s=20"]
    options = ["--backend", "sequential", "--runs", "12", "--set", "bound=false"]
    run = CliRunner().invoke(app, ["run", str(demo), *short, *options])
    assert run.exit_code == 0, run.output
    same = invoke(demo, "--filter", "ekf", "--figure", "budget.png", *short)
    assert Path("budget.png").read_bytes().startswith(b"\x89PNG")
    assert "results/demo.h5: position error of 12 runs" in same.stdout and "linear here" in same.stdout
    assert "results/demo.h5 is of another version of the campaign" in invoke(demo, *SHORT).stdout
    refused = invoke(demo, *SHORT, "--result", "results/demo.h5")
    assert refused.exit_code == 2 and "another campaign, or of another version of demo" in refused.stderr

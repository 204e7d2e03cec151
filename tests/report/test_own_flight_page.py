"""docs/your-own-flight.md and docs/replay.md: every command runs as it stands, and its figures are what comes of it."""

import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from relnav_sim.cli.app import app
from relnav_sim.results import open_results

DOCS = Path(__file__).parents[2] / "docs"
FILE = re.compile(r"`(?P<name>[\w.]+)`:\n\n(?:<!--.*?-->\n)?```yaml\n(?P<text>.*?)```", re.DOTALL)
COMMANDS = re.compile(r"```sh\n(?P<text>.*?)```", re.DOTALL)
ROW = re.compile(r"^\| (\w+) \| .* \| ([\d.]+) m \| ([\d.]+) \|$", re.MULTILINE)


@pytest.mark.slow
def test_the_page_runs_and_its_table_is_what_comes_of_it(tmp_path, monkeypatch, unrendered):
    page = (DOCS / "your-own-flight.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for match in FILE.finditer(page):
        (tmp_path / match["name"]).write_text(match["text"])
    said = {}
    for block in COMMANDS.finditer(page):
        for line in block["text"].splitlines():
            words = [*shlex.split(line)[1:], *(["--backend", "sequential"] if line.startswith("relnav run") else [])]
            done = CliRunner().invoke(app, words)
            assert done.exit_code == 0, done.output
            said[line] = done.output
    scored = said["relnav replay flight.yaml --measurements pass.csv"]
    assert "trusting is overconfident" in scored and re.search("middling is inconsistent: .*smoother disagree", scored)
    assert "doubting is consistent" in scored
    assert "filters start where the files of measurements say" in scored
    with open_results("results/flight.replay/result.h5") as results:
        summary = results.summary()
    rows = {name: (float(rms), float(anees)) for name, rms, anees in ROW.findall(page)}
    assert list(rows) == ["trusting", "middling", "doubting"]
    for name, (rms, anees) in rows.items():
        (row,) = (summary["filter"] == name).nonzero()[0]
        assert summary["settled_r_rms_m"][row] == pytest.approx(rms, rel=0.03)
        assert summary["settled_anees"][row] == pytest.approx(anees, rel=0.05)
    assert "not scored" in said["relnav replay flight.yaml --measurements pass.csv --truth none --out unscored"]
    assert not Path("unscored/result.h5").exists()


def test_the_table_of_options_is_that_of_the_command():
    page = (DOCS / "replay.md").read_text(encoding="utf-8")
    table = page[page.index("| option |") : page.index("Exit codes are")]
    told = set(re.findall(r"--[a-z]+", table))
    command = get_command(app).commands["replay"]  # type: ignore[attr-defined]
    known = {name for each in command.params for name in each.opts if name.startswith("--")} - {"--help"}
    assert told == known

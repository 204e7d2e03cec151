"""docs/ephemerides.md: everything on it runs as it stands."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relnav_sim import load_ephemeris
from relnav_sim.cli.app import app

PAGE = Path(__file__).parents[2] / "docs" / "ephemerides.md"
FILE = re.compile(r"`(?P<name>[\w.]+)`[^\n]*:\n\n(?:<!--.*?-->\n)?```(?:csv|yaml)\n(?P<text>.*?)```", re.DOTALL)
STEP = re.compile(r"```(?P<kind>python|sh)\n(?P<text>.*?)```", re.DOTALL)


@pytest.mark.slow
def test_everything_on_the_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], unrendered: None
) -> None:
    page = PAGE.read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names = [match["name"] for match in FILE.finditer(page) if (tmp_path / match["name"]).write_text(match["text"])]
    assert names == ["flown.csv", "simulated.yaml", "flown.yaml"]
    said = []
    for step in STEP.finditer(page):
        if step["kind"] == "python":
            exec(step["text"], {})
            continue
        for line in step["text"].splitlines():
            found = CliRunner().invoke(app, shlex.split(line)[1:])
            assert found.exit_code == 0, found.output
            said.append(found.output)
    assert capsys.readouterr().out.startswith("2021-07-10T15:59:42 UTC EME2000 (9, 6)\n")
    assert "The chief flies simulated_truth_run0_chief.oem" in said[2]
    errors = [float(number) for number in re.findall(r"withheld rows are met within ([\d.e-]+) m", said[2])]
    assert len(errors) == 2
    assert max(errors) < 1e-6
    estimate = load_ephemeris("results/flown_estimates_ekf_run1_deputy.oem")
    truth = load_ephemeris("results/flown_truth_run1_deputy.oem")
    assert 1e-3 < abs(estimate.states - truth.states)[-50:, :3].max() < 100

"""docs/example-analysis.py runs on a result as it stands."""

import runpy
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "docs" / "example-analysis.py"


def test_the_script_runs(
    result: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("xarray")
    monkeypatch.setattr(sys, "argv", [str(SCRIPT), str(result), str(tmp_path / "analysis.png")])
    runpy.run_path(str(SCRIPT), run_name="__main__")
    said = capsys.readouterr().out
    assert "ekf: rejected 10" in said and " against alpha_0.5: p = " in said
    assert "wrote" in said and (tmp_path / "analysis.png").stat().st_size > 5000

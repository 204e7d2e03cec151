"""docs/example-analysis.py runs on a result as it stands."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "docs" / "example-analysis.py"


def test_the_script_runs(result: Path, tmp_path: Path) -> None:
    pytest.importorskip("xarray")
    done = subprocess.run(
        [sys.executable, SCRIPT, result, tmp_path / "analysis.png"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "ekf: rejected 10" in done.stdout and " against alpha_0.5: p = " in done.stdout
    assert "wrote" in done.stdout and (tmp_path / "analysis.png").stat().st_size > 5000

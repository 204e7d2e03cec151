import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_one_founder_is_left_from_the_second_measurement_on() -> None:
    """What the evidence on depletion says of 100 runs, on ten of them; apart, because it registers a filter."""
    command = [sys.executable, "-m", "replication.wei2012.founders", "10"]
    lines = subprocess.run(command, check=True, capture_output=True, text=True, cwd=Path(__file__).parents[2]).stdout
    later = lines.splitlines()[1:]
    assert len(later) == 5
    assert all("one founder in 10 of 10 runs" in line for line in later)

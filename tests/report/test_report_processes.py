"""Processes that make parts of a report end with the one that started them."""

import os
import signal
import subprocess
import sys
import time

import joblib
import pytest

from relnav_sim.report.compose import _ended_with_this

SCRIPT = """
import os, sys, time, joblib
from relnav_sim.report.compose import _ended_with_this

def work(folder):
    open(os.path.join(folder, str(os.getpid())), "w").close()
    time.sleep(120)

joblib.Parallel(n_jobs=2, **_ended_with_this())(joblib.delayed(work)(sys.argv[1]) for _ in range(2))
"""


def within(seconds, holds):
    until = time.monotonic() + seconds
    while not holds() and time.monotonic() < until:
        time.sleep(0.05)
    return holds()


def runs(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_they_end_with_a_report_that_is_killed(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", SCRIPT, str(tmp_path)])
    try:
        assert within(60, lambda: len(os.listdir(tmp_path)) == 2)
        workers = [int(name) for name in os.listdir(tmp_path)]
        assert all(map(runs, workers))
    finally:
        process.send_signal(signal.SIGKILL)  # nothing is tidied up
        process.wait()
    assert within(10, lambda: not any(map(runs, workers)))


@pytest.mark.parametrize("processes", [1, 2])
def test_results_come_back(processes):
    options = _ended_with_this()
    assert joblib.Parallel(n_jobs=processes, **options)(joblib.delayed(abs)(-x) for x in range(5)) == [0, 1, 2, 3, 4]

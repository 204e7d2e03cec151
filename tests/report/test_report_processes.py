"""Processes that make parts of a report: they share the work, and they end with the one that started them."""

import os
import signal
import subprocess
import sys
import time

import pytest

from relnav_sim.report.processes import shared_out

SCRIPT = """
import os, sys, time
from relnav_sim.report.processes import shared_out

def work(folder):
    open(os.path.join(folder, str(os.getpid())), "w").close()
    time.sleep(120)

shared_out(work, [(sys.argv[1],)] * 2, 2)
"""
BRIEF = """
import os
from relnav_sim.kernels.code_folder import hush, warn_not_kept
from relnav_sim.report.processes import shared_out

hush()  # here alone: that code can't be kept, each process would say
assert shared_out(warn_not_kept, [("in a test",)] * 7, 2) == [None] * 7
os._exit(0)  # as a command ends that has waited too long: nothing is tidied up any more
"""


GROWING = """
import os, sys, time
from relnav_sim.report.processes import shared_out

def work(number):
    sys.__dict__.setdefault("held", []).append(b"1" * (160 << 20))
    time.sleep(1.2)  # Loky looks a second after it looked last
    return os.getpid()

assert len(set(shared_out(work, [(x,) for x in range(8)], 2))) == 2
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


def test_nothing_of_them_is_left_when_the_work_is_done_and_they_repeat_no_warning():
    """The tracker of semaphores would name on standard error what is left at the end of the process."""
    done = subprocess.run([sys.executable, "-c", BRIEF], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("processes", [1, pytest.param(2, marks=pytest.mark.slow)])  # as the process above does
def test_results_come_back_in_order(processes):
    assert shared_out(divmod, [(x, 3) for x in range(5)], processes) == [divmod(x, 3) for x in range(5)]


@pytest.mark.parametrize("processes", [1, 2])
def test_an_error_ends_them_and_is_told(processes):
    with pytest.raises(ZeroDivisionError):
        shared_out(divmod, [(1, 0)] * 4, processes)


@pytest.mark.slow
def test_a_process_that_needs_much_memory_is_not_replaced():
    pytest.importorskip("psutil", reason="without it Loky does not look at the memory")
    done = subprocess.run([sys.executable, "-c", GROWING], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")

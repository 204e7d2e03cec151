"""Ctrl-C while the program is still being imported."""

import os
import signal
import subprocess
import sys
import time

import pytest

CODE = """
import signal, sys
from relnav_sim.__main__ import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # where the tests run in the background it is ignored
plain = signal.signal
def told(*arguments):
    plain(*arguments)
    open({ready!r}, "w").close()
signal.signal = told
sys.argv = ["relnav", "schema"]
main()
"""


@pytest.mark.parametrize("after_s", [0.0, 0.05, 0.1, 0.15, 0.25])
def test_an_early_interrupt_shows_no_traceback(after_s, tmp_path):
    """From the first line of `main` on; before it, the interpreter is not yet ours."""
    ready = tmp_path / "ready"
    code = CODE.format(ready=str(ready))
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ
    )
    while not ready.exists() and process.poll() is None:
        time.sleep(0.001)
    time.sleep(after_s)
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=20)
    assert "Traceback" not in stderr
    assert process.returncode == 0 or (process.returncode == 130 and "interrupted" in stderr)

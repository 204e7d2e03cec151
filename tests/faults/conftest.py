"""Command lines whose processes do not outlive the test."""

from __future__ import annotations

import os
import signal
import subprocess

import pytest
from relnav_process import Relnav, members


@pytest.fixture
def relnav(tmp_path):
    """Return a maker of command lines; what is left of their processes at the end is killed."""
    started: list[subprocess.Popen[str]] = []

    def make(*changes: tuple[str, str], folder: str = "here", environment: dict[str, str] | None = None) -> Relnav:
        (tmp_path / folder).mkdir(exist_ok=True)
        made = Relnav(tmp_path / folder, *changes, environment=environment)
        plain = made.start

        def start(*arguments: str) -> subprocess.Popen[str]:
            started.append(plain(*arguments))
            return started[-1]

        made.start = start
        return made

    yield make
    for process in started:
        for pid in [*members(process.pid), process.pid]:
            if process.poll() is None or pid != process.pid:
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    continue
        process.communicate()

"""A real campaign through the real command line, in a process that can be killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from small_campaign import TEXT

RELNAV = [sys.executable, "-c", "import sys; sys.argv[0] = 'relnav'; from relnav_sim.__main__ import main; main()"]
LONGEST_S = 120.0


def heed_interrupts() -> None:
    """Let a new process be interrupted also where the tests run in the background, which has that ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


# Commands from standard input, one JSON list a line, each answered by exit code and what it said.
IN_TURN = """
import json, sys
from typer.testing import CliRunner
from relnav_sim.cli.app import app
for line in sys.stdin:
    done = CliRunner().invoke(app, json.loads(line))
    print(json.dumps([done.exit_code, done.stdout, done.stderr]), file=sys.__stdout__, flush=True)
"""


class Relnav:
    """Runs the command line in a folder, with a campaign file in it."""

    def __init__(self, folder: Path, *changes: tuple[str, str], environment: dict[str, str] | None = None) -> None:
        self.folder = folder
        self.environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", **(environment or {})}
        text = TEXT
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (folder / "small.yaml").write_text(text, encoding="utf-8")

    @property
    def out(self) -> Path:
        return self.folder / "results" / "small.h5"

    @property
    def shards(self) -> Path:
        return self.folder / "results" / "small.h5.shards"

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [*RELNAV, *arguments],
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=heed_interrupts,
        )

    def run(self, *arguments: str) -> tuple[int, str, str]:
        process = self.start(*arguments)
        stdout, stderr = process.communicate(timeout=LONGEST_S)
        return process.returncode, stdout, stderr

    def in_turn(self, *command_lines: Sequence[str]) -> list[tuple[int, str, str]]:
        """Run commands one after the other in one process, which spares the imports of the others."""
        done = subprocess.run(
            [sys.executable, "-c", IN_TURN],
            cwd=self.folder,
            env=self.environment,
            input="".join(f"{json.dumps(words)}\n" for words in command_lines),
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
        )
        assert done.returncode == 0, done.stderr
        return [tuple(json.loads(line)) for line in done.stdout.splitlines()]


def installed(site: Path, module: str, source: str) -> dict[str, str]:
    """Return the environment in which a module of filters counts as an installed package."""
    info = site / f"{module}-1.0.dist-info"
    info.mkdir(parents=True)
    (site / f"{module}.py").write_text(source)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[relnav.filters]\nbad = {module}\n")
    return {"PYTHONPATH": os.pathsep.join(part for part in (str(site), os.environ.get("PYTHONPATH", "")) if part)}


def members(session: int) -> dict[int, str]:
    """Return the living processes of a session with their command lines, without the session's leader."""
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdecimal() or int(entry.name) == session:
            continue
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
            if int(fields[3]) == session and fields[0] not in "ZX":
                found[int(entry.name)] = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except (OSError, ValueError):
            continue
    return found


def workers(session: int) -> list[int]:
    return [pid for pid, command in members(session).items() if "popen_loky" in command]


def wait_until(condition, seconds: float = LONGEST_S) -> bool:
    """Return whether the condition came true in time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return bool(condition())

"""Commands on campaigns of growing size: CPU seconds of command and workers, memory, bytes of the file."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from scale.campaigns import AXES, text

RELNAV = (sys.executable, "-m", "relnav_sim")
COMMANDS = {
    "validate": ("validate", "scale.yaml"),
    "run": ("run", "scale.yaml", "--out", "scale.h5"),
    "run again": ("run", "scale.yaml", "--out", "scale.h5"),
    "inspect": ("inspect", "scale.h5"),
    "report": ("report", "scale.h5"),
    "merge": ("merge", "merged.h5", "scale.h5.shards"),
    "inspect unfinished": ("inspect", "unfinished.h5"),
    "export": ("export", "scale.h5", "--out", "scale.csv"),
    "compare": ("compare", "scale.h5", "merged.h5"),
}
OF_THE_LARGEST = ("validate", "run", "run again", "inspect", "report")
"""The commands that are measured beyond 5000 cases and of full cases."""
_LOOK_S = 0.1


@dataclass(frozen=True)
class Timing:
    """One command on one campaign.

    Attributes:
        axis: Along what the campaign grows.
        value: Its size there.
        command: The command.
        cpu_s: User and system time of the command and its workers, s.
        wall_s: Time by the clock on the wall, s.
        memory_mb: Peak of the command's own process, workers left out, MB; NaN where only the largest of all is known.
        result_bytes: Size of the results file.
        shard_files: Files in the folder of shards.
    """

    axis: str
    value: int
    command: str
    cpu_s: float
    wall_s: float
    memory_mb: float
    result_bytes: int
    shard_files: int


def timings(axis: str, values: Collection[int], longest_s: float) -> Iterator[list[Timing]]:
    """Yield the timings of each size along an axis.

    Args:
        axis: The axis.
        values: The sizes.
        longest_s: Seconds that a command may take by the clock on the wall; the first that takes longer ends the size.
    """
    for value in values:
        everything = axis != "full cases" and (axis != "cases" or value <= 5000)
        wanted = [name for name in COMMANDS if everything or name in OF_THE_LARGEST]
        with tempfile.TemporaryDirectory(prefix="relnav_scale_") as place:
            folder, found = Path(place), list[Timing]()
            (folder / "scale.yaml").write_text(text(AXES[axis][0].along(axis, value)), encoding="utf-8")
            for name in wanted:
                if name == "inspect unfinished":
                    shutil.copytree(folder / "scale.h5.shards", folder / "unfinished.h5.shards")
                timing = _timed(axis, value, name, folder, longest_s)
                if timing is None:
                    break
                found.append(timing)
            yield found


def _timed(axis: str, value: int, name: str, folder: Path, longest_s: float) -> Timing | None:
    """Return what a command takes; None where that is too long."""
    before, memory_kb = time.monotonic(), 0
    with (folder / "log").open("w") as log:
        process = subprocess.Popen([*RELNAV, *COMMANDS[name]], cwd=folder, stdout=log, stderr=log)
        while True:
            found, status, used = os.wait4(process.pid, os.WNOHANG)
            if found:
                break
            memory_kb = max(memory_kb, _peak_kb(process.pid))
            if time.monotonic() - before > longest_s:
                process.kill()
                process.wait()
                return None
            time.sleep(_LOOK_S)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):
        raise SystemExit(f"{name} of {value} {axis}: {(folder / 'log').read_text()}")
    out, shards = folder / "scale.h5", folder / "scale.h5.shards"
    return Timing(
        axis,
        value,
        name,
        round(used.ru_utime + used.ru_stime, 2),
        round(time.monotonic() - before, 2),
        round(memory_kb / 1024),
        out.stat().st_size if out.exists() else 0,
        len(list(shards.iterdir())) if shards.exists() else 0,
    )


def _peak_kb(pid: int) -> int:
    """Return the largest memory that a process has had so far, kB; 0 where it has just ended."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM:")), 0)

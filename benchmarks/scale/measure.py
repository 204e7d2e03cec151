"""Commands on campaigns of growing size: CPU seconds of command and workers, memory, bytes of the file."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from scale.campaigns import AXES, text

RELNAV = (sys.executable, "-m", "relnav_sim")
COMMANDS = {
    "validate": ("validate", "scale.yaml"),
    "run": ("run", "scale.yaml", "--out", "scale.h5"),
    "run again": ("run", "scale.yaml", "--out", "scale.h5"),
    "inspect": ("inspect", "scale.h5"),
    "merge": ("merge", "merged.h5", "scale.h5.shards"),
    "inspect unfinished": ("inspect", "unfinished.h5"),
    "export": ("export", "scale.h5", "--out", "scale.csv"),
    "compare": ("compare", "scale.h5", "merged.h5"),
    "report": ("report", "scale.h5"),
}


@dataclass(frozen=True)
class Timing:
    """One command on one campaign."""

    axis: str
    value: int
    command: str
    cpu_s: float
    wall_s: float
    memory_mb: float
    result_bytes: int
    shard_files: int


def timings(axis: str, most: int, longest_s: float) -> Iterator[Timing]:
    """Yield the timings along an axis, values ascending, up to the first of which `run` takes longer than allowed."""
    base, values = AXES[axis]
    for value in values:
        if value > most:
            return
        with tempfile.TemporaryDirectory(prefix="relnav_scale_") as place:
            folder = Path(place)
            (folder / "scale.yaml").write_text(text(base.along(axis, value)), encoding="utf-8")
            for name, arguments in COMMANDS.items():
                if name == "inspect unfinished":
                    shutil.copytree(folder / "scale.h5.shards", folder / "unfinished.h5.shards")
                found = _timed(axis, value, name, arguments, folder, longest_s)
                if found is None:
                    return
                yield found


def _timed(
    axis: str, value: int, name: str, arguments: tuple[str, ...], folder: Path, longest_s: float
) -> Timing | None:
    before = time.monotonic()
    with (folder / "log").open("w") as log:
        process = subprocess.Popen([*RELNAV, *arguments], cwd=folder, stdout=log, stderr=log)
        timer = _killed_after(process, longest_s)
        _, status, used = os.wait4(process.pid, 0)
        timer.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode < 0:
        return None
    if process.returncode not in (0, 1):
        raise SystemExit(f"{name} of {value} {axis}: {(folder / 'log').read_text()}")
    out, shards = folder / "scale.h5", folder / "scale.h5.shards"
    return Timing(
        axis,
        value,
        name,
        round(used.ru_utime + used.ru_stime, 2),
        round(time.monotonic() - before, 2),
        round(used.ru_maxrss / 1024),
        out.stat().st_size if out.exists() else 0,
        len(list(shards.iterdir())) if shards.exists() else 0,
    )


def _killed_after(process: subprocess.Popen[bytes], seconds: float):
    import threading

    timer = threading.Timer(seconds, process.kill)
    timer.start()
    return timer

"""A limit of memory that is too low for the libraries: found out in a process that may die of it."""

from __future__ import annotations

import resource
import subprocess
import sys

from relnav_sim.safe_path import safe_path

LONGEST_S = 60.0
_LOADS = """
spare = bytearray(100_000_000)
import joblib, numpy, scipy.linalg, scipy.special, relnav_sim.runner.compute
numpy.linalg.inv(numpy.eye(200)) @ numpy.eye(200)
scipy.linalg.expm(numpy.eye(200))
"""
"""What every process of a campaign needs, and some room.

BLAS, of which NumPy and SciPy have one each, may wait for ever for memory that it does not get.
"""


def too_little_memory() -> str | None:
    """Return a sentence where the limit of virtual memory leaves the libraries too little; None where it does not.

    Compiled libraries end their process in many ways when they get no memory, so that it can't be told afterwards.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return None
    try:
        with safe_path():
            done = subprocess.run([sys.executable, "-c", _LOADS], capture_output=True, timeout=LONGEST_S, check=False)
        if done.returncode == 0:
            return None
    except (OSError, subprocess.TimeoutExpired, MemoryError):
        pass
    return (
        f"the limit of virtual memory, {limit / 1e6:.0f} MB for each process, is too low for relnav's libraries; "
        "raise it with ulimit -v, or lower the number of threads with OPENBLAS_NUM_THREADS=1"
    )

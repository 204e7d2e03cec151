"""What the benchmarks share: one core, contenders that take turns, tables, and the page docs/speed.md.

Import it before NumPy: it keeps libraries to one thread. The rounds take turns and the smallest CPU time of each
counts, so that a busy machine does not favour anyone. Arguments of every script: `--quick` (few steps, one round: tells
whether the script works, not what is fast) and `--docs` (write the result into docs/speed.md between the marks of the
script's section).
"""

import io
import json
import os
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

for name in ("OPENBLAS", "OMP", "MKL", "NUMEXPR", "NUMBA"):
    os.environ[f"{name}_NUM_THREADS"] = "1"
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["JAX_PLATFORMS"] = "cpu"

ROOT = Path(__file__).parents[1]
PAGE, IMAGES = ROOT / "docs" / "speed.md", ROOT / "docs" / "images"
BASELINE = "5a63ecf"
QUICK, DOCS = "--quick" in sys.argv, "--docs" in sys.argv

sys.path.insert(0, str(ROOT / "tests" / "filters"))


def keep_to_one_core() -> None:
    """Let this process and what it starts run on one core, the last it may use."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


@dataclass(frozen=True)
class Contender:
    """A piece of work that is timed.

    Args:
        run: Does it and returns what is compared.
        units: How many times the thing is done whose cost is told, run-steps say.
        clock: Seconds that a call took, from what it returned; default: CPU time of this process.
    """

    run: Callable[[], Any]
    units: float
    clock: Callable[[Any], float] | None = None


@dataclass(frozen=True)
class Timing:
    """The least cost of a contender over the rounds, us a unit, and what it returned last."""

    us: float
    result: Any


def take_turns(contenders: dict[str, Contender], rounds: int = 5) -> dict[str, Timing]:
    """Return the timings; a first round, not counted, pays for compiling and for the first use of memory."""
    least = dict.fromkeys(contenders, float("inf"))
    results = {}
    for number in range(2 if QUICK else rounds + 1):
        for name, contender in contenders.items():
            began = time.process_time()
            results[name] = contender.run()
            spent = time.process_time() - began
            if contender.clock is not None:
                spent = contender.clock(results[name])
            if number:
                least[name] = min(least[name], 1e6 * spent / contender.units)
    return {name: Timing(least[name], results[name]) for name in contenders}


def significant(value: float) -> str:
    """Return a number with three digits, without an exponent where that is short."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def beside(work: str, timings: dict[str, Timing], agreement: Callable[[Any, Any], str], unit: str = "us") -> list[str]:
    """Return rows of a table, one for each contender beside the first, which is relnav."""
    (_, relnav), *peers = timings.items()
    scale = {"us": 1.0, "ms": 1e-3, "s": 1e-6}[unit]
    return [
        f"| {work} | {significant(relnav.us * scale)} | {name} | {significant(peer.us * scale)} "
        f"| {significant(peer.us / relnav.us)} | {agreement(relnav.result, peer.result)} |"
        for name, peer in peers
    ]


def table(header: Sequence[str], rows: Sequence[str]) -> str:
    """Return a table in Markdown."""
    return "\n".join(["| " + " | ".join(header) + " |", "|" + "---|" * len(header), *rows])


def side_by_side_table(rows: Sequence[str], unit: str) -> str:
    """Return the table of `beside`'s rows."""
    return table(["work", f"relnav, {unit}", "beside", f"its time, {unit}", "times relnav's", "agreement"], rows)


def missing(error: ImportError) -> str:
    """Say, for the reader of a page, which peer is not there."""
    sentence = f"{error.name} could not be imported here ({error}), so it is left out."
    print(sentence, file=sys.stderr)
    return sentence


def publish(section: str, text: str) -> None:
    """Print a section and, if asked to, put it between its marks on the page."""
    print(f"{text}\n")
    if not DOCS:
        return
    begin, end = f"<!-- {section}: measured -->", f"<!-- {section}: end -->"
    page = PAGE.read_text()
    before, rest = page.split(begin)
    after = rest.split(end)[1]
    PAGE.write_text(f"{before}{begin}\n\n{text}\n\n{end}{after}")


def baseline() -> Path | None:
    """Return a copy of relnav at the commit that it is compared with, or None without the history."""
    tree = ROOT / "build" / f"relnav-{BASELINE}"
    if not tree.exists():
        packed = subprocess.run(["git", "-C", str(ROOT), "archive", BASELINE], capture_output=True)
        if packed.returncode:
            print(f"no baseline: {packed.stderr.decode().strip()}", file=sys.stderr)
            return None
        tree.mkdir(parents=True)
        with tarfile.open(fileobj=io.BytesIO(packed.stdout)) as archive:
            archive.extractall(tree, filter="data")
    return tree


def in_tree(tree: Path, script: str, *arguments: str) -> Any:
    """Return what a script prints as JSON when it imports relnav from that folder."""
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    command = [sys.executable, "-c", script, *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=tree)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])

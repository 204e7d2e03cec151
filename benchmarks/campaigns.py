"""Whole campaigns: CPU time beside an earlier relnav, and where the time goes.

`relnav run` with two workers, truth to results file, imports included. The campaigns are shortened unless `--full` is
given, which takes hours for the earlier relnav; what is shortened is the flight, with its settling time.

    python benchmarks/campaigns.py [--quick] [--docs] [--full]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split

import os
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import wraps

import h5py
import numpy as np

FULL = "--full" in sys.argv
# Seconds of flight and of settling; the campaigns' own are 6000 s, and 500 and 4000 s.
SHORT = {"alpha_kf_gaussian": (300, 100), "limit": (300, 100)}
if bench.QUICK:
    SHORT = dict.fromkeys(SHORT, (20, 10))
RUNS = 4 if bench.QUICK else 100
PARTS = ("truth", "sensors", "filters", "statistics", "storing, starting")
BUILD = bench.ROOT / "build"


def settings(name):
    """Return the changes that shorten a campaign."""
    if FULL:
        return []
    flight, settling = SHORT[name]
    return [f"clock.duration_s={flight}", f"statistics.settle_s={settling}", "statistics.convergence_hold_s=1"]


def forget(out):
    """Delete a results file with its shards, so that the campaign is computed anew."""
    out.unlink(missing_ok=True)
    shutil.rmtree(f"{out}.shards", ignore_errors=True)


def run_cpu_s(name, tree, out):
    """Return the CPU time, s, of `relnav run` with the relnav of a folder, with that of its workers."""
    command = [sys.executable, "-m", "relnav_sim", "run", str(tree / "campaigns" / f"{name}.yaml")]
    command += [f"--set={change}" for change in settings(name)]
    command += [f"--runs={RUNS}", "--workers=2", f"--out={out}"]
    said = out.with_suffix(".log")
    with said.open("w") as log:
        process = subprocess.Popen(
            command, cwd=BUILD, env={**os.environ, "PYTHONPATH": str(tree)}, stdout=log, stderr=log
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):  # 1: runs of a filter have failed, which is a result
        raise RuntimeError(f"{' '.join(command)} ended with {process.returncode}: {said.read_text()}")
    return used.ru_utime + used.ru_stime


def errors_of(out):
    """Return the RMS errors over the runs, by case and filter, of a results file: those after settling."""
    found = {}
    with h5py.File(out) as file:
        for case, filters in file.items():
            if case.startswith("case_"):
                found |= {
                    f"{case}/{name}": group["rms"][:, -1]
                    for name, group in filters.items()
                    if hasattr(group, "keys") and "rms" in group
                }
    return {name: np.sqrt(np.nanmean(np.square(each), axis=0)) for name, each in found.items()}


def agreement(new, old):
    here, there = errors_of(new), errors_of(old)
    most = max(float(np.nanmax(np.abs(here[name] / there[name] - 1))) for name in here.keys() & there.keys())
    return f"RMS errors of {len(here)} filters within {100 * most:.1g} %"


def whole_campaigns():
    tree = bench.baseline()
    if tree is None:
        return f"The history of commit {bench.BASELINE} is not here, so relnav of that commit is left out."
    trees = {"relnav": bench.ROOT, f"relnav at {bench.BASELINE}": tree}
    rows = []
    for name in SHORT:
        outs = {label: BUILD / f"{name}-{place}.h5" for place, label in enumerate(trees)}
        least = dict.fromkeys(trees, np.inf)
        for _ in range(1 if FULL or bench.QUICK else 2):
            for label, tree in trees.items():
                forget(outs[label])
                least[label] = min(least[label], run_cpu_s(name, tree, outs[label]))
        timings = {label: bench.Timing(1e6 * least[label], outs[label]) for label in trees}
        rows += bench.beside(f"`{name}.yaml`, {RUNS} runs", timings, agreement, "s")
    flight = "the whole flight" if FULL else f"the first {SHORT['limit'][0]} s of 6000 s of flight"
    return f"{bench.side_by_side_table(rows, 's')}\n\nThese are {flight}."


class Shares:
    """CPU time by part; what a part calls of another part counts there."""

    def __init__(self):
        self.spent, self._open, self._since = {}, ["the rest"], time.process_time()

    def _turn(self):
        now = time.process_time()
        part = self._open[-1]
        self.spent[part] = self.spent.get(part, 0.0) + now - self._since
        self._since = now

    @contextmanager
    def of(self, part):
        self._turn()
        self._open.append(part)
        try:
            yield
        finally:
            self._turn()
            self._open.pop()

    def watch(self, owner, name, part):
        function = getattr(owner, name)

        @wraps(function)
        def timed(*given, **named):
            with self.of(part):
                return function(*given, **named)

        setattr(owner, name, timed)


def shares(names):
    """Return a table of where the CPU time of campaigns goes, in one process."""
    from relnav_sim import load_campaign, run_campaign
    from relnav_sim.sensors import SensorSuite
    from relnav_sim.simulation import block, chunks
    from relnav_sim.simulation.host_orbits import HostOrbits
    from relnav_sim.truth import TruthTrajectory

    watched = Shares()
    watched.watch(chunks, "truth_trajectory", "truth")
    watched.watch(TruthTrajectory, "at", "truth")
    watched.watch(SensorSuite, "measure", "sensors")
    watched.watch(chunks, "filter_inputs", "sensors")
    watched.watch(HostOrbits, "advance", "sensors")
    watched.watch(block.FilterTrack, "__init__", "filters")
    watched.watch(block.FilterTrack, "add", "statistics")
    watched.watch(block.FilterTrack, "result", "statistics")
    watched.watch(block.FedFilter, "advance", "filters")
    rows = []
    for name in names:
        campaign = load_campaign(bench.ROOT / "campaigns" / f"{name}.yaml", [*settings(name), f"runs={RUNS}"])
        for _ in range(2):  # the first one reads what is compiled
            watched.spent = {}
            out = BUILD / f"{name}-shares.h5"
            forget(out)
            with watched.of("storing, starting"):
                run_campaign(campaign, out, workers=1, backend="sequential")
            watched.spent.pop("the rest", None)
        total = sum(watched.spent.values())
        cells = [f"{100 * watched.spent.get(part, 0.0) / total:.1f} %" for part in PARTS]
        rows.append(f"| `{name}.yaml` | {total:.1f} | " + " | ".join(cells) + " |")
    return bench.table(["campaign", "CPU time, s", *PARTS], rows)


def main():
    BUILD.mkdir(exist_ok=True)
    bench.publish("campaigns", whole_campaigns())
    bench.publish("shares", shares(SHORT))


if __name__ == "__main__":
    main()

"""How the cost grows: per run-step against runs, epochs, filters, particles and workers, docs/images/speed_scaling.png.

The slope of a line is that of the whole time, fitted on logarithms over the right half of the points: 1 where twice as
much takes twice as long, 0 where the cost is that of calls.

    python benchmarks/scaling.py [--quick] [--docs]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split

import os
import tempfile
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from filters import problem, radar, relnav

from relnav_sim import LinearDynamics, create_filter, load_campaign, run_campaign, run_filter

PICTURE = bench.IMAGES / "speed_scaling.png"
RUNS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
EPOCHS = (10, 30, 100, 300, 1000, 3000, 10000)
FILTERS = (1, 2, 4, 8)
PARTICLES = (100, 300, 1000, 3000, 10000, 30000)
WORKERS = (1, 2)
if bench.QUICK:
    RUNS, EPOCHS, FILTERS, PARTICLES = (1, 5), (10, 30), (1, 2), (100, 300)
KINDS = ("kf", "ekf", "ukf")
EKF = "{kind: ekf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-7}}"
CAMPAIGN = bench.ROOT / "campaigns" / "demo.yaml"


def costs(contenders, rounds=3):
    """Return the least cost of each contender, us a unit, in the order given."""
    named = {str(place): contender for place, contender in enumerate(contenders)}
    return np.array([timing.us for timing in bench.take_turns(named, rounds).values()])


def filter_of(kind, given):
    if kind == "kf":  # linear: positions are measured
        from relnav_sim import LinearMeasurement

        measurement = LinearMeasurement(np.eye(3, 6), np.diag([4.0, 6.0, 6.0]) ** 2)
        z = np.ascontiguousarray(np.broadcast_to([0.0, 5000.0, 200.0], given.z.shape))
        filter = create_filter(kind, LinearDynamics(given.F, given.Q), measurement)
        return bench.Contender(lambda: run_filter(filter, z, given.mean0, given.cov0), z.shape[0] * z.shape[1])
    return relnav(kind, given, radar())


def by_runs():
    """Return the costs of a run-step by kind: (RUNS,)."""
    steps = {runs: 20 if bench.QUICK else max(30, min(2000, 20000 // runs)) for runs in RUNS}
    return {kind: costs([filter_of(kind, problem(runs, steps[runs])) for runs in RUNS]) for kind in KINDS}


def by_epochs():
    """Return the costs of a run-step of one run by kind: (EPOCHS,)."""
    return {kind: costs([filter_of(kind, problem(1, epochs)) for epochs in EPOCHS]) for kind in KINDS}


def by_particles():
    """Return the costs of a run-step of the particle filter at 4 runs: (PARTICLES,)."""
    given = problem(4, 10)

    def contender(N):
        filter = create_filter("particle", LinearDynamics(given.F, given.Q), radar(), particles=N)
        return bench.Contender(lambda: run_filter(filter, given.z, given.mean0, given.cov0), 40)

    return {"particle": costs([contender(N) for N in PARTICLES])}


def campaign_of(filters, runs, folder, flight_s=30 if bench.QUICK else 600):
    """Return the demo campaign with so many Kalman filters."""
    text = CAMPAIGN.read_text().split("\nfilters:")[0]
    text += "\nfilters:\n" + "".join(f"  ekf_{place}: {EKF}\n" for place in range(filters))
    path = Path(folder) / f"scaling_{filters}.yaml"
    path.write_text(text)
    return load_campaign(path, [f"clock.duration_s={flight_s}", "statistics.settle_s=10", f"runs={runs}"])


def by_filters():
    """Return the CPU time of a campaign of 50 runs, s, in one process: (FILTERS,)."""
    with tempfile.TemporaryDirectory() as folder:

        def contender(filters):
            campaign, out = campaign_of(filters, 50, folder), Path(folder) / f"{filters}.h5"
            return bench.Contender(lambda: run_campaign(campaign, out, 1, "sequential", fresh=True), 1e6)

        return {"campaign": costs([contender(filters) for filters in FILTERS], rounds=2)}


def by_workers():
    """Return the time by the clock of a campaign of 200 runs, s: (WORKERS,)."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, range(os.cpu_count()))
    with tempfile.TemporaryDirectory() as folder:
        campaign, spent = campaign_of(8, 8, folder) if bench.QUICK else campaign_of(8, 200, folder, 6000), []
        for workers in WORKERS:
            rounds = []
            for _ in range(2):
                began = time.perf_counter()
                run_campaign(campaign, Path(folder) / f"{workers}.h5", workers, fresh=True)
                rounds.append(time.perf_counter() - began)
            spent.append(min(rounds))
        return {"campaign": np.array(spent)}


def slope(x, total):
    """Return the slope of the logarithms over the right half of the points."""
    half = len(x) // 2 if len(x) > 3 else 0
    return float(np.polyfit(np.log(x[half:]), np.log(total[half:]), 1)[0])


def main():
    bench.keep_to_one_core()
    panels = [
        ("runs in a block", "us per run-step", RUNS, by_runs(), lambda x, y: x * y),
        ("epochs, 1 run", "us per run-step", EPOCHS, by_epochs(), lambda x, y: x * y),
        ("particles, 4 runs", "us per run-step", PARTICLES, by_particles(), lambda x, y: y),
        ("ekf filters in a campaign", "CPU time, s", FILTERS, by_filters(), lambda x, y: y),
        ("workers", "time by the clock, s", WORKERS, by_workers(), lambda x, y: y),
    ]
    figure, axes = plt.subplots(1, len(panels), figsize=(17, 4), layout="constrained")
    rows = []
    for axis, (label, unit, x, curves, total) in zip(axes, panels, strict=True):
        for name, y in curves.items():
            fitted = slope(np.array(x), total(np.array(x), y))
            axis.loglog(x, y, "o-", ms=4, label=f"{name}, slope {fitted:.2f}")
            ends = f"{bench.significant(y[0])} | {bench.significant(y[-1])}"
            rows.append(f"| {label} | `{name}` | {x[0]} to {x[-1]} | {unit} | {ends} | {fitted:.2f} |")
        axis.set(xlabel=label, ylabel=unit)
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter("")
        if len(x) <= 4:
            axis.set_xticks(x, labels=map(str, x))
            axis.set_xticks([], minor=True)
        axis.grid(alpha=0.3, which="both")
        axis.legend(fontsize=8)
    if bench.DOCS:
        figure.savefig(PICTURE, dpi=110)
    header = ["against", "of", "from, to", "cost", "at the first", "at the last", "slope of the whole time"]
    text = bench.table(header, rows)
    bench.publish(
        "scaling", f"![Cost against runs, epochs, particles, filters and workers](images/{PICTURE.name})\n\n{text}"
    )


if __name__ == "__main__":
    main()

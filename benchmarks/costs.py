"""What a filter's step costs beside what is registered for planning: `cost_us`, `overhead_us` and those of dynamics.

Each filter with its default options, with the demo's truth and sensors, in blocks of two sizes: CPU time of a step
however few the runs, and of each run. Then the extended Kalman filter with each kind of dynamics, less that with `cw`;
then truth and sensors, and a filter's statistics.

    python benchmarks/costs.py [--quick] [FILTER ...]
"""

import side_by_side as bench  # keeps NumPy to one thread, so it comes first

# isort: split

import sys
import time

import numpy as np

from relnav_sim.campaign import parse_campaign
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.simulation.block import simulate_block
from relnav_sim.simulation.learned import Learned

DEMO = (bench.ROOT / "campaigns" / "demo.yaml").read_text(encoding="utf-8")
LONG = 300_000.0
"""Run-steps' worth of registered CPU time for each measurement, us."""
ROUNDS = 1 if bench.QUICK else 3
FEW, MANY = 2, 50
NOISE = "process_noise: {acceleration_psd_m2_s3: 1.0e-7}"


def entry(kind, dynamics="cw"):
    learned = filter_kinds()[kind].learned_dynamics
    return f"{{kind: {kind}, dynamics: {{kind: {'gp' if learned else dynamics}}}, {NOISE}}}"


def measured(entries, runs, epochs):
    """Return the CPU time of one step of a block, us: of all there is, and of the filters."""
    kinds = [f"filters.{name}={text}" for name, text in entries.items()]
    change = ["grid={}", "filters={}", *kinds, f"clock.duration_s={epochs}", "clock.store_every_s=1"]
    change += [
        "statistics.settle_s=1",
        "statistics.convergence_hold_s=1",
        "sensors.radar.noise={kind: mixture, scale: 3, fraction: 0.1}",
    ]
    case = parse_campaign(DEMO, change).cases[0]
    learned = Learned()
    best = np.full(2, np.inf)
    simulate_block(case, 1, range(runs), learned=learned)  # compiles, and learns what is to be learned
    for _ in range(ROUNDS):
        begin = time.process_time()
        result = simulate_block(case, 1, range(runs), learned=learned).result
        whole = 1e6 * (time.process_time() - begin) / epochs
        filters = sum(runs * found.summary["cpu_per_step"][0] for found in result.filters.values())
        best = np.minimum(best, [whole, filters])
    return best


def line(entries, cost_us, overhead_us):
    """Return overhead and cost for each run, us: of a step with all there is, and of the filters' own."""
    times = []
    for runs in (FEW, MANY):
        epochs = int(np.clip(LONG / (overhead_us + runs * cost_us), 6, 600))
        times.append(measured(entries, runs, epochs))
    slope = (times[1] - times[0]) / (MANY - FEW)
    return times[0] - FEW * slope, slope


def main():
    bench.keep_to_one_core()
    named = [word for word in sys.argv[1:] if not word.startswith("-")]
    print(f"{'filter':20} {'overhead_us':>12} {'registered':>10} {'cost_us':>10} {'registered':>10}")
    for name, kind in filter_kinds().items():
        if not named or name in named:
            overhead, cost = line({"f": entry(name)}, kind.cost_us, kind.overhead_us)
            print(
                f"{name:20} {overhead[1]:12.1f} {kind.overhead_us:10g} {cost[1]:10.2f} {kind.cost_us:10g}", flush=True
            )
    if named:
        return
    print(f"\n{'dynamics':20} {'step_overhead_us':>16} {'step_cost_us':>12} {'shared_overhead_us':>18}")
    base = None
    for name in ("cw", *sorted(set(dynamics_kinds()) - {"cw", "gp"})):
        overhead, cost = line({"f": entry("ekf", name)}, 3, 150)
        row = np.array([overhead[1], cost[1], overhead[0] - overhead[1]])
        base = row if base is None else base
        print("{:20} {:16.1f} {:12.2f} {:18.1f}".format(name, *(row - base)), flush=True)
    one = line({"f0": entry("ekf")}, 3, 150)
    nine = line({f"f{i}": entry("ekf") for i in range(9)}, 27, 1500)
    for what, a, b in zip(("overhead_us", "for each run, us"), one, nine, strict=True):
        rest = a[0] - a[1], b[0] - b[1]
        statistics = (rest[1] - rest[0]) / 8
        print(f"{what}: truth and sensors {rest[0] - statistics:.2f}, statistics of a filter {statistics:.2f}")


if __name__ == "__main__":
    main()

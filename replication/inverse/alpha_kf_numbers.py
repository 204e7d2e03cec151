"""The numbers that Shi et al. (2025) print, and the same of flown errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.frames import shi2025_from_rtn
from replication.inverse.alpha_kf_flight import ALPHAS, Clock, Flown
from replication.inverse.table import Number

FILTERS = ("ekf", "ukf", "alpha_kf")
QUANTITIES = ("x", "y", "z", "r", "vx", "vy", "vz", "v")
HOLD_S = 50.0
LATEST_S = 6000.0


def _unit(quantity: str) -> str:
    return "m/s" if quantity.startswith("v") else "m"


NUMBERS: tuple[Number, ...] = (
    *(
        Number(f"table_{table}", name, f"{quantity} {kind}", _unit(quantity), kind == "mean" and quantity not in "rv")
        for table in (2, 3)
        for name in FILTERS
        for quantity in QUANTITIES
        for kind in ("mean", "std")
    ),
    *(Number("table_2", name, "convergence", "s", digit=1.0) for name in FILTERS),
    *(
        Number("table_4", f"alpha={alpha:g}", f"{quantity} {kind}", _unit(quantity))
        for alpha in ALPHAS
        for quantity in ("r", "v")
        for kind in ("mean", "std")
    ),
)  # fmt: skip


def printed(paper: Mapping[str, Any]) -> Array:
    """Return the printed numbers in the order of `NUMBERS`, from the paper's entry in papers.yaml."""
    tables = [
        value
        for table in ("table_2", "table_3")
        for name in FILTERS
        for quantity in QUANTITIES
        for value in paper[table][quantity][name]
    ]
    times = [float(paper["convergence_s"][name]) for name in FILTERS]
    return np.array([*tables, *times, *(value for row in paper["table_4"] for value in row[1:])])


def numbers(setting: Mapping[str, float], flown: Mapping[int, Flown], steps: Clock) -> Array:
    """Return the numbers of the flown tables as a paper would print them of each run, unrounded, (runs, numbers)."""
    h = steps.steps_s
    ends = np.cumsum(h)
    weights = np.where(ends > setting["span_s"], h, 0.0)
    weights /= weights.sum()
    parts, times = [], []
    for table in (2, 3):
        for errors in flown[table].errors if table in flown else ():
            axes = shi2025_from_rtn(errors)
            r, v = _norm(axes[..., :3]), _norm(axes[..., 3:])
            series = np.concatenate([axes[..., :3], r[..., None], axes[..., 3:], v[..., None]], axis=-1)
            parts.append(_mean_and_std(series, weights))
            if table == 2:
                times.append(_convergence(setting, r, ends, weights)[:, None])
    parts += times
    for errors in flown[4].errors if 4 in flown else ():
        norms = np.stack([_norm(errors[..., :3]), _norm(errors[..., 3:])], axis=-1)
        parts.append(_mean_and_std(norms, weights))
    return np.concatenate(parts, axis=1)


def _norm(x: Array) -> Array:
    """Return the lengths of vectors (..., 3): five times as fast as NumPy's over so short an axis."""
    return np.asarray(np.sqrt(x[..., 0] ** 2 + x[..., 1] ** 2 + x[..., 2] ** 2))


def _mean_and_std(series: Array, weights: Array) -> Array:
    """Return mean and standard deviation over time of series (runs, K, q), in turns, (runs, 2 q)."""
    mean = np.einsum("k,rkq->rq", weights, series)
    spread = np.sqrt(np.einsum("k,rkq->rq", weights, (series - mean[:, None]) ** 2))
    return np.stack([mean, spread], axis=2).reshape(len(series), -1)


def _convergence(setting: Mapping[str, float], r: Array, ends: Array, weights: Array) -> Array:
    """Return when the position error of each run, (runs, K), first stays below the limit for `HOLD_S`, s."""
    limit = np.full(len(r), setting["limit_m"])
    if setting["limit_kind"] == 1:
        limit = setting["limit_ratio"] * np.sqrt(r**2 @ weights)
    above = r > limit[:, None]
    times = []
    for run in above:
        last = np.where(run, ends, 0.0)
        last = np.maximum.accumulate(last)  # when it was last above, up to each step
        held = ends - last >= HOLD_S
        times.append(last[np.argmax(held)] if held.any() else LATEST_S)
    return np.array(times)

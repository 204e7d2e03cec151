"""The tables of docs/clusters.md from the raw timings: seconds by size, and slopes with intervals."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np
from scipy.stats import t as student

from scale.measure import Timing

RAW = Path(__file__).with_name("timings.csv")
PAGE = Path(__file__).parents[2] / "docs" / "clusters.md"
MARKS = ("<!-- scale: written by make scale -->", "<!-- end of scale -->")


def keep(found: Sequence[Timing]) -> None:
    """Write raw timings beside those of other axes."""
    axes = {timing.axis for timing in found}
    rows = [timing for timing in known() if timing.axis not in axes] + list(found)
    with RAW.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Timing)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(map(asdict, rows))


def known() -> list[Timing]:
    """Return the raw timings that are there."""
    if not RAW.exists():
        return []
    kinds = {"axis": str, "command": str, "value": int, "result_bytes": int, "shard_files": int}
    with RAW.open(newline="") as file:
        return [Timing(**{k: kinds.get(k, float)(v) for k, v in row.items()}) for row in csv.DictReader(file)]


def slope(values: Sequence[int], seconds: Sequence[float]) -> tuple[float, float]:
    """Return CPU seconds per unit of size and the half width of its 95 % interval.

    A line through the points, weighted by 1/s: the scatter of a time is taken to be in proportion to it. What every
    command takes at any size is the line's constant. Infinite half width below three points.
    """
    if len(values) < 2:
        return math.nan, math.inf
    weight = 1 / np.asarray(seconds)
    A = np.stack([np.ones(len(values)), values], axis=1) * weight[:, None]
    b = np.asarray(seconds) * weight
    x, *_ = np.linalg.lstsq(A, b, rcond=None)
    free = len(values) - 2
    if not free:
        return float(x[1]), math.inf
    variance = float(np.sum((A @ x - b) ** 2)) / free
    sigma = math.sqrt(variance * np.linalg.inv(A.T @ A)[1, 1])
    return float(x[1]), float(student.ppf(0.975, free)) * sigma


def tables(found: Sequence[Timing]) -> str:
    """Return the tables in Markdown."""
    parts = []
    for axis in dict.fromkeys(timing.axis for timing in found):
        own = [timing for timing in found if timing.axis == axis]
        values = sorted({timing.value for timing in own})
        parts.append(_table(axis, values, own))
    return "\n\n".join(parts)


def _table(axis: str, values: Sequence[int], found: Sequence[Timing]) -> str:
    heading = [axis, *(f"{value:,}".replace(",", " ") for value in values), f"ms a unit of {axis}"]
    rows = [heading, [":--"] + ["--:"] * (len(heading) - 1)]
    for command in dict.fromkeys(timing.command for timing in found):
        own = {timing.value: timing for timing in found if timing.command == command}
        each, half = slope(list(own), [timing.cpu_s for timing in own.values()])
        interval = f"{1e3 * each:.3g} ± {1e3 * half:.2g}" if math.isfinite(half) else "-"
        rows.append([f"`{command}`, CPU s", *(f"{own[v].cpu_s:g}" if v in own else "-" for v in values), interval])
    runs = {timing.value: timing for timing in found if timing.command == "run"}
    rows.append(["memory of `run`, MB", *(f"{runs[v].memory_mb:.0f}" if v in runs else "-" for v in values), ""])
    rows.append(["result, MB", *(f"{runs[v].result_bytes / 1e6:.2g}" if v in runs else "-" for v in values), ""])
    rows.append(["files of shards", *(f"{runs[v].shard_files}" if v in runs else "-" for v in values), ""])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def write_page() -> None:
    """Write the tables between their marks."""
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(MARKS[0])
    _, _, after = rest.partition(MARKS[1])
    PAGE.write_text(f"{before}{MARKS[0]}\n{tables(known())}\n{MARKS[1]}{after}", encoding="utf-8")

"""The tables of docs/clusters.md from the raw timings: seconds by size, and slopes with intervals."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np
from scipy.stats import t as student

from scale.campaigns import AXES
from scale.measure import Timing

RAW = Path(__file__).with_name("timings.csv")
PAGE = Path(__file__).parents[2] / "docs" / "clusters.md"
MARKS = ("<!-- scale: written by make scale -->", "<!-- end of scale -->")


WITH_MEMORY = ("run", "report", "export", "compare")
"""Commands whose memory is shown."""


def keep(found: Sequence[Timing]) -> None:
    """Write raw timings beside those of other sizes, in the order of axes and sizes."""
    sizes = {(timing.axis, timing.value) for timing in found}
    rows = [timing for timing in known() if (timing.axis, timing.value) not in sizes] + list(found)
    rows.sort(key=lambda timing: (list(AXES).index(timing.axis), timing.value))
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
    """Return CPU seconds, or what else was measured, per unit of size and the half width of its 95 % interval.

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
    heading = [axis, *(f"{value:,}".replace(",", " ") for value in values), f"a unit of {axis}"]
    rows = [heading, [":--"] + ["--:"] * (len(heading) - 1)]
    commands = list(dict.fromkeys(timing.command for timing in found))
    own = {name: {timing.value: timing for timing in found if timing.command == name} for name in commands}
    for name in commands:
        seconds = {value: timing.cpu_s for value, timing in own[name].items()}
        rows.append(_row(f"`{name}`, CPU s", values, seconds, "{:g}", 1e3, "ms"))
    for name in WITH_MEMORY:
        memory = {value: t.memory_mb for value, t in own.get(name, {}).items() if math.isfinite(t.memory_mb)}
        rows.append(_row(f"memory of `{name}`, MB", values, memory, "{:.0f}", 1e3, "kB"))
    runs = own.get("run", {})
    size = {value: timing.result_bytes / 1e6 for value, timing in runs.items()}
    rows.append(_row("result, MB", values, size, "{:.3g}", 1e3, "kB"))
    files = {value: timing.shard_files for value, timing in runs.items()}
    rows.append(["files of shards", *(f"{files[v]}" if v in files else "-" for v in values), ""])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _row(name: str, values: Sequence[int], found: Mapping[int, float], form: str, scale: float, unit: str) -> list[str]:
    """Return a row of numbers with their slope."""
    each, half = slope(list(found), list(found.values()))
    each, half = (0.0 if abs(x) < 1e-9 else scale * x for x in (each, half))  # of rounding alone
    interval = f"{each:.3g} ± {half:.2g} {unit}" if math.isfinite(half) else "-"
    return [name, *(form.format(found[value]) if value in found else "-" for value in values), interval]


def write_page() -> None:
    """Write the tables between their marks."""
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(MARKS[0])
    _, _, after = rest.partition(MARKS[1])
    PAGE.write_text(f"{before}{MARKS[0]}\n{tables(known())}\n{MARKS[1]}{after}", encoding="utf-8")

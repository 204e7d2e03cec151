"""Error budgets as tidy CSV."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from relnav_sim.arrays import Array
from relnav_sim.budget.budget import Budget
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.csv_cells import csv_cell

_HEADING = (
    "filter",
    "source",
    "time_s",
    "ends",
    *(f"variance_{name}_m2" for name in "xyz"),
    *(f"variance_v{name}_m2_s2" for name in "xyz"),
)


def export_budgets(budgets: Sequence[Budget], store_every: int, path: Path) -> None:
    """Write the variances over time: one row per filter, source and stored epoch, with `total` and `formal` last.

    The ends of phases are there too, stored or not: the column `ends` says of these what ends the phase.

    Args:
        budgets: The budgets.
        store_every: Every how many epochs one is written.
        path: The CSV file; replaced as a whole.

    Raises:
        OSError: The file can't be written.
    """
    with written_whole(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_HEADING)
        for budget in budgets:
            ends = {phase.epoch: phase.ends for phase in budget.phases}
            epochs = sorted({*range(0, len(budget.times_s), store_every), *ends})
            series: dict[str, Array] = dict(zip(budget.sources, budget.variance, strict=True))
            for source, variance in (series | {"total": budget.total, "formal": budget.formal}).items():
                for k in epochs:
                    row = budget.filter, source, float(budget.times_s[k]), ends.get(k, ""), *variance[k].tolist()
                    writer.writerow(map(csv_cell, row))

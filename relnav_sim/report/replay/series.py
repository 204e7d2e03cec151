"""What filters said of recorded measurements, epoch by epoch, as CSV."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from relnav_sim.report.replay.figures_of_filters import FilterFigures
from relnav_sim.results import layout
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.csv_cells import csv_cell
from relnav_sim.simulation.replayed import Replay


def write_estimates(replay: Replay, filters: Sequence[FilterFigures], path: Path) -> None:
    """Write every estimate with its sigmas: a row for each filter, run and epoch; position and velocity, RTN."""
    units = [layout.quantity_unit(name) for name in layout.COMPONENTS]
    heading = ["filter", "run", "time_s"]
    heading += [f"{name}_{unit}" for name, unit in zip(layout.COMPONENTS, units, strict=True)]
    heading += [f"{name}_sigma_{unit}" for name, unit in zip(layout.COMPONENTS, units, strict=True)]
    _write(path, heading, _estimates(replay, filters))


def write_residuals(replay: Replay, filters: Sequence[FilterFigures], path: Path) -> None:
    """Write every residual with the sigma that the filter expected, in SI units and rad."""
    heading = ["filter", "run", "time_s", "sensor", "channel", "unit", "residual", "sigma", "nis", "dof"]
    _write(path, heading, _residuals(replay, filters))


def _estimates(replay: Replay, filters: Sequence[FilterFigures]) -> Iterator[list[Any]]:
    for one in filters:
        for row, recorded in enumerate(replay.recorded):
            numbers = np.concatenate(
                [
                    replay.block.times_s[:, None],
                    one.replayed.mean[row, :, : len(layout.COMPONENTS)],
                    one.replayed.sigma[row, :, : len(layout.COMPONENTS)],
                ],
                axis=1,
            )
            for values in numbers.tolist():
                yield [one.name, recorded.run, *values]


def _residuals(replay: Replay, filters: Sequence[FilterFigures]) -> Iterator[list[Any]]:
    for one in filters:
        for row, recorded in enumerate(replay.recorded):
            for sensor, channels in one.replayed.channels.items():
                residuals = one.replayed.residuals[sensor]
                nis, dof = one.replayed.nis[sensor][row], one.replayed.dof[sensor][row]
                for k, place in np.argwhere(np.isfinite(residuals.residual[row])).tolist():
                    each = channels[place]
                    pair = residuals.residual[row, k, place], residuals.sigma[row, k, place]
                    time_s = replay.block.times_s[k]
                    numbers = [float(value) for value in (*pair, nis[k])]
                    yield [one.name, recorded.run, float(time_s), sensor, each.name, each.unit, *numbers, int(dof[k])]


def _write(path: Path, heading: list[str], rows: Iterable[Iterable[Any]]) -> None:
    with written_whole(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heading)
        for row in rows:
            writer.writerow(map(csv_cell, row))

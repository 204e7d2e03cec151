"""`relnav export --part readings`: what a campaign's filters were given, as a flight would have recorded it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.cli.exported_runs import chosen_case, chosen_runs, file_of, writable
from relnav_sim.cli.failures import UserError
from relnav_sim.cli.output import say

if TYPE_CHECKING:
    from relnav_sim.astro.epoch import Epoch
    from relnav_sim.campaign.models import CaseConfig
    from relnav_sim.recorded.readings import Layout, Readings
    from relnav_sim.results import Results


def export_readings(
    results: Results,
    result: Path,
    case: str | None,
    runs: Sequence[int],
    sensors: Sequence[str],
    to: str,
    out: str | None,
    overwrite: bool,
) -> None:
    """Write the measurements of some runs, simulated again, each to files of its own.

    Args:
        results: An open result.
        result: Its path as the user gave it.
        case: Number, label or id of the case; None: the first.
        runs: Numbers of the runs; none: the first that the result holds.
        sensors: Names of the sensors whose measurements are written; none: all.
        to: ``csv``, or ``tdm`` with a CSV file beside it for what no TDM can hold.
        out: The file, or a folder; None: beside the result.
        overwrite: Whether files may be replaced.

    Raises:
        UserError: The result has no such run, or what is asked for can't be written.
    """
    from relnav_sim.campaign.problems import no_such
    from relnav_sim.results.stored_campaign import stored_campaign
    from relnav_sim.sensors import readings_layout
    from relnav_sim.simulation.recording import record

    index = chosen_case(results, case)
    chosen = chosen_runs(results, result, runs)
    campaign = stored_campaign(results)
    config = campaign.cases[index].config
    epoch = config.truth.start_epoch
    if to == "tdm" and epoch is None:
        raise UserError(
            "a TDM holds calendar dates, and the campaign has none; give it a truth.epoch, as "
            "2010-07-27T00:00:00 UTC, or export --to csv"
        )
    layout = readings_layout(config.sensors)
    if unknown := [name for name in sensors if name not in layout]:
        raise UserError(no_such("sensor", unknown[0], list(layout)))
    stem = f"{result.stem}_readings" + (f"_case{index}" if len(campaign.cases) > 1 else "")
    paths = {run: file_of(result, out, f"{stem}_run{run}.{to}", len(chosen), "runs") for run in chosen}
    for path in paths.values():
        beside = path.with_suffix(".csv") if to == "tdm" else None
        if path == beside:
            raise UserError(f"{path} is where what no TDM can hold goes; give --out another ending, as .tdm")
        for each in filter(None, (path, beside)):
            writable(each, result, overwrite)
    comments = {"campaign": campaign.name, "case": campaign.cases[index].label, "seed": str(campaign.seed)}
    comments |= {} if epoch is None else {"epoch": epoch.text()}
    for readings in record(config, campaign.seed, chosen):
        path = paths[readings.run]
        if sensors:
            chosen_ones = {name: one for name, one in readings.sensors.items() if name in sensors}
            readings = replace(readings, sensors=chosen_ones)
        if epoch is not None and to == "tdm":
            readings = _write_tdm(path, readings, layout, config, epoch)
            path = path.with_suffix(".csv")
        _write_csv(path, readings, layout, comments)


def _write_csv(path: Path, readings: Readings, layout: Layout, comments: dict[str, str]) -> None:
    from relnav_sim.recorded.readings_csv import write_csv
    from relnav_sim.results.atomic import written_whole

    with written_whole(path) as temporary:
        write_csv(temporary, readings, layout, comments)
    say(f"wrote {path}")


def _write_tdm(path: Path, readings: Readings, layout: Layout, config: CaseConfig, epoch: Epoch) -> Readings:
    """Write what a TDM can hold; return the rest."""
    from relnav_sim.astro.epoch import now
    from relnav_sim.recorded.tdm_writing import fits_tdm, write_tdm
    from relnav_sim.results.atomic import written_whole
    from relnav_sim.sensors import relative_sensors

    targets = {
        name: "deputy" if options.host == "chief" else "chief"
        for name, options in relative_sensors(config.sensors).items()
        if fits_tdm(layout[name])
    }
    fitting = {name: one for name, one in readings.sensors.items() if name in targets}
    if not fitting:
        raise UserError("no sensor of the campaign measures range, range rate or two angles alone; export --to csv")
    created = now()
    with written_whole(path) as temporary:
        write_tdm(temporary, replace(readings, sensors=fitting), layout, epoch, targets, created)
    say(f"wrote {path}: {', '.join(fitting)}")
    return replace(readings, sensors={name: one for name, one in readings.sensors.items() if name not in fitting})

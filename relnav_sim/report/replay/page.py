"""The page of a replay as data: the verdicts, tables and drawn figures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from relnav_sim.plots import residuals
from relnav_sim.report.drawing import Drawing, FigureFolder, Picture, draw, file_name
from relnav_sim.report.replay.figures_of_filters import FilterFigures
from relnav_sim.report.replay.tables import channels_table, scores_table, sensors_table
from relnav_sim.report.replay.verdict import shared_findings, verdict
from relnav_sim.report.tables import Table
from relnav_sim.results.missing_runs import run_ranges
from relnav_sim.simulation.replayed import Replay
from relnav_sim.wording import counted

UNSCORED = (
    "No truth is known for these measurements, so nothing here says how far the estimates are from it. The "
    "residuals can "
    "show that a filter is wrong; they can't show that it is right: an error that no measurement feels leaves no "
    "trace in "
    "them."
)


@dataclass(frozen=True)
class FilterSection:
    """What is shown of one filter.

    Attributes:
        name: Its name.
        verdict: What its residuals amount to.
        table: Its channels.
        pictures: Its figures.
    """

    name: str
    verdict: str
    table: Table
    pictures: tuple[Picture, ...]


@dataclass(frozen=True)
class ReplayPage:
    """The page of a replay.

    Attributes:
        name: Name of the campaign.
        facts: What was replayed, a few words each.
        verdicts: A sentence for each filter, the verdict first.
        scored: What estimates are scored against, or that nothing is, in a sentence.
        warnings: What the user should know: sentences.
        tables: The tables over all filters.
        sections: The filters.
        files: Files of measurements with their digests.
        reading: How to read it: sentences.
        footer: Where it came from.
        filter_names: Names of the filters.
    """

    name: str
    facts: tuple[str, ...]
    verdicts: tuple[str, ...]
    scored: str
    warnings: tuple[str, ...]
    tables: tuple[Table, ...]
    sections: tuple[FilterSection, ...]
    files: tuple[tuple[str, str], ...]
    reading: tuple[str, ...]
    footer: str
    filter_names: tuple[str, ...]


_READING = (
    "NIS is the squared residual in units of the covariance that the filter states for it; over its degrees of freedom "
    "it is 1 on average where that covariance is right. More: overconfident; less: conservative.",
    "Residuals of a filter that is right are white: no measurement says anything about the next one's residual. What "
    "correlates them is wrong in the dynamics, in the process noise, or in what the filter is told of the sensor.",
    "The smoother sees all measurements. Where the filter is right, the change from filtered to smoothed estimate "
    "has the "
    "covariance P_f - P_s; a larger change says that the process noise does not cover what the dynamics leave out.",
    "Filters with a mixture as noise, or that reweight measurements, have a NIS that is not chi-square; its mean "
    "still is "
    "its degrees of freedom.",
)


def replay_page(replay: Replay, filters: list[FilterFigures], figure_folder: FigureFolder, version: str) -> ReplayPage:
    """Return the page, its figures drawn into a folder that is there."""
    runs = len(replay.recorded)
    block = replay.block
    settle_s = block.config.statistics.settle_s
    tables = [sensors_table(filters)]
    if replay.truth:
        tables.insert(0, scores_table(filters, replay.truth, settle_s))
    return ReplayPage(
        name=replay.campaign.name,
        facts=(
            run_ranges([one.run for one in replay.recorded]),
            f"{block.times_s[-1]:g} s in steps of {block.config.clock.step_s:g} s",
            counted(len(replay.files), "file"),
            f"seed {replay.campaign.seed}",
            *([f"case {replay.case.label}"] if replay.case.variables else []),
        ),
        verdicts=(
            *(f"{one.name} is {verdict(one, runs)}." for one in filters),
            *(f"{name} broke: {why.reason}." for name, why in block.broken.items()),
            *([shared] if (shared := shared_findings(filters)) else []),
        ),
        scored=f"Estimates are scored against {replay.truth}."
        if replay.truth
        else f"{UNSCORED} {replay.unscored}".strip(),
        warnings=(*replay.notes, *block.warnings),
        tables=tuple(tables),
        sections=tuple(_section(replay, one, place, figure_folder) for place, one in enumerate(filters)),
        files=tuple((file.path, file.sha256) for file in replay.files),
        reading=_READING,
        footer=f"Written by relnav {version} from recorded measurements.",
        filter_names=tuple(one.name for one in filters),
    )


def _section(replay: Replay, one: FilterFigures, place: int, folder: FigureFolder) -> FilterSection:
    stem = file_name(one.name, place)
    makers = {
        f"residuals_{stem}": partial(_residuals, replay, one),
        f"nis_{stem}": partial(_nis, replay, one),
        f"autocorrelation_{stem}": partial(_autocorrelation, one),
    }
    drawn = [draw(folder, name, make, one.name) for name, make in makers.items()]
    return FilterSection(
        one.name,
        verdict(one, len(replay.recorded)),
        channels_table(one, place),
        tuple(picture for picture in drawn if picture is not None),
    )


def _residuals(replay: Replay, one: FilterFigures) -> Drawing:
    residuals_of = one.replayed.residuals
    numbered = [
        (sensor, channel) for sensor, channels in one.replayed.channels.items() for channel in range(len(channels))
    ]
    series = [
        (check, residuals_of[sensor].residual[0, :, channel], residuals_of[sensor].sigma[0, :, channel])
        for check, (sensor, channel) in zip(one.checks.channels, numbered, strict=True)
    ]
    words = residuals.residuals_words(one.name, one.checks.channels, replay.recorded[0].run)
    return Drawing(residuals.residuals_over_time(replay.block.times_s, series), words.caption, words.alt)


def _nis(replay: Replay, one: FilterFigures) -> Drawing:
    series = {
        check.sensor: (check, one.replayed.nis[check.sensor][0], one.replayed.dof[check.sensor][0])
        for check in one.checks.nis
    }
    words = residuals.nis_words(one.name, one.checks.nis, replay.recorded[0].run)
    return Drawing(residuals.nis_over_time(replay.block.times_s, series), words.caption, words.alt)


def _autocorrelation(one: FilterFigures) -> Drawing:
    words = residuals.autocorrelation_words(one.name, one.checks.channels)
    return Drawing(residuals.autocorrelation(one.checks.channels), words.caption, words.alt)

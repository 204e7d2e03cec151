"""Adaptive stopping: after fixed numbers of runs, in run order, so that neither workers nor time have a say.

Looking at the data after every run and stopping at the first that pleases would stop on lucky chunks; a few looks
that are fixed beforehand keep that bias small, and the result says which look ended it (Jennison and Turnbull 2000).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign import Campaign
from relnav_sim.campaign.models import StopOptions
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.results import layout
from relnav_sim.results.block import RefusedError
from relnav_sim.results.campaign_header import ResultHeader
from relnav_sim.results.shard_files import held_shards
from relnav_sim.results.shards import shard_block, shard_info
from relnav_sim.runner.work import Finished, Key


def looks(campaign: Campaign, part: tuple[int, int]) -> Sequence[int]:
    """Return the numbers of runs after which the campaign pauses; the last is all of its runs.

    Raises:
        RefusedError: The campaign stops by a rule, and is to be split over machines.
    """
    if campaign.stop is None:
        return (campaign.runs,)
    if part[1] > 1:
        raise RefusedError("a campaign with a rule to stop looks at all its runs together; it can't be split in parts")
    return (*(n for n in campaign.stop.at if n < campaign.runs), campaign.runs)


def look_at(header: ResultHeader, campaign: Campaign, finished: Finished, runs: int) -> tuple[ResultHeader, bool]:
    """Return the header with what the look found, and whether the campaign may stop; stressed cases have no say.

    Args:
        header: Of the result.
        campaign: The campaign.
        finished: Its shards, which hold this many runs of every case and filter.
        runs: Number of runs to look at, from the first.
    """
    rule = campaign.stop
    if rule is None:
        return header, False
    ids = {(case.id, *item) for case in campaign.nominal_cases for item in case.filter_ids.items()}
    wanted = {key for key in ids if rule.filter in (None, key[1])}
    figures = _figures(finished, rule, wanted, runs)
    widest = max(half_width(figures.get(key, {})) for key in wanted)
    met = widest <= rule.half_width
    stopping = {
        **rule.model_dump(mode="json"),
        "level": CONFIDENCE,
        "reached": runs,
        "met": met,
        # NaN is no JSON; it means that some filter has too few runs that did not fail.
        "widest": widest if math.isfinite(widest) else None,
    }
    return replace(header, runs=runs, stopping=stopping), met and runs < campaign.runs


def half_width(figures: Mapping[int, float]) -> float:
    """Return the half width of Student's 95 % interval of the mean over runs; infinite below two runs.

    Args:
        figures: One figure for each run, by its number; runs without one (NaN) don't count.
    """
    from scipy.special import stdtrit

    sample = np.array([figures[run] for run in sorted(figures) if math.isfinite(figures[run])])
    if len(sample) < 2:
        return math.inf
    quantile = float(stdtrit(len(sample) - 1, (1 + CONFIDENCE) / 2))
    return quantile * float(sample.std(ddof=1)) / math.sqrt(len(sample))


def _figures(finished: Finished, rule: StopOptions, wanted: set[Key], runs: int) -> dict[Key, dict[int, float]]:
    """Return the rule's metric of every run that did not fail, by case and filter."""
    name, place = _column(rule.metric)
    found: dict[Key, dict[int, float]] = {}
    bundles, _ = held_shards(finished.folder)
    for shard in finished.shards:
        info, block = shard_info(bundles[shard]), shard_block(bundles[shard])
        for filter, identity in info.filter_ids.items():
            key = (info.case_id, filter, identity)
            if key not in wanted:
                continue
            arrays = block.filters[filter].arrays()
            where: tuple[Any, ...] = (slice(None), *place)
            values: Array = arrays[name][where]
            sound = arrays["failed"] == 0
            rows = found.setdefault(key, {})
            rows |= {run: float(v) for run, v, ok in zip(info.runs, values, sound, strict=True) if ok and run < runs}
    return found


def _column(metric: str) -> tuple[str, tuple[int, ...]]:
    for spec in layout.SUMMARY:
        for column, place in layout.columns(spec):
            if column == metric:
                return spec.name, place
    raise KeyError(metric)

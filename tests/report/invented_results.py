"""Results files of invented campaigns, written by the real writer, for the report's tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sensors_result import CHANNELS, with_sensors

from relnav_sim.results import layout
from relnav_sim.results.block import BlockResult, Failure, FilterResult
from relnav_sim.results.campaign_header import CaseHeader, ResultHeader
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.pieces import bundle_piece
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.shards import unwritten_shard

Array = NDArray[np.float64]
ResultMaker = Callable[..., Path]

SETTLE_S = 500.0
STORE_EVERY = 5
AXIS_SIGMA = np.array([0.3, 0.4, 0.5, 4e-3, 3e-3, 6e-3])


@pytest.fixture(scope="session")
def invent() -> ResultMaker:
    """Return `invented_result`, which writes a results file."""
    return invented_result


@pytest.fixture
def make_result(tmp_path: Path) -> ResultMaker:
    """Return `invented_result` for the test's own folder."""
    return partial(invented_result, tmp_path)


def invented_result(
    folder: Path,
    name: str = "invented",
    labels: Sequence[str] = ("base",),
    filters: Mapping[str, float] | None = None,
    runs: int = 12,
    times: int = 61,
    failed: Mapping[str, Sequence[int]] | None = None,
    planned: int | None = None,
    text: str = "name: invented\n",
    settle_s: float = SETTLE_S,
    summaries: Mapping[str, Mapping[str, Array]] | None = None,
    waiting: Sequence[str] = (),
    computed_cases: int | None = None,
    variables: Sequence[Mapping[str, Any]] | None = None,
    requirements: Mapping[str, Any] | None = None,
    diagnostics: Mapping[str, Mapping[str, Array]] | None = None,
    stopping: Mapping[str, Any] | None = None,
    duration_s: float = 6000.0,
    dispersed: bool = False,
    unknown: bool = False,
    sensors: bool = False,
    stresses: Sequence[str] = (),
) -> Path:
    """Write the result of a campaign that never ran.

    Args:
        folder: Where the file goes.
        name: The campaign's name.
        labels: One label per case.
        filters: How large each filter's errors are, 1 being its formal sigma.
        runs: Runs computed.
        times: Stored epochs, over 6000 s.
        failed: Failed runs by filter, the same in every case.
        planned: Runs that the campaign asked for, if not those computed.
        text: The campaign file.
        settle_s: Start of the settled span.
        summaries: Summary datasets by filter that replace the invented ones.
        waiting: Filters that have no run yet.
        computed_cases: How many of the cases have runs; default all.
        variables: What each case varies; default one radar sigma.
        requirements: As a campaign file has them.
        diagnostics: What the filters report of their own working, by filter and name.
        stopping: The rule that ended the campaign.
        duration_s: Length of the runs.
        dispersed: Every run flies a truth of its own, the range of which varies; otherwise all fly one at rest.
        unknown: Every error and sigma is NaN, though no run failed.
        sensors: The filters take two sensors, those of `sensors_result`.
        stresses: The last cases are the first one under these stresses.
    """
    sizes = dict(filters or {"kf": 1.0, "ekf": 0.6, "ukf": 0.601})
    failed = failed or {}
    time_s = np.linspace(0.0, duration_s, times)
    names = (*sizes, *waiting)
    cases = tuple(
        CaseHeader(
            f"case{i:04d}",
            label,
            dict(variables[i]) if variables else {"sensors.radar.range_sigma_m": i},
            names,
            dict.fromkeys(names, "0"),
            CHANNELS if sensors else {},
        )
        for i, label in enumerate(labels)
    )
    nominal = len(cases) - len(stresses)
    stressed = zip(cases[nominal:], stresses, strict=True)
    cases = *cases[:nominal], *(replace(case, stress=name, nominal=cases[0].id) for case, name in stressed)
    content = _content(sizes, settle_s) | {"requirements": dict(requirements or {})}
    header = ResultHeader(
        name, text, content, "0123456789abcdef" * 4, 7, planned or runs, cases, {"mu_m3_s2": 3.986e14},
        stopping=stopping or {},
    )  # fmt: skip
    out, shards = folder / "invented.h5", []
    for index, case in enumerate(cases[:computed_cases]):
        truth = np.tile(np.array([0.0, 12000.0, 0.0, 0.0, 0.0, 0.0]), (runs if dispersed else 1, times, 1))
        if dispersed:
            truth[..., 1] += 100.0 * np.arange(runs)[:, None] - 1.9 * time_s
        results = {
            name: _filter_result(index, size, time_s, runs, failed.get(name, ()), settle_s)
            for name, size in sizes.items()
        }
        if sensors:
            step_s = duration_s / (times - 1) / STORE_EVERY
            results = {
                name: with_sensors(result, step_s, STORE_EVERY, settle_s, sizes[name] ** 2)
                for name, result in results.items()
            }
        if unknown:
            results = {name: _all_nan(result) for name, result in results.items()}
        for filter_name, summary in (summaries or {}).items():
            results[filter_name] = _with_summary(results[filter_name], summary)
        for filter_name, reported in (diagnostics or {}).items():
            results[filter_name] = replace(results[filter_name], diagnostics=reported)
        failures = tuple(
            Failure(run, filter_name, 17, "the covariance is not positive definite")
            for filter_name, lost in failed.items()
            for run in lost
        )
        block = BlockResult(index, case.id, tuple(range(runs)), time_s, truth, results, failures, not dispersed)
        shards.append(unwritten_shard(out, block, header.seed, dict.fromkeys(sizes, "0")))
    merge_pieces(map(bundle_piece, shards), header, _provenance(), out, complete=False)
    return out


def _content(sizes: Mapping[str, float], settle_s: float) -> dict[str, Any]:
    return {
        "clock": {"duration_s": 6000.0, "step_s": 1.0, "store_every_s": 100.0},
        "sensors": {"radar": {"range_sigma_m": 4.0}},
        "statistics": {"settle_s": settle_s, "convergence_m": 10.0, "convergence_hold_s": 50.0},
        "filters": {name: {"kind": "ekf", "dynamics": {"kind": "cw"}} for name in sizes},
    }


def _filter_result(
    case: int, size: float, time_s: Array, runs: int, lost: Sequence[int], settle_s: float
) -> FilterResult:
    rng = np.random.default_rng([case, 1])  # common random numbers: the same draws for every filter
    noise = rng.normal(size=(runs, len(time_s), 6))
    for k in range(1, len(time_s)):
        noise[:, k] = 0.8 * noise[:, k - 1] + 0.6 * noise[:, k]
    grown = 1 + 30 * np.exp(-time_s / 80)[None, :, None]
    sigma = np.broadcast_to(AXIS_SIGMA * grown * (1 + 0.2 * case), noise.shape)
    error = size * sigma * noise
    norms = np.stack([np.linalg.norm(error[..., :3], axis=-1), np.linalg.norm(error[..., 3:], axis=-1)], axis=-1)
    quantities = np.concatenate([error, norms], axis=-1)
    spans = np.stack([np.ones_like(time_s, dtype=bool), time_s >= settle_s])
    nees = np.sum((error / sigma) ** 2, axis=-1)
    empty = dict(FilterResult.all_failed(runs, len(time_s)).summary)
    with np.errstate(invalid="ignore"):
        for s, span in enumerate(spans):
            part = quantities[:, span]
            if not span.any():
                continue
            empty["mean"][:, s] = part.mean(axis=1)
            empty["std"][:, s] = part.std(axis=1)
            empty["rms"][:, s] = np.sqrt((part**2).mean(axis=1))
            empty["anees"][:, s, 0] = nees[:, span].mean(axis=1) / 6
            squares = np.square(error / sigma)[:, span]
            empty["anees"][:, s, 1], empty["anees"][:, s, 2] = (
                squares[..., block].mean(axis=(1, 2)) for block in (slice(3), slice(3, 6))
            )
            empty["updates"][:, s] = span.sum()
            empty["nis_mean"][:, s] = 3 * size**2 * (1 + 0.02 * rng.normal(size=runs))
    empty["convergence"][:] = 100 + 20 * rng.normal(size=runs) * size
    empty["cpu_per_step"][:] = 1.0 + size
    empty["failed"][:] = 0
    empty["failed"][list(lost)] = 1
    for run in lost:
        error[run, len(time_s) // 2 :] = np.nan
        for array in (empty["mean"], empty["std"], empty["rms"], empty["anees"]):
            array[run] *= 1e6
    return FilterResult(empty, error, sigma, nees / 2, nees)


def _all_nan(result: FilterResult) -> FilterResult:
    summary = {
        name: np.full_like(values, np.nan) if values.dtype.kind == "f" else values
        for name, values in result.summary.items()
    }
    nothing = np.full_like(result.error, np.nan)
    return FilterResult(summary, nothing, nothing, nothing[..., 0], nothing[..., 0])


def _with_summary(result: FilterResult, summary: Mapping[str, Array]) -> FilterResult:
    unknown = set(summary) - {spec.name for spec in layout.SUMMARY}
    assert not unknown, unknown
    return FilterResult({**result.summary, **summary}, result.error, result.sigma, result.nis, result.nees)


def _provenance() -> Provenance:
    return Provenance(
        versions={"relnav": "0.1.0", "python": "3.11.7", "numpy": "2.4.6"},
        git_commit="0" * 40,
        git_dirty=0,
        machine={"system": "Linux", "processor": "a processor", "cores": "2"},
        command_line="relnav run campaigns/invented.yaml",
        started=datetime(2025, 11, 22, 4, tzinfo=UTC).isoformat(),
        finished=datetime(2025, 11, 22, 4, 1, tzinfo=UTC).isoformat(),
        wall_time_s=12.3,
    )

"""A small campaign's blocks with made-up numbers that depend on case, run and filter only."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

import h5py
import numpy as np
import pytest

from relnav_sim.measurements.channel import Channel
from relnav_sim.results import layout, seal
from relnav_sim.results.block import BlockResult, Failure, FilterResult
from relnav_sim.results.bound import BoundResult
from relnav_sim.results.campaign_header import CaseHeader, ResultHeader
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.observability import Observability
from relnav_sim.results.pieces import shard_piece
from relnav_sim.results.provenance import Provenance, collect_provenance
from relnav_sim.results.shards import shard_name, write_shard

TIMES = 7
HASH = "feedbeef"
SEED = 2**80 + 1
FILTERS = ("ekf", "alpha_0.5")
BIASES = layout.Columns(
    augmented=("range_bias", "azimuth_bias"),
    augmented_units=("m", "rad"),
    sensors=("radar", "camera"),
    edited=("radar",),
    factor=layout.FACTOR,
    channels=("radar range", "camera elevation"),
)
CHANNELS = {
    "radar": (Channel("range", "m", "range"), Channel("azimuth", "rad", "azimuth", True)),
    "camera": (Channel("elevation", "rad", "elevation", True),),
}


def filter_result(case: int, runs: Sequence[int], name: str) -> FilterResult:
    parts = []
    for run in runs:
        rng = np.random.default_rng([case, run, FILTERS.index(name)])
        arrays = {}
        own = (*layout.AUGMENTED, *layout.BY_SENSOR, *layout.EDITING, *layout.BY_CHANNEL, layout.COVARIANCE)
        for spec in (*layout.FILTER, *own):
            shape = layout.shape(spec, layout.sizes(1, TIMES) | BIASES.lengths)
            numbers = rng.standard_normal(shape) if spec.dtype.startswith("<f") else rng.integers(0, 2, shape)
            arrays[spec.name] = numbers.astype(spec.dtype)
        arrays["nis"][:, 0] = np.nan
        parts.append(arrays)
    arrays = {key: np.concatenate([p[key] for p in parts]) for key in parts[0]}
    one = FilterResult.of_arrays(arrays, BIASES if name == "alpha_0.5" else layout.NO_COLUMNS)
    # The alpha filter reports no `rejected` in runs from 3 on, as one whose blocks had no measurement would.
    numbers = {key: np.array([10.0 * case + run + len(key) for run in runs]) for key in ("rejected", "ess")}
    numbers["ess" if name == "ekf" else "rejected"][[name == "ekf" or run >= 3 for run in runs]] = np.nan
    return replace(one, diagnostics={key: row for key, row in numbers.items() if not np.isnan(row).all()})


def block(case: int, runs: Sequence[int], filters: Sequence[str] = FILTERS, shared: bool = False) -> BlockResult:
    owners = [-1] if shared else runs
    relative = [np.random.default_rng([case, run + 1, 99]).standard_normal((TIMES, 6)) for run in owners]
    failures = tuple(
        Failure(run, name, 10 * run + 3, "covariance not positive definite")
        for run in runs
        for name in filters
        if (case, run, name) == (0, 2, "ekf")
    )
    return BlockResult(
        case_index=case,
        case_id=f"id{case}",
        runs=tuple(runs),
        time_s=10.0 * np.arange(TIMES),
        relative=np.array(relative),
        filters={name: filter_result(case, runs, name) for name in filters},
        failures=failures,
        shared_truth=shared,
    )


def filter_ids(names: Iterable[str]) -> dict[str, str]:
    """Return made-up hashes of the filters' settings."""
    return {name: f"settings of {name}" for name in names}


def bound(case: int, filters: Sequence[str] = FILTERS) -> BoundResult:
    """Return made-up bounds of a case, whose alpha filter goes by some of the sensors."""
    numbers = {name: np.random.default_rng([case, len(name)]).uniform(size=(TIMES, 8)) for name in ("", *filters)}
    perfect = numbers.pop("")
    some = {name: numbers[name] / 2 for name in filters if name != "ekf"}
    seen = {name: observability(case, name) for name in filters}
    return BoundResult(SEED, f"id{case}", filter_ids(filters), perfect, numbers, some, seen)


def observability(case: int, name: str) -> Observability:
    """Return what the readings are made up to tell a filter."""
    rng = np.random.default_rng([case, len(name), 7])
    states = (*layout.COMPONENTS, *(() if name == "ekf" else ("range_bias",)))
    numbers = rng.uniform(size=TIMES), rng.uniform(size=len(states)), rng.uniform(size=len(states))
    course = ((10.0, "2 of 6 directions"), (30.0, "normal position"))
    return Observability(
        ("camera", "radar"), numbers[0], states, *numbers[1:], len(name) % 2, "normal position", course
    )


def header(runs: int = 5, cases: int = 2, filters: Sequence[str] = FILTERS) -> ResultHeader:
    return ResultHeader(
        campaign_name="trial <script>",
        text="name: trial  # Größe in m\n" + "# " * 50_000,
        content={"clock": {"step_s": 0.2}, "name": "trial"},
        hash=HASH,
        seed=SEED,
        runs=runs,
        cases=tuple(
            CaseHeader(
                f"id{i}",
                f"scale={i + 1}",
                {"sensors.radar.scale": i + 1},
                tuple(filters),
                filter_ids(filters),
                CHANNELS,
            )
            for i in range(cases)
        ),
        constants={"mu_m3_s2": 3.986004418e14, "truth_zonals": 4},
    )


def provenance() -> Provenance:
    start = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
    return collect_provenance(start, start, 12.5, ["/somewhere/bin/relnav", "run", "my campaign.yaml"])


def write_blocks(folder: Path, blocks: Sequence[BlockResult]) -> list[Path]:
    folder.mkdir(exist_ok=True)
    paths = [folder / shard_name(SEED, b.case_id, filter_ids(b.filters), b.runs) for b in blocks]
    for path, one in zip(paths, blocks, strict=True):
        write_shard(path, one, SEED, filter_ids(one.filters))
    return paths


class MakeBlock(Protocol):
    def __call__(
        self, case: int, runs: Sequence[int], filters: Sequence[str] = FILTERS, shared: bool = False
    ) -> BlockResult: ...


class MakeBound(Protocol):
    def __call__(self, case: int, filters: Sequence[str] = FILTERS) -> BoundResult: ...


class MakeHeader(Protocol):
    def __call__(self, runs: int = 5, cases: int = 2, filters: Sequence[str] = FILTERS) -> ResultHeader: ...


class WriteBlocks(Protocol):
    def __call__(self, folder: Path, blocks: Sequence[BlockResult]) -> list[Path]: ...


@pytest.fixture(scope="session")
def make_block() -> MakeBlock:
    return block


@pytest.fixture(scope="session")
def make_bound() -> MakeBound:
    return bound


@pytest.fixture(scope="session")
def make_header() -> MakeHeader:
    return header


@pytest.fixture(scope="session")
def write() -> WriteBlocks:
    return write_blocks


@pytest.fixture(scope="session")
def facts() -> Provenance:
    return provenance()


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished result of 2 cases, 2 filters and 5 runs; the first case has bounds."""
    folder = tmp_path_factory.mktemp("result")
    shards = write_blocks(folder / "shards", [block(case, runs) for case in (0, 1) for runs in ([0, 1, 2], [3, 4])])
    pieces = [shard_piece(path) for path in shards]
    merge_pieces(pieces, header(), provenance(), folder / "trial.h5", bounds=[bound(0)])
    return folder / "trial.h5"


@pytest.fixture(scope="session")
def old_result(result: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same result as relnav wrote it before 0.1.1, without a checksum; what others make by hand has none either."""
    path = tmp_path_factory.mktemp("old") / "trial.h5"
    path.write_bytes(result.read_bytes())
    with h5py.File(path, "r+") as file:
        del file.attrs[seal.ATTRIBUTE]
    return path

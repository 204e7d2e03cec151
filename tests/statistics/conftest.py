"""Made-up estimates whose errors match their covariances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pytest
from numpy.typing import NDArray

from relnav_sim.results.block import FilterResult
from relnav_sim.statistics.errors import ErrorAccumulator, ScoringRules

Array = NDArray[np.float64]


@dataclass
class Estimates:
    """Epochs 1, 2, ... of some runs."""

    error: Array
    covariance: Array
    nis: Array
    log_likelihood: Array

    def part(self, runs: slice | list[int], epochs: slice = slice(None)) -> Estimates:
        return Estimates(*(getattr(self, name)[runs][:, epochs] for name in self.__dataclass_fields__))


class Draw(Protocol):
    def __call__(self, runs: int, epochs: int, seed: int = 0) -> Estimates: ...


def draw(runs: int, epochs: int, seed: int = 0) -> Estimates:
    """Errors drawn from their covariances, at the scales of a tracking filter; every third epoch unmeasured."""
    rng = np.random.default_rng(seed)
    mix = rng.standard_normal((runs, epochs, 6, 9)) * np.array([3, 1, 2, 0.02, 0.01, 0.03])[:, None]
    covariance = mix @ mix.swapaxes(-1, -2)
    error = (np.linalg.cholesky(covariance) @ rng.standard_normal((runs, epochs, 6, 1)))[..., 0]
    nis = rng.chisquare(3, (runs, epochs))
    nis[:, 2::3] = np.nan
    return Estimates(error, covariance, nis, np.where(np.isnan(nis), 0.0, -nis / 2))


def accumulate(estimates: Estimates, rules: ScoringRules, chunk: int = 64) -> ErrorAccumulator:
    runs, epochs = estimates.nis.shape
    accumulator = ErrorAccumulator(runs, rules)
    for start in range(0, epochs, chunk):
        part = estimates.part(slice(None), slice(start, start + chunk))
        times = rules.step_s * (1 + start + np.arange(part.nis.shape[1]))
        extras = {"rejected": np.where(np.isnan(part.nis), np.nan, part.nis > 5), "nis": part.nis}
        accumulator.add(times, part.error, part.covariance, part.nis, part.log_likelihood, extras)
    return accumulator


class Accumulate(Protocol):
    def __call__(self, estimates: Estimates, rules: ScoringRules, chunk: int = 64) -> ErrorAccumulator: ...


@pytest.fixture
def draw_estimates() -> Draw:
    return draw


@pytest.fixture
def accumulated() -> Accumulate:
    return accumulate


@pytest.fixture
def same_bits():
    def check(a: FilterResult, b: FilterResult) -> None:
        for (name, left), right in zip(a.arrays().items(), b.arrays().values(), strict=True):
            assert left.tobytes() == right.tobytes(), name
        assert a.diagnostics.keys() == b.diagnostics.keys()
        for name, left in a.diagnostics.items():
            assert left.tobytes() == b.diagnostics[name].tobytes(), name

    return check

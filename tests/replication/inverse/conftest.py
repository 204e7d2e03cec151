"""A paper whose posterior is known: each number is an unknown, linear in it, with normal noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from relnav_sim.arrays import Array
from replication.inverse.prior import Unknown, choice, uniform
from replication.inverse.table import Number

SIGMA = 0.1


class Linear:
    """Two unknowns and a choice; a column of three numbers for each unknown, one of which sees the other too."""

    name = "linear"
    block = 100
    outcomes: Sequence[str] = ()
    tables: Mapping[str, Linear] = {}
    unknowns: Sequence[Unknown] = (
        Unknown("a", "m", "first", uniform(0, 10)),
        Unknown("b", "m", "second", uniform(0, 10)),
        Unknown("kind", "", "of both", choice((1, 1)), choices=("plain", "shifted"), divides=True),
    )
    numbers: Sequence[Number] = tuple(
        Number("table_1", column, f"row {row}", "m", signed=True) for column in ("one", "two") for row in range(3)
    )
    printed = np.array([0.5, 0.5, 0.5, 0.7, 0.7, 0.7])
    groups = ((np.array([3, 4]), np.array([1])),)
    acting = np.arange(3)

    def effective(self, u: Array) -> Array:
        """Return the uniform numbers as they are."""
        return u

    def apart(self, u: Array) -> Array:
        """Return the settings as they are: b is shared by nothing."""
        return u

    def flown(self, u: Array, seeds: Sequence[Sequence[int]], runs: int) -> Array:
        """Return (n, runs, 6): a thrice, then b, b and a."""
        clean = np.stack([u[:, 0], u[:, 0], u[:, 0], u[:, 1], u[:, 1], u[:, 0]], axis=1) + 3.0 * (u[:, 2:] >= 0.5)
        noise = np.stack([np.random.default_rng(list(seed)).normal(0, SIGMA, (runs, 6)) for seed in seeds])
        return clean[:, None] + noise

    def banked(self, u: Array, seeds: Sequence[Sequence[int]]) -> Array:
        """Return the numbers of one run."""
        return self.flown(u, seeds, 1)[:, 0]


@pytest.fixture
def linear() -> Linear:
    """Return the paper."""
    return Linear()

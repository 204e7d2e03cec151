"""How badly a setting gives printed numbers: -2 log likelihood under a Student t about the mean over its runs.

All settings fly with the same noise, so that two of them differ by what they are, and numbers are smooth functions of
the settings nearly everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from replication.inverse.bank import Paper
from replication.inverse.table import Number, compared

RUNS = 4
FREEDOM = 4.0
"""Degrees of freedom of the Student t by which residuals count: a number that can't be met must not decide the rest."""
MODEL = 0.03
"""What a number may be off by short flights and long steps, on the scale on which numbers are compared."""
FAILED = 1e3
"""Misfit of a number that a setting can't give: its filter has diverged."""


@dataclass(frozen=True)
class Looked:
    """Numbers of settings on the scale on which they are compared.

    Attributes:
        off: Printed less mean, (n, numbers).
        sigma: Standard deviation of a printed number about that mean, (n, numbers).
    """

    off: Array
    sigma: Array

    @property
    def misfit(self) -> Array:
        """-2 log likelihood of each number, (n, numbers)."""
        each = distance(self.off / self.sigma) + 2 * np.log(self.sigma)
        return np.where(np.isfinite(each), each, FAILED)


def looked(numbers: Sequence[Number], flown: Array, printed: Array) -> Looked:
    """Return how settings that gave these numbers (n, runs, numbers) look beside the printed ones."""
    scale = compared(flown, numbers)
    digits = np.array([number.digit for number in numbers])
    rounding = (compared(printed + digits / 2, numbers) - compared(printed - digits / 2, numbers)) / np.sqrt(12)
    sigma = np.sqrt(scale.var(axis=1, ddof=1) * (1 + 1 / flown.shape[1]) + rounding**2 + MODEL**2)
    return Looked(compared(printed, numbers) - scale.mean(axis=1), sigma)


def distance(residual: Array) -> Array:
    """Return what residuals in units of scatter count for: squares as long as they are small."""
    return np.asarray((FREEDOM + 1) * np.log1p(residual**2 / FREEDOM))


@dataclass(frozen=True)
class Place:
    """A setting and how badly it gives each number.

    Attributes:
        u: Its uniform numbers, (unknowns,).
        misfit: That of each number, (numbers,).
    """

    u: Array
    misfit: Array

    @property
    def total(self) -> float:
        """The sum of the misfits."""
        return float(self.misfit.sum())


class Sought:
    """What settings are compared with, and how the search for them has gone.

    Args:
        paper: Whose numbers they are.
        printed: The numbers, (numbers,).
        seed: Seed of the noise of all flights.

    Attributes:
        flown: Settings flown.
        best: The best of them; there is none before the first flight.
        history: Settings flown and the least misfit until then, whenever that fell.
    """

    def __init__(self, paper: Paper, printed: Array, seed: int) -> None:
        self.paper, self.printed, self.seed = paper, printed, seed
        self.flown = 0
        self.history: list[tuple[int, float]] = []
        self.best: Place

    def look(self, u: Array) -> Looked:
        """Fly settings (n, unknowns) and return what they give."""
        seen = looked(self.paper.numbers, self.paper.flown(u, [[self.seed, 2]] * len(u), RUNS), self.printed)
        for row, misfit in zip(u, seen.misfit, strict=True):
            self.flown += 1
            if not self.history or misfit.sum() < self.best.total:
                self.best = Place(row.copy(), misfit)
                self.history.append((self.flown, self.best.total))
        return seen

    def least(self, flown: int) -> float:
        """Return the least misfit of the first so many settings flown."""
        return [misfit for at, misfit in self.history if at <= flown][-1]

    def places(self, u: Array) -> list[Place]:
        """Fly settings (n, unknowns) and return them, the best first."""
        misfit = self.look(u).misfit
        return [Place(u[row], misfit[row]) for row in np.argsort(misfit.sum(axis=1), kind="stable")]

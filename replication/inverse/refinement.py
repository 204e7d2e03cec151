"""The setting that comes nearest to a paper's printed numbers: from many starts of the bank, the worse half dropped.

Dropping the worse half after each round leaves most flights to the starts that promise most (Jamieson and Talwalkar,
AISTATS 2016). A round moves single unknowns across their range (`moves`), and then steps downhill (`scoring`). Further
batches of starts follow until one leads no further.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from relnav_sim.arrays import Array, Indices
from replication.inverse.bank import Bank, Paper, of_table
from replication.inverse.misfit import Place, Sought, distance
from replication.inverse.moves import common_moved, own_moved
from replication.inverse.scoring import scored
from replication.inverse.table import compared, rounded

FLOWN, STARTS, MATCHED = 60, 16, 0.3
"""Settings of the bank that are flown again in a batch, how many of them start, and the share of the groups of numbers
by which they are chosen: those that a setting gives best, as what acts on the others alone may yet be changed."""
STEPS, LAST_STEPS = 3, 8
"""Steps in a round, and in one that at most two starts have reached."""
ENOUGH = 0.3
"""What a step or a round has to lower the misfit by, -2 log likelihood, for another."""
FLAT = 0.01
"""Share of the whole fall of the misfit that a batch of starts has to bring for another."""
CHECK_RUNS, HONEST = 40, 50
"""Runs of the best setting, and honest papers that its distance is compared with."""
ALL = "all tables"


@dataclass(frozen=True)
class Fit:
    """A setting and how well it gives the printed numbers.

    Attributes:
        u: Its uniform numbers, (unknowns,).
        mean: Mean of each number over runs, (numbers,).
        scatter: Standard deviation of a single run, (numbers,).
        residual: Printed less mean, in units of the scatter and of the last digit's rounding together, (numbers,).
        flown: Settings flown.
        misfit: The least of the settings of the bank, after three quarters of all flights, and in the end.
    """

    u: Array
    mean: Array
    scatter: Array
    residual: Array
    flown: int
    misfit: tuple[float, float, float]

    @property
    def distance(self) -> float:
        """How far the printed numbers are from the setting's in all: squares of residuals, large ones counting less."""
        return float(distance(self.residual).sum())


def best_fits(
    paper: Paper,
    bank: Bank,
    printed: Array,
    batches: int,
    seed: int,
    say: Callable[[str], None],
    tables: Sequence[str],
    until: Mapping[str, float] = MappingProxyType({}),
) -> dict[str, Fit]:
    """Return the best setting for all tables, and for some tables alone.

    The search for all also starts from those for each, and these are searched on from that for all.

    Arguments are those of `best_fit`, `until` by the name of the table.
    """
    sought = {name: Sought(paper.tables[name], printed[places_of(paper, name)], seed) for name in tables}
    alone = {
        name: _searched(own, of_table(bank, paper, own.paper), batches, say, (), until.get(name))
        for name, own in sought.items()
    }
    joint = best_fit(paper, bank, printed, batches, seed, say, [fit.u for fit in alone.values()], until.get(ALL))
    for name, own in sought.items():
        if name not in until or alone[name].distance > until[name]:
            alone[name] = _halved(own, own.places(joint.u[None]), until.get(name))
    return {ALL: joint} | alone


def places_of(paper: Paper, name: str) -> Indices:
    """Return which of a paper's numbers stand in a table, by its name; all of them for another name."""
    of = paper.tables.get(name, paper).numbers
    return np.array([paper.numbers.index(number) for number in of])


def best_fit(
    paper: Paper,
    bank: Bank,
    printed: Array,
    batches: int,
    seed: int,
    say: Callable[[str], None],
    known: Sequence[Array] = (),
    until: float | None = None,
) -> Fit:
    """Return the setting that fits best.

    Args:
        paper: The paper.
        bank: Where the search starts.
        printed: The printed numbers, (numbers,).
        batches: How many batches of starts there are at most.
        seed: Seed of the noise.
        say: Told how far it is.
        known: Settings that start besides: those that fit a part of the numbers.
        until: The distance, `Fit.distance`, at which the search ends early.
    """
    return _searched(Sought(paper, printed, seed), bank, batches, say, known, until)


def _searched(
    sought: Sought,
    bank: Bank,
    batches: int,
    say: Callable[[str], None],
    known: Sequence[Array],
    until: float | None,
) -> Fit:
    paper, printed = sought.paper, sought.printed
    order = _by_groups(paper, bank, printed)
    starts = sought.places(np.array(known)) if len(known) else []
    for first in range(0, min(batches * FLOWN, len(order)), FLOWN):
        before = sought.best.total if sought.history else np.inf
        flown = sought.places(paper.apart(paper.effective(bank.u[order[first : first + FLOWN]])))
        starts += _least([own_moved(sought, place) for place in flown])[:STARTS]
        fit = _halved(sought, starts, until)
        say(f"{paper.name}: {len(printed)} numbers, {fit.flown} settings flown, misfit {fit.misfit[-1]:.1f}")
        reached = until is not None and fit.distance <= until
        if reached or before - sought.best.total < FLAT * (fit.misfit[0] - fit.misfit[-1]):
            break
        starts = []
    return fit


def _halved(sought: Sought, places: Sequence[Place], until: float | None) -> Fit:
    """Return the best setting so far after rounds that each drop the worse half of the places."""
    while True:
        steps = STEPS if len(places) > 2 else LAST_STEPS
        before, better = places[0].total, list[Place]()
        for place in places:
            better.append(scored(sought, common_moved(sought, own_moved(sought, place)), steps, ENOUGH))
            if until is not None and better[-1] is _least(better)[0]:
                fit = _fit(sought)
                if fit.distance <= until:
                    return fit
        places = _least(better)
        if len(places) == 1 and before - places[0].total < ENOUGH:
            return _fit(sought)
        places = places[: max(1, len(places) // 2)]


def _fit(sought: Sought) -> Fit:
    paper, u = sought.paper, sought.best.u
    numbers = paper.flown(u[None], [[sought.seed, 4]], CHECK_RUNS)[0]
    misfit = sought.least(FLOWN), sought.least(sought.flown * 3 // 4), sought.best.total
    return Fit(u, *beside(paper, numbers, sought.printed), sought.flown, misfit)


def beside(paper: Paper, numbers: Array, printed: Array) -> tuple[Array, Array, Array]:
    """Return mean, scatter and residual as `Fit` has them, from the numbers of a setting's runs (runs, numbers)."""
    mean, scatter = numbers.mean(axis=0), numbers.std(axis=0, ddof=1)
    digits = np.array([number.digit for number in paper.numbers])
    sigma = np.sqrt(scatter**2 * (1 + 1 / len(numbers)) + digits**2 / 12)
    return mean, scatter, (printed - mean) / sigma


def honest_residuals(paper: Paper, bank: Bank, printed: Array, count: int, seed: int) -> Array:
    """Return the residuals of synthetic papers against runs of their own settings, (count, numbers).

    Those are the bank's settings whose numbers are nearest to the printed ones: what a paper would have whose setting
    is known.
    """
    u = bank.u[nearest(paper, bank, printed)[:count]]
    flown = paper.flown(u, [[seed, 8, row] for row in range(count)], CHECK_RUNS + 1)
    prints = rounded(flown[:, 0], paper.numbers)
    return np.stack([beside(paper, own[1:], own_print)[2] for own, own_print in zip(flown, prints, strict=True)])


def nearest(paper: Paper, bank: Bank, printed: Array) -> Indices:
    """Return the bank's settings in the order of their distance to the printed numbers."""
    return np.argsort(_off(paper, bank, printed).sum(axis=1), kind="stable")


def _by_groups(paper: Paper, bank: Bank, printed: Array) -> Indices:
    """Return the bank's settings in the order of their distance to the groups of numbers that each gives best."""
    if not paper.groups:
        return nearest(paper, bank, printed)
    off = _off(paper, bank, printed)
    each = np.sort(np.stack([off[:, numbers].mean(axis=1) for numbers, _ in paper.groups], axis=1), axis=1)
    return np.argsort(each[:, : int(np.ceil(MATCHED * each.shape[1]))].sum(axis=1), kind="stable")


def _off(paper: Paper, bank: Bank, printed: Array) -> Array:
    """Return how far each number of the bank's settings is from the printed one, (settings, numbers)."""
    return np.abs(compared(bank.numbers, paper.numbers) - compared(printed, paper.numbers))


def _least(places: Sequence[Place]) -> list[Place]:
    return sorted(places, key=lambda place: place.total)

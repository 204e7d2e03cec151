"""The setting that comes nearest to a paper's printed numbers: from many starts of the bank, by `descent`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from relnav_sim.arrays import Array, Indices
from replication.inverse.bank import Bank, Paper
from replication.inverse.descent import Place, Sought, shuffled, stepped, swept
from replication.inverse.table import compared

NEAREST, STARTS, FINALISTS, FURTHER = 100, 16, 2, 2
"""Settings of the bank that are flown again, how many of them take steps, and how many are followed to the end.

The last is how many more are followed where the search for one table goes on.
"""
SHUFFLES = 3
"""Times the turns: how often several unknowns are moved at once in the end."""
CHECK_RUNS = 40
ENOUGH = 1.0
"""A turn that lowers the misfit, -2 log likelihood, by less is the last."""


@dataclass(frozen=True)
class Fit:
    """A setting and how well it gives the printed numbers.

    Attributes:
        u: Its uniform numbers, (unknowns,).
        mean: Mean of each number over runs, (numbers,).
        scatter: Standard deviation of a single run, (numbers,).
        residual: Printed less mean, in units of the scatter and of the last digit's rounding together, (numbers,).
        history: Settings flown, and the least misfit until then, turn by turn.
    """

    u: Array
    mean: Array
    scatter: Array
    residual: Array
    history: list[tuple[int, float]]


def best_fit(
    paper: Paper,
    bank: Bank,
    printed: Array,
    turns: int,
    seed: int,
    say: Callable[[str], None],
    known: Sequence[Array] = (),
) -> Fit:
    """Return the setting that fits best.

    Args:
        paper: The paper.
        bank: Where the search starts: the settings whose numbers are nearest.
        printed: The printed numbers, (numbers,).
        turns: How many times a setting is improved at most.
        seed: Seed of the noise.
        say: Told how far it is.
        known: Settings that are followed to the end besides: those that fit a part of the numbers.
    """
    sought = Sought(paper, printed, seed)
    starts = _starts(sought, bank)
    flown = min(NEAREST, len(bank.u)) + sum(place.flown for place in starts)
    places = [_followed(sought, place, turns) for place in starts[:FINALISTS] + [sought.at(u) for u in known]]
    history = [(flown, starts[0].total)]
    for path in places:
        history += [(flown + place.flown, min(place.total, history[-1][1])) for place in path]
        flown += path[-1].flown
        say(f"{paper.name}: {len(paper.numbers)} numbers, {flown} settings flown, misfit {path[-1].total:.1f}")
    best = min((path[-1] for path in places), key=lambda place: place.total)
    return _searched_on(sought, best, history, turns, say)


def continued(
    fit: Fit,
    paper: Paper,
    bank: Bank,
    printed: Array,
    turns: int,
    seed: int,
    say: Callable[[str], None],
    known: Sequence[Array],
) -> Fit:
    """Return a fit, or a better one to which other starts lead: the bank's next best, and known settings."""
    sought = Sought(paper, printed, seed)
    others = _starts(sought, bank)[FINALISTS : FINALISTS + FURTHER] + [sought.at(u) for u in known]
    paths = [_followed(sought, place, turns) for place in others]
    history = [*fit.history]
    for path in paths:
        flown, least = history[-1]
        history += [(flown + place.flown, min(place.total, least)) for place in path]
    best = min((path[-1] for path in paths), key=lambda place: place.total)
    if best.total < fit.history[-1][1]:
        return _searched_on(sought, best, history, turns, say)
    return replace(fit, history=history)


def _followed(sought: Sought, start: Place, turns: int) -> list[Place]:
    """Return the places to which turns of a step and a sweep lead, the number of settings flown counted from here."""
    path = [Place(start.u, start.misfit, 0)]
    for _ in range(turns):
        path.append(swept(sought, stepped(sought, path[-1])))
        if path[-2].total - path[-1].total < ENOUGH:
            break
    return path


def _searched_on(
    sought: Sought, best: Place, history: Sequence[tuple[int, float]], turns: int, say: Callable[[str], None]
) -> Fit:
    """Return the best setting after further turns in which several unknowns are moved at once, anywhere."""
    rng = np.random.default_rng([sought.seed, 3])
    flown = history[-1][0]
    here, history = Place(best.u, best.misfit, flown), list(history)
    for _ in range(SHUFFLES * turns):
        moved = shuffled(sought, here, rng)
        here = stepped(sought, moved) if moved.total < here.total else moved
        history.append((here.flown, here.total))
    paper, printed = sought.paper, sought.printed
    say(f"{paper.name}: {len(paper.numbers)} numbers, {here.flown} settings flown, misfit {here.total:.1f} in the end")
    mean, scatter, residual = beside(paper, paper.flown(here.u[None], [[sought.seed, 4]], CHECK_RUNS)[0], printed)
    return Fit(here.u, mean, scatter, residual, history)


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
    digits = np.array([number.digit for number in paper.numbers])
    prints = np.round(flown[:, 0] / digits) * digits
    return np.stack([beside(paper, own[1:], own_print)[2] for own, own_print in zip(flown, prints, strict=True)])


def nearest(paper: Paper, bank: Bank, printed: Array) -> Indices:
    """Return the bank's settings in the order of their distance to the printed numbers."""
    off = np.abs(compared(bank.numbers, paper.numbers) - compared(printed, paper.numbers)).sum(axis=1)
    return np.argsort(off, kind="stable")


def _starts(sought: Sought, bank: Bank) -> list[Place]:
    """Return the best settings of the bank after a step each, the best first."""
    paper = sought.paper
    u = paper.apart(paper.effective(bank.u)[nearest(paper, bank, sought.printed)[:NEAREST]])
    misfit = sought.flown(u).misfit
    best = np.argsort(misfit.sum(axis=1), kind="stable")[:STARTS]
    stepping = [stepped(sought, Place(u[row], misfit[row], 0)) for row in best]
    return sorted(stepping, key=lambda place: place.total)

"""The search on papers whose settings are known: it must reach a paper that relnav has made, and not a forged one.

Half of the papers are settings of the bank near the printed numbers, half are any of its prior; the bank that the
search starts from has lost them. A paper is one run, rounded as the printed one. A search ends when it has reached the
distance that 95 % of honest papers have from their own setting: it would only come nearer. Of the forged one, the table
with the forged column and all tables are searched.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from replication.inverse.bank import Bank, Paper
from replication.inverse.misfit import distance
from replication.inverse.refinement import ALL, HONEST, best_fits, honest_residuals, nearest, places_of
from replication.inverse.table import rounded

EACH = 2
"""Papers near the printed one, and any of the prior."""
FACTOR = 2.0
"""What a forged column is multiplied by."""


@dataclass(frozen=True)
class Known:
    """A paper whose setting is known.

    Attributes:
        near: Whether its setting is near the printed numbers.
        forged: Table and column of it that are forged, "" for none.
        printed: Its numbers, (numbers,).
    """

    near: bool
    forged: str
    printed: Array


def searched(paper: Paper, bank: Bank, batches: int, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """Return for each synthetic paper how near the search has come to each of its tables and to all.

    Args:
        paper: The paper whose tables they have.
        bank: Its bank.
        batches: Batches of starts of a search.
        say: Told how far it is.
    """
    near = nearest(paper, bank, paper.printed)[:EACH]
    rows = np.concatenate([near, np.setdiff1d(np.arange(2 * EACH), near)[:EACH]])
    rest = replace(bank, u=np.delete(bank.u, rows, axis=0), numbers=np.delete(bank.numbers, rows, axis=0))
    found = []
    for known in papers_of(paper, bank.u[rows], bank.seed):
        say(f"{paper.name}: searching {'a forged' if known.forged else 'an honest'} synthetic paper")
        honest = distance(honest_residuals(paper, rest, known.printed, HONEST, bank.seed))
        ends = {
            name: np.quantile(honest[:, places_of(paper, name)].sum(axis=1), (0.5, 0.95))
            for name in (ALL, *paper.tables)
        }
        until = {name: float(end[1]) for name, end in ends.items()}
        tables = [name for name in paper.tables if known.forged.startswith(name)] or list(paper.tables)
        fits = best_fits(paper, rest, known.printed, batches, bank.seed, say, tables, until)
        reached = {name: {"distance": fit.distance, "honest": ends[name].tolist()} for name, fit in fits.items()}
        found.append({"near": known.near, "forged": known.forged, "tables": reached})
    return found


def papers_of(paper: Paper, u: Array, seed: int) -> Iterator[Known]:
    """Yield a paper of each setting (2 `EACH`, unknowns), and then the first with its first column forged."""
    seeds = [[seed, 10, row] for row in range(len(u))]
    printed = rounded(paper.flown(u, seeds, 1)[:, 0], paper.numbers)
    for row, own in enumerate(printed):
        yield Known(row < EACH, "", own)
    first = paper.numbers[0]
    column = np.array([(each.table, each.column) == (first.table, first.column) for each in paper.numbers])
    own = np.where(column, FACTOR * printed[0], printed[0])
    yield Known(True, f"{first.table} {first.column}", rounded(own, paper.numbers))

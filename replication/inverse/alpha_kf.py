"""Shi et al. (2025) as a paper whose numbers can be made anew in any setting."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from relnav_sim.arrays import Array, Indices
from replication.inverse.alpha_kf_flight import QUICK, TABLES, Flown, flights
from replication.inverse.alpha_kf_numbers import NUMBERS, numbers, printed
from replication.inverse.alpha_kf_outcomes import OUTCOMES, outcomes
from replication.inverse.alpha_kf_truth import motion
from replication.inverse.alpha_kf_unknowns import COLUMNS, SEEN_BY, UNKNOWNS
from replication.inverse.prior import Unknown, values
from replication.inverse.table import Number
from replication.papers import papers


class AlphaKf:
    """Tables 2, 3 and 4, flown together.

    Args:
        flown_tables: Those of them that are looked at.
    """

    name = "alpha_kf"
    block = 100
    unknowns: Sequence[Unknown] = UNKNOWNS
    outcomes: Sequence[str] = OUTCOMES

    def __init__(self, flown_tables: Sequence[int] = TABLES) -> None:
        self._flown = tuple(flown_tables)
        names = [f"table_{table}" for table in flown_tables]
        self.numbers: Sequence[Number] = tuple(number for number in NUMBERS if number.table in names)

    @property
    def printed(self) -> Array:
        """What the paper prints, (numbers,)."""
        every = printed(papers()[self.name].content)
        return every[[NUMBERS.index(number) for number in self.numbers]]

    @property
    def tables(self) -> Mapping[str, AlphaKf]:
        """Each table as a paper of its own."""
        return {f"table_{table}": AlphaKf((table,)) for table in self._flown}

    def effective(self, u: Array) -> Array:
        """Return uniform numbers (n, unknowns) with the process noise in each column that its filter has."""
        acting = u.copy()
        sharing = values(UNKNOWNS, u)["sharing"]
        place = {unknown.name: k for k, unknown in enumerate(UNKNOWNS)}
        first_column = next(iter(COLUMNS))
        for kind in ("acceleration_psd", "velocity_psd"):
            for column in COLUMNS:
                own, first, base = (place[f"{kind}_{name}"] for name in (column, first_column, f"{column[:-1]}2"))
                acting[:, own] = np.choose(sharing.astype(int), [u[:, first], u[:, base], u[:, own]])
        return acting

    @property
    def acting(self) -> Indices:
        """The unknowns that act on the flown tables where each filter has a process noise of its own."""
        seen = [set(self._flown) & set(SEEN_BY.get(unknown.name, self._flown)) for unknown in UNKNOWNS]
        return np.array([k for k, unknown in enumerate(UNKNOWNS) if seen[k] and unknown.name != "sharing"])

    @property
    def groups(self) -> Sequence[tuple[Indices, Indices]]:
        """The numbers of each filter that may have a process noise of its own, and its two densities."""
        place = {unknown.name: k for k, unknown in enumerate(UNKNOWNS)}
        found = []
        for column in COLUMNS:
            name, _, table = column.rpartition("_")
            numbers = [
                k
                for k, number in enumerate(self.numbers)
                if number.table == f"table_{table}" and (table == "4" or number.column == name)
            ]
            own = [place[f"acceleration_psd_{column}"], place[f"velocity_psd_{column}"]]
            if numbers:
                found.append((np.array(numbers), np.array(own)))
        return found

    def apart(self, u: Array) -> Array:
        """Return settings in which each filter and table has a process noise of its own."""
        moved = u.copy()
        moved[:, [unknown.name for unknown in UNKNOWNS].index("sharing")] = 0.99
        return moved

    def flown(self, u: Array, seeds: Sequence[Sequence[int]], runs: int) -> Array:
        """Return the numbers of single runs, (n, runs, numbers); arguments as for `bank.Paper`."""
        return np.stack([numbers(own, flown, QUICK) for own, flown in self._each(u, seeds, runs)])

    def banked(self, u: Array, seeds: Sequence[Sequence[int]]) -> Array:
        """Return numbers and outcomes of one run, (n, numbers + outcomes)."""
        return np.stack(
            [
                np.concatenate([numbers(own, flown, QUICK)[0], outcomes(flown)[0]])
                for own, flown in self._each(u, seeds, 1)
            ]
        )

    def _each(
        self, u: Array, seeds: Sequence[Sequence[int]], runs: int
    ) -> Iterator[tuple[dict[str, float], dict[int, Flown]]]:
        """Yield the values of each setting and its flights."""
        setting = values(UNKNOWNS, u)
        moved = motion(setting)
        for row, seed in enumerate(seeds):
            own = {name: float(value[row]) for name, value in setting.items()}
            told = moved.mean_motion_rad_s[row], moved.nodes[row], moved.left_out[row]
            yield own, flights(own, *told, np.random.default_rng(list(seed)), runs, QUICK, self._flown)

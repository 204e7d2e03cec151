"""All that a bank says of its paper, in the form that the page of findings is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from replication.inverse.bank import Bank, Paper
from replication.inverse.checks import PAPERS, coverage, power
from replication.inverse.consistency import ColumnCheck, columns_of, p_value_of_paper
from replication.inverse.inference import Inference, features, interval

HELD_OUT = 0.09
"""Share of the bank that nothing is learned from."""


@dataclass(frozen=True)
class Study:
    """What a bank has taught.

    Attributes:
        paper: Its paper.
        bank: The bank.
        taught: Number of its settings that are learned from: the first ones.
        inference: Settings from numbers.
        columns: The check of each column, by name.
    """

    paper: Paper
    bank: Bank
    taught: int
    inference: Inference
    columns: dict[str, ColumnCheck]

    @classmethod
    def of(cls, paper: Paper, bank: Bank, say: Callable[[str], None]) -> Study:
        """Learn from a bank."""
        taught = len(bank.u) - max(int(HELD_OUT * len(bank.u)), 1)
        seen = features(paper, bank.numbers[:taught])
        say(f"{paper.name}: learning settings from numbers")
        inference = Inference.learned(paper, bank.u[:taught], bank.numbers[:taught], bank.seed)
        columns = {}
        for name, places in columns_of(paper.numbers).items():
            say(f"{paper.name}: learning {name} from the other columns")
            columns[name] = ColumnCheck.learned(places, seen, bank.seed)
        return cls(paper, bank, taught, inference, columns)

    def checks(self) -> dict[str, Any]:
        """Return coverage and power on papers held out of the bank."""
        u, numbers = self.bank.u[self.taught :], self.bank.numbers[self.taught :]
        return {
            "coverage": coverage(self.paper, self.inference, u[:PAPERS], numbers[:PAPERS]),
            "forged": power(self.paper, self.columns, numbers),
        }

    def printed(self) -> dict[str, Any]:
        """Return the settings inferred from the printed numbers, and how well their columns go together."""
        seen = features(self.paper, self.paper.printed[None])
        draws = self.inference.posterior(seen[0])
        low, high = interval(draws, 0.90)
        inferred = []
        for place, unknown in enumerate(self.paper.unknowns):
            if unknown.choices:
                drawn = unknown.law(draws[:, place]).astype(int)
                shares = {name: float(np.mean(drawn == k)) for k, name in enumerate(unknown.choices)}
                inferred.append({"name": unknown.name, "unit": "", "choices": shares})
                continue
            ends = unknown.law(np.array([low[place], high[place]]))
            inferred.append({"name": unknown.name, "unit": unknown.unit, "interval": [float(end) for end in ends]})
        pulls = []
        for name, check in self.columns.items():
            off = check.off(seen)[0]
            worst = np.argsort(-np.abs(off))[:3]
            numbers = [self.paper.numbers[check.places[k]].name for k in worst]
            pulls.append(
                {
                    "column": name,
                    "p_value": float(check.p_values(seen)[0]),
                    "furthest": [
                        {"number": n, "deviations": float(off[k])} for n, k in zip(numbers, worst, strict=True)
                    ],
                }
            )
        return {"settings": inferred, "p_value": float(p_value_of_paper(self.columns, seen)[0]), "columns": pulls}

    def summary(self) -> dict[str, Any]:
        """Return what the bank is: its size, its cost, and the spread of each number in it."""
        low, middle, high = np.quantile(self.bank.numbers, (0.05, 0.5, 0.95), axis=0)
        return {
            "campaigns": len(self.bank.u),
            "cpu_hours": round(self.bank.cpu_s / 3600, 3),
            "seed": self.bank.seed,
            "digest": self.bank.digest,
            "unknowns": [{"name": each.name, "unit": each.unit, "words": each.words} for each in self.paper.unknowns],
            "numbers": [
                {"name": number.name, "quantiles": [float(low[k]), float(middle[k]), float(high[k])]}
                for k, number in enumerate(self.paper.numbers)
            ],
        }

"""Results made up for tests of the rules: every campaign, case and filter, with figures the test chooses."""

import numpy as np


class Synthetic:
    """Stands in for `Measured`: figures by a function of campaign, case, filter and column."""

    def __init__(self, figures, runs=20, campaigns=None):
        self._figures, self._runs, self._campaigns = figures, runs, campaigns

    def has(self, campaign, filters=()):
        return self._campaigns is None or campaign in self._campaigns

    def case(self, campaign, wanted):
        return str(sorted((path, repr(value)) for path, value in wanted.items()))

    def runs(self, campaign):
        return tuple(range(self._runs))

    def runs_in_words(self, campaign, *others):
        return f"{self._runs} runs"

    def window(self, campaign, case, whole=False):
        return "whole" if whole else "steady state"

    def values(self, campaign, case, filter, column, runs=None):
        chosen = list(range(self._runs)) if runs is None else list(runs)
        level = self._figures(campaign, str(case), filter, column)
        if level is None:
            return np.full(len(chosen), np.nan)
        # A spread of 1 % that all filters of a run have in common, and 0.1 % of their own.
        own = sum(map(ord, filter + column)) % 97
        return np.array(
            [
                level
                * (1 + 0.01 * np.random.default_rng(run).normal() + 0.001 * np.random.default_rng([run, own]).normal())
                for run in chosen
            ]
        )

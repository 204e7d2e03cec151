"""Is a difference too small to matter? Equivalence of two filters by the interval of their paired difference.

Two one-sided tests (Schuirmann 1987) hold a difference for too small to matter once its whole interval lies inside a
margin. "Not significant" is no such statement: few runs make any difference insignificant. Intervals that hold for all
pairs together (Bonferroni) keep the chance of any wrong verdict of equivalence in a case below that of one interval.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from relnav_sim.statistics.intervals import Interval, Verdict

Effect = Literal["better", "worse", "equivalent", "undecided"]


_TURNED: Mapping[Verdict, Verdict] = {"better": "worse", "worse": "better"}


@dataclass(frozen=True)
class Difference:
    """How much larger one filter's figure is than another's on the same runs.

    Attributes:
        percent: In percent of the other's, with the interval of the test: zero is outside it where that decides.
        verdict: Of the test against no difference, adjusted for all pairs of the case.
        simultaneous: The same difference with an interval that holds for all pairs of the case together.
    """

    percent: Interval
    verdict: Verdict
    simultaneous: Interval

    def effect(self, margin_percent: float) -> Effect:
        """Return what follows with a margin: equivalent, whether or not significant, if the whole interval is inside.

        Example:
            >>> from relnav_sim.statistics.intervals import Interval
            >>> small = Interval(0.2, 0.1, 0.3, 0.95, 20)
            >>> Difference(small, "worse", small).effect(1.0)
            'equivalent'
            >>> wide = Interval(0.2, -1.6, 2.0, 0.95, 20)
            >>> Difference(wide, "undecided", wide).effect(1.0)
            'undecided'
        """
        if -margin_percent < self.simultaneous.low and self.simultaneous.high < margin_percent:
            return "equivalent"
        return self.verdict

    def turned(self) -> Difference:
        """Return the difference the other way round: a is p percent above b, so b is p / (1 + p / 100) below a."""
        verdict = _TURNED.get(self.verdict, self.verdict)
        return Difference(_turned(self.percent), verdict, _turned(self.simultaneous))

    def runs_to_decide(self, margin_percent: float) -> int | None:
        """Return about how many runs an undecided difference needs; None where that is not known.

        A difference of the size seen is to be told from none where it matters, and else to be shown inside the margin:
        the interval shrinks with the square root of the runs.
        """
        estimate = abs(self.simultaneous.estimate)
        half = (self.simultaneous.high - self.simultaneous.low) / 2
        room = estimate if estimate >= margin_percent else margin_percent - estimate
        if not (math.isfinite(half) and math.isfinite(room)) or room <= 0:
            return None
        needed = self.simultaneous.runs * (half / room) ** 2
        return math.ceil(needed) if math.isfinite(needed) else None


def _turned(one: Interval) -> Interval:
    low, estimate, high = (
        -value / (1 + value / 100) if value > -100 else math.nan for value in (one.high, one.estimate, one.low)
    )
    return replace(one, estimate=estimate, low=low, high=high)

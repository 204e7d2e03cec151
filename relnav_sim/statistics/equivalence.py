"""Is a difference too small to matter? Equivalence of two filters by the interval of their paired difference.

Two one-sided tests (Schuirmann 1987) hold a difference for too small to matter once its whole interval lies inside a
margin. "Not significant" is no such claim: few runs make every difference insignificant. Intervals that hold for all
pairs together (Bonferroni) keep the chance of any wrong claim of equivalence in a case below that of one interval.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from relnav_sim.statistics.intervals import Interval, Verdict

Effect = Literal["better", "worse", "equivalent", "undecided"]


@dataclass(frozen=True)
class Difference:
    """How much larger one filter's figure is than another's on the same runs.

    Attributes:
        percent: In percent of the other's, with an interval that holds for all pairs of the case together.
        verdict: Of the test against no difference, adjusted for all pairs of the case.
    """

    percent: Interval
    verdict: Verdict

    def effect(self, margin_percent: float) -> Effect:
        """Return what follows with a margin: equivalent, whether or not significant, if the whole interval is inside.

        Example:
            >>> from relnav_sim.statistics.intervals import Interval
            >>> Difference(Interval(0.2, 0.1, 0.3, 0.95, 20), "worse").effect(1.0)
            'equivalent'
            >>> Difference(Interval(0.2, -1.6, 2.0, 0.95, 20), "undecided").effect(1.0)
            'undecided'
        """
        if -margin_percent < self.percent.low and self.percent.high < margin_percent:
            return "equivalent"
        return self.verdict

    def runs_to_decide(self, margin_percent: float) -> int | None:
        """Return about how many runs an undecided difference needs; None where that is not known.

        A difference of the size seen is to be told from none where it matters, and else to be shown inside the margin:
        the interval shrinks with the square root of the runs.
        """
        estimate = abs(self.percent.estimate)
        half = (self.percent.high - self.percent.low) / 2
        room = estimate if estimate >= margin_percent else margin_percent - estimate
        if not (math.isfinite(half) and math.isfinite(room)) or room <= 0:
            return None
        needed = self.percent.runs * (half / room) ** 2
        return math.ceil(needed) if math.isfinite(needed) else None

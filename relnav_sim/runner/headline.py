"""The figure of each run that is shown while a campaign runs: rms of the position error after the settling time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from relnav_sim.results import layout
from relnav_sim.results.block import BlockResult

_R = layout.QUANTITIES.index("r")
_WHOLE, _SETTLED = (layout.SPANS.index(span) for span in ("whole", "settled"))

Figures = Mapping[str, Mapping[int, float]]
"""By filter and run, m."""


def headline_figures(block: BlockResult) -> Figures:
    """Return the figure of every run that did not fail; over the whole run where it ends before it has settled."""
    found = {}
    for name, result in block.filters.items():
        rms, sound = np.asarray(result.summary["rms"]), np.asarray(result.summary["failed"]) == 0
        settled = rms[:, _SETTLED, _R]
        figures = np.where(np.isnan(settled), rms[:, _WHOLE, _R], settled)
        found[name] = {run: float(figures[i]) for i, run in enumerate(block.runs) if sound[i]}
    return found

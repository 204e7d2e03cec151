"""The relative dynamics that a campaign can name."""

from __future__ import annotations

from relnav_sim.models.cw import CwOptions
from relnav_sim.options import Options

_KINDS: dict[str, type[Options]] = {"cw": CwOptions}


def dynamics_kinds() -> dict[str, type[Options]]:
    """Return the options model of every dynamics kind by its name."""
    return dict(_KINDS)

"""From a campaign to a results file: plan, blocks, workers, shards.

The names load on first use, so that the command line starts fast.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relnav_sim.runner.block import simulate_block
    from relnav_sim.runner.run import run_campaign
    from relnav_sim.runner.simulation import Simulation, simulate

__all__ = ["Simulation", "run_campaign", "simulate", "simulate_block"]

_HOME = {"Simulation": "simulation", "simulate": "simulation", "run_campaign": "run", "simulate_block": "block"}


def __getattr__(name: str) -> Any:
    """Import a public name on its first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'relnav_sim.runner' has no attribute {name!r}")
    return getattr(importlib.import_module(f"relnav_sim.runner.{_HOME[name]}"), name)

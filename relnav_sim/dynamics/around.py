"""Dynamics about other dynamics: what all that change something of some have in common."""

from __future__ import annotations

from typing import Any

from relnav_sim.dynamics.interface import Dynamics


class AroundDynamics:
    """Dynamics that are their base in all that a subclass does not change.

    Args:
        base: The dynamics, asked each time: what is assigned to them counts from then on.
    """

    def __init__(self, base: Dynamics) -> None:
        self._base = base

    def __getattr__(self, name: str) -> Any:
        if name == "_base":
            raise AttributeError(name)  # while it is unpickled
        return getattr(self._base, name)

    def __setattr__(self, name: str, value: Any) -> None:
        """Give the base what is its own, which is as if it had had it from the first."""
        if name[0] != "_" and hasattr(self._base, name):
            setattr(self._base, name, value)
        else:
            super().__setattr__(name, value)

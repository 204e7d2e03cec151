"""Why each claim came out as it did, in a sentence or two with the figures of the experiment that shows it."""

from __future__ import annotations

from replication.summary import Experiment


def why(claim: str, experiments: tuple[Experiment, ...]) -> tuple[str, ...]:
    """Return the first sentence of every experiment on a claim, with its title."""
    return tuple(f"{item.title}. {item.text[-1]}" for item in experiments if claim in item.claims)

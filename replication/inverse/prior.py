"""A prior over what a paper leaves open: each unknown has a law that turns a uniform number into its value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Indices


@dataclass(frozen=True)
class Unknown:
    """One setting that a paper leaves open.

    Attributes:
        name: Its name.
        unit: Its unit, "" for none.
        words: What it is.
        law: Inverse of its distribution function: uniform numbers to values, any shape.
        logarithmic: Whether its size, not its value, is what counts.
        choices: Names of its values, which then count from 0; () for a number.
        divides: Whether papers with different choices are so unlike that their density is learned for each choice.
        wraps: Whether it is an angle: the end of its range is its beginning.
    """

    name: str
    unit: str
    words: str
    law: Callable[[Array], Array]
    logarithmic: bool = False
    choices: tuple[str, ...] = ()
    divides: bool = False
    wraps: bool = False


def uniform(low: float, high: float) -> Callable[[Array], Array]:
    """Return the law that is uniform between two values."""
    return lambda u: low + (high - low) * u


def log_uniform(low: float, high: float) -> Callable[[Array], Array]:
    """Return the law whose logarithm is uniform between those of two positive values."""
    return lambda u: low * (high / low) ** u


def or_else(share: float, value: float, law: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return the law that is one value with a probability, and otherwise another law."""
    return lambda u: np.where(u < share, value, law(np.clip((u - share) / (1 - share), 0.0, 1.0)))


def choice(weights: Sequence[float]) -> Callable[[Array], Array]:
    """Return the law of a choice with these weights, numbered from 0."""
    edges = np.cumsum(weights)[:-1] / np.sum(weights)
    return lambda u: np.searchsorted(edges, u, side="right").astype(float)


def values(unknowns: Sequence[Unknown], u: Array) -> dict[str, Array]:
    """Return the value of each unknown, (n,), by its name, from uniform numbers (n, unknowns)."""
    return {unknown.name: unknown.law(u[:, place]) for place, unknown in enumerate(unknowns)}


def kinds(unknowns: Sequence[Unknown], u: Array) -> Indices:
    """Return a number for each setting, (n,), that differs where choices that divide papers do."""
    dividing = [unknown.law(u[:, place]) for place, unknown in enumerate(unknowns) if unknown.divides]
    if not dividing:
        return np.zeros(len(u), dtype=np.int64)
    return np.unique(np.stack(dividing, axis=1), axis=0, return_inverse=True)[1].reshape(-1)


def dividing_choices(unknowns: Sequence[Unknown], u: Array) -> dict[str, Array]:
    """Return which settings u (n, unknowns) have each choice that divides papers, (n,), by its name."""
    return {
        f"{unknown.words}: {choice}": unknown.law(u[:, place]) == k
        for place, unknown in enumerate(unknowns)
        if unknown.divides
        for k, choice in enumerate(unknown.choices)
    }

"""Axes of a report: the chief's RTN frame, or the axes of Shi et al. (2025).

Results are stored in RTN (x radial out, y along-track, z orbit normal). Shi et al. (2025) tabulate
x along-track, y minus orbit normal, z nadir: x_L = y_H, y_L = -z_H, z_L = -x_H, for positions and
velocities alike.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from relnav_sim.arrays import Array

Axes = Literal["rtn", "shi2025"]

AXIS_COMPONENTS = ("x", "y", "z", "vx", "vy", "vz")
COMPONENTS = ("x", "y", "z", "r", "vx", "vy", "vz", "v")

_SOURCES: dict[Axes, tuple[int, int, int]] = {"rtn": (0, 1, 2), "shi2025": (1, 2, 0)}
_SIGNS: dict[Axes, tuple[float, float, float]] = {"rtn": (1.0, 1.0, 1.0), "shi2025": (1.0, -1.0, -1.0)}
_NAMES: dict[Axes, tuple[str, str, str]] = {
    "rtn": ("radial", "along-track", "orbit normal"),
    "shi2025": ("along-track", "minus orbit normal", "nadir"),
}


def checked_axes(axes: str) -> Axes:
    """Return ``axes`` if it names a set of axes.

    Raises:
        ValueError: If it does not.
    """
    match axes:
        case "rtn" | "shi2025":
            return axes
    raise ValueError(f"axes must be one of {', '.join(get_args(Axes))}, not {axes!r}")


def axis_names(axes: Axes) -> tuple[str, str, str]:
    """Return what x, y and z stand for, in words."""
    return _NAMES[axes]


def describe_axes(axes: Axes) -> str:
    """Return one phrase that says what x, y and z are."""
    frame = "Chief's RTN frame" if axes == "rtn" else "Axes of Shi et al. (2025)"
    return f"{frame}: " + ", ".join(f"{axis} {name}" for axis, name in zip("xyz", axis_names(axes), strict=True))


def source_component(component: str, axes: Axes) -> tuple[str, float]:
    """Return the RTN component that holds ``component`` of ``axes``, and its sign.

    Args:
        component: One of ``x y z vx vy vz r v``; the norms ``r`` and ``v`` are the same in both.
        axes: The axes of the report.
    """
    if component in ("r", "v"):
        return component, 1.0
    index = "xyz".index(component[-1])
    return component[:-1] + "xyz"[_SOURCES[axes][index]], _SIGNS[axes][index]


def turned_states(states: Array, axes: Axes) -> Array:
    """Return RTN states (..., 6) in the axes of the report (..., 6)."""
    order, signs = _six(axes)
    return np.asarray(states, dtype=float)[..., order] * signs


def turned_sigmas(sigmas: Array, axes: Axes) -> Array:
    """Return RTN standard deviations (..., 6) in the axes of the report (..., 6): no sign changes."""
    order, _ = _six(axes)
    return np.asarray(sigmas, dtype=float)[..., order]


def turned_covariances(covariances: Array, axes: Axes) -> Array:
    """Return RTN covariances (..., 6, 6) in the axes of the report (..., 6, 6)."""
    order, signs = _six(axes)
    chosen = np.asarray(covariances, dtype=float)[..., order, :][..., order]
    return np.asarray(chosen * np.outer(signs, signs))


def _six(axes: Axes) -> tuple[list[int], Array]:
    order = list(_SOURCES[axes])
    return order + [index + 3 for index in order], np.array(_SIGNS[axes] * 2)

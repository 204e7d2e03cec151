"""When a sensor reads: every so many steps, from an offset on."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Integers, Mask


def steps_per_reading(period_s: float | None, step_s: float) -> int:
    """Return after how many steps the next measurement is due.

    Raises:
        ValueError: The period is no multiple of the step.
    """
    if period_s is None:
        return 1
    count = round(period_s / step_s)
    if count < 1 or abs(count * step_s - period_s) > 1e-9 * period_s:
        raise ValueError(f"period_s {period_s:g} s is no whole number of steps of {step_s:g} s")
    return count


def due(epochs: Integers, period_s: float | None, offset_s: float, step_s: float) -> Mask:
    """Return at which epochs (K,) a measurement is due.

    Raises:
        ValueError: The period or the offset is no multiple of the step.
    """
    first = steps_per_reading(offset_s, step_s) if offset_s else 0
    return np.asarray((epochs >= first) & ((epochs - first) % steps_per_reading(period_s, step_s) == 0))

"""True states of both craft."""

from __future__ import annotations

from dataclasses import dataclass

from relnav_sim.arrays import Array


@dataclass(frozen=True)
class Truth:
    """True states at some epochs; b is the number of runs, or 1 where all runs share the truth.

    A state is NaN from the time on at which the trajectory ended (`TruthTrajectory.failures`).

    Attributes:
        times_s: Epochs (K,), s.
        chief: ECI state of the chief (b, K, 6), m and m/s.
        deputy: ECI state of the deputy (b, K, 6), m and m/s.
        relative: State of the deputy relative to the chief (b, K, 6), RTN, m and m/s.
        normal_acceleration_m_s2: The chief's along its orbit normal (b, K), which turns its RTN axes; None: not known.
    """

    times_s: Array
    chief: Array
    deputy: Array
    relative: Array
    normal_acceleration_m_s2: Array | None = None

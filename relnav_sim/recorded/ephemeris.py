"""A recorded orbit: states at epochs, and between them by interpolation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch
from relnav_sim.recorded.axes import in_eci
from relnav_sim.recorded.errors import EphemerisError
from relnav_sim.recorded.interpolation import Interpolation

_Evaluate = Callable[[Interpolation, Array, Array, Array], Array]
_ROUNDING_S = 1e-6
"""By so much a time may lie outside a span: epochs are multiples of steps, which round."""
_SHOWN = 4


@dataclass(frozen=True)
class Span:
    """A segment of rows that is interpolated by itself.

    Attributes:
        rows: Which rows of the ephemeris.
        start_s: First time that may be asked for, s.
        stop_s: Last time, s.
        interpolation: How states between the rows are found.
    """

    rows: slice
    start_s: float
    stop_s: float
    interpolation: Interpolation


@dataclass(frozen=True)
class Ephemeris:
    """A recorded orbit, from `load_ephemeris`.

    Attributes:
        path: The file.
        epoch: The epoch from which times count: the first row.
        times_s: SI seconds from the epoch, of each row, (T,).
        states: Positions and velocities (T, 6), m and m/s, in the frame; velocities are the time derivatives of the
            coordinates.
        frame: The frame, as the file names it: EME2000 (J2000), ICRF (GCRF) or a realisation of ITRF.
        spans: The segments that are interpolated, in order of time.
        notes: What a reader of results should know of the file.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import ForceModel, load_ephemeris, propagate
        >>> times_s = np.arange(0.0, 900.0, 60.0)
        >>> states = propagate([[6.9e6, 0.0, 0.0, 0.0, 7.6e3, 0.0]], times_s, ForceModel(3.986004418e14, 6378137.0))[0]
        >>> columns = "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"
        >>> np.savetxt("recorded.csv", np.column_stack([times_s, states]), delimiter=",", header=columns, comments="")
        >>> orbit = load_ephemeris("recorded.csv", frame="EME2000", epoch="2026-03-01T00:00:00 UTC")
        >>> bool(abs(orbit.at([120.0])[0] - states[2]).max() < 1e-6)
        True
    """

    path: str
    epoch: Epoch
    times_s: Array
    states: Array
    frame: str
    spans: tuple[Span, ...]
    notes: tuple[str, ...] = ()

    def at(self, times_s: ArrayLike) -> Array:
        """Return the states (..., 6) at times (...), SI seconds from the epoch, in the frame.

        Where two spans meet, the earlier one tells.

        Raises:
            EphemerisError: The ephemeris does not cover a time.
        """
        return self._evaluated(times_s, 6, Interpolation.states)

    def accelerations(self, times_s: ArrayLike) -> Array:
        """Return the second derivatives of the coordinates (..., 3), m/s^2, at times (...), as `at` does."""
        return self._evaluated(times_s, 3, Interpolation.accelerations)

    def eci(self, *, ut1_utc_s: float = 0.0, polar_motion_rad: tuple[float, float] = (0.0, 0.0)) -> Ephemeris:
        """Return the same orbit in ECI (EME2000), its rows turned and then interpolated.

        Args:
            ut1_utc_s: UT1 - UTC at the epoch, s, for an orbit in ITRF.
            polar_motion_rad: x and y of the pole, rad, for an orbit in ITRF.
        """
        turned = in_eci(self.states, self.times_s, self.epoch, self.frame, ut1_utc_s, polar_motion_rad)
        return replace(self, states=turned, frame="EME2000")

    def _evaluated(self, times_s: ArrayLike, width: int, evaluate: _Evaluate) -> Array:
        times = np.asarray(times_s, dtype=float)
        flat = times.ravel()
        found = np.full((len(flat), width), np.nan)
        wanted = np.ones(len(flat), dtype=bool)
        for span in self.spans:
            here = wanted & (flat >= span.start_s - _ROUNDING_S) & (flat <= span.stop_s + _ROUNDING_S)
            if here.any():
                found[here] = evaluate(span.interpolation, self.times_s[span.rows], self.states[span.rows], flat[here])
            wanted &= ~here
        if wanted.any():
            when = self.epoch.later(float(flat[wanted][0])).text() if np.isfinite(flat[wanted][0]) else "a time"
            raise EphemerisError(f"{self.path} does not cover {when}; it covers {self.coverage}")
        return found.reshape(*times.shape, width)

    @property
    def coverage(self) -> str:
        """The times that may be asked for, in words."""
        shown = [
            f"{self.epoch.later(span.start_s).text()} to {self.epoch.later(span.stop_s).text()}"
            for span in self.spans[:_SHOWN]
        ]
        more = [f"{len(self.spans) - _SHOWN} more segments"] if len(self.spans) > _SHOWN else []
        return " and ".join([*shown, *more])

    def covers(self, start_s: float, stop_s: float) -> bool:
        """Return whether every time of an interval may be asked for."""
        reached = start_s
        for span in self.spans:
            if span.start_s <= reached + _ROUNDING_S:
                reached = max(reached, span.stop_s)
        return self.spans[0].start_s <= start_s + _ROUNDING_S and reached >= stop_s - _ROUNDING_S

    @cached_property
    def _errors(self) -> Array:
        return np.array(
            [span.interpolation.error(self.times_s[span.rows], self.states[span.rows]) for span in self.spans]
        )

    @property
    def interpolation_error_m(self) -> float:
        """Largest error of a position at rows that are withheld one at a time, m; NaN where rows are too few.

        A withheld row leaves a gap of twice the step, so that the error between rows is smaller than this.
        """
        return _largest(self._errors[:, 0])

    @property
    def interpolation_error_m_s(self) -> float:
        """The same of a velocity, m/s."""
        return _largest(self._errors[:, 1])


def _largest(errors: Array) -> float:
    return float(np.nan if np.isnan(errors).all() else np.nanmax(errors))

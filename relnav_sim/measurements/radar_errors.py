"""What constant or slow errors of radar and attitude do to the two forms of a radar measurement."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.linalg import images, in_rows

RANGE, AZIMUTH, ELEVATION, TURN = 0, 1, 2, slice(3, 6)
"""Rows of the radar's errors: range (m), azimuth, elevation (rad), and a turn about the radar's axes (rad)."""
ERRORS = 6


def radar_errors(channels: Mapping[str, Array], turn: Array) -> Array:
    """Return the radar's errors (6, e) as a combination of augmented states.

    Args:
        channels: What each state adds to ``range`` (m), ``azimuth`` and ``elevation`` (rad), (e,) each.
        turn: The turn about the radar's axes that each state is, (3, e), rad.
    """
    errors = np.zeros((ERRORS, turn.shape[1]))
    for row, name in ((RANGE, "range"), (AZIMUTH, "azimuth"), (ELEVATION, "elevation")):
        errors[row] = channels.get(name, 0.0)
    errors[TURN] = turn
    return errors


class RadarDistortion:
    """Range, azimuth and elevation read with biases, then turned by a small error of the attitude.

    Spherical and Cartesian measurement go the same way: to range and angles in the radar frame, where the biases add,
    to the line of sight s, which a turn dtheta of the attitude moves to s + s x dtheta, and back.

    Args:
        errors: (6, e): the radar's errors as a combination of the augmented states, rows as above.
        radar_from_rtn: Rotation (3, 3) where the measurement is a position in RTN (m); None where it is range, azimuth
            and elevation.
    """

    turns: Array | None = None

    def __init__(self, errors: Array, radar_from_rtn: Array | None = None) -> None:
        self._errors = np.ascontiguousarray(errors)
        self._cartesian = radar_from_rtn is not None
        self._rotation = np.eye(3) if radar_from_rtn is None else np.ascontiguousarray(radar_from_rtn)
        self._adds_up = not self._cartesian and not errors[TURN].any()
        self._added = np.ascontiguousarray(errors[: ELEVATION + 1])
        self.sees = tuple(np.flatnonzero(errors.any(axis=0)).tolist())

    def apply(self, predicted: Array, extra: Array) -> Array:
        """Return the measurements (..., 3) that take the place of the error-free ones."""
        if self._adds_up:
            return predicted + images(self._added, extra)
        reading = kernels.distortion.readings(*self._points(predicted, extra))
        return reading.reshape(predicted.shape)

    def jacobian(self, predicted: Array, extra: Array) -> tuple[Array | None, Array]:
        """Return derivatives by the error-free measurement, (..., 3, 3) or None for I, and by the augmented states."""
        if self._adds_up:
            return None, self._added
        by_predicted, by_extra = kernels.distortion.by_both(*self._points(predicted, extra))
        leading = predicted.shape[:-1]
        return by_predicted.reshape(*leading, 3, 3), by_extra.reshape(*leading, *by_extra.shape[1:])

    def _points(self, predicted: Array, extra: Array) -> tuple[Array, Array, Array, Array, bool]:
        """Return the arguments of the kernels."""
        return in_rows(predicted), in_rows(extra), self._errors, self._rotation, self._cartesian


class AnglesDistortion:
    """The same for a measurement of azimuth and elevation alone.

    Args:
        errors: (6, e), those of range of no effect.
    """

    turns: Array | None = None

    def __init__(self, errors: Array) -> None:
        self._whole = RadarDistortion(np.vstack([np.zeros_like(errors[:1]), errors[1:]]))
        self.sees = self._whole.sees

    def apply(self, predicted: Array, extra: Array) -> Array:
        """Return the measurements (..., 2) that take the place of the error-free ones."""
        return self._whole.apply(_at_unit_range(predicted), extra)[..., 1:]

    def jacobian(self, predicted: Array, extra: Array) -> tuple[Array | None, Array]:
        """Return derivatives by the error-free measurement, (..., 2, 2) or None for I, and by the augmented states."""
        by_reading, by_extra = self._whole.jacobian(_at_unit_range(predicted), extra)
        return None if by_reading is None else by_reading[..., 1:, 1:], by_extra[..., 1:, :]


def _at_unit_range(angles: Array) -> Array:
    return np.concatenate([np.ones_like(angles[..., :1]), angles], axis=-1)

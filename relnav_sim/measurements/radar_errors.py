"""What constant or slow errors of radar and attitude do to the two forms of a radar measurement."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import (
    components,
    cross,
    sight_gradients,
    sight_vector,
    spherical_gradients,
    spherical_of,
)

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
        self._errors = errors
        self._rotation = radar_from_rtn
        self._turns = bool(errors[TURN].any())
        self._adds_up = radar_from_rtn is None and not self._turns
        self.sees = tuple(np.flatnonzero(errors.any(axis=0)).tolist())

    def apply(self, predicted: Array, extra: Array) -> Array:
        """Return the readings (..., 3) that take the place of the error-free ones."""
        errors = np.einsum("ij,...j->...i", self._errors, extra)
        reading = self._error_free(predicted) + errors[..., :3]
        if self._adds_up:
            return reading
        sight = self._turned(reading, errors)
        if self._rotation is None:
            return _stacked(spherical_of(components(sight)))
        position: Array = np.einsum("ji,...j->...i", self._rotation, sight)
        return position

    def jacobian(self, predicted: Array, extra: Array) -> tuple[Array | None, Array]:
        """Return the derivatives by the error-free reading, (..., 3, 3) or None for I, and by the augmented states."""
        if self._adds_up:
            return None, self._errors[:3]
        errors = np.einsum("ij,...j->...i", self._errors, extra)
        free = self._error_free(predicted)
        reading = free + errors[..., :3]
        by_reading = _rows(sight_gradients(*components(reading)))
        by_turn = _cross_matrices(_stacked(sight_vector(*components(reading))))
        if self._turns:
            by_reading = by_reading - _cross_matrices(errors[..., TURN]) @ by_reading
        by_errors = np.concatenate([by_reading, by_turn], axis=-1)
        if self._rotation is None:
            by_errors = _rows(spherical_gradients(components(self._turned(reading, errors)))) @ by_errors
            return by_errors[..., :3], by_errors @ self._errors
        by_errors = self._rotation.T @ by_errors
        by_sight = _rows(spherical_gradients(sight_vector(*components(free))))
        return by_errors[..., :3] @ by_sight @ self._rotation, by_errors @ self._errors

    def _error_free(self, predicted: Array) -> Array:
        """Return range, azimuth and elevation of the error-free reading."""
        if self._rotation is None:
            return predicted
        return _stacked(spherical_of(components(np.einsum("ij,...j->...i", self._rotation, predicted))))

    def _turned(self, reading: Array, errors: Array) -> Array:
        """Return the line of sight (..., 3) of a biased reading after the turn, radar frame."""
        sight = sight_vector(*components(reading))
        if not self._turns:
            return _stacked(sight)
        moved = cross(sight, components(errors[..., TURN]))
        return _stacked((sight[0] + moved[0], sight[1] + moved[1], sight[2] + moved[2]))


class AnglesDistortion:
    """The same for a reading of azimuth and elevation alone.

    Args:
        errors: (6, e), those of range of no effect.
    """

    turns: Array | None = None

    def __init__(self, errors: Array) -> None:
        self._whole = RadarDistortion(np.vstack([np.zeros_like(errors[:1]), errors[1:]]))
        self.sees = self._whole.sees

    def apply(self, predicted: Array, extra: Array) -> Array:
        """Return the readings (..., 2) that take the place of the error-free ones."""
        return self._whole.apply(_at_unit_range(predicted), extra)[..., 1:]

    def jacobian(self, predicted: Array, extra: Array) -> tuple[Array | None, Array]:
        """Return the derivatives by the error-free reading, (..., 2, 2) or None for I, and by the augmented states."""
        by_reading, by_extra = self._whole.jacobian(_at_unit_range(predicted), extra)
        return None if by_reading is None else by_reading[..., 1:, 1:], by_extra[..., 1:, :]


def _at_unit_range(angles: Array) -> Array:
    return np.concatenate([np.ones_like(angles[..., :1]), angles], axis=-1)


def _stacked(vector: tuple[Array, Array, Array]) -> Array:
    stacked = np.empty((*vector[0].shape, 3))
    for i, component in enumerate(vector):
        stacked[..., i] = component
    return stacked


def _rows(gradients: tuple[tuple[Array, Array, Array], ...]) -> Array:
    """Return (..., 3, 3) of the gradients' components, one row each."""
    matrix = np.empty((*gradients[0][0].shape, 3, 3))
    for i, row in enumerate(gradients):
        for j, entry in enumerate(row):
            matrix[..., i, j] = entry
    return matrix


def _cross_matrices(vectors: Array) -> Array:
    """Return [v x], (..., 3, 3)."""
    x, y, z = components(vectors)
    zero = np.zeros_like(x)
    return _rows(((zero, -z, y), (z, zero, -x), (-y, x, zero)))

"""Several sensors as one measurement: the channels of all, one after the other, of which some are read at a time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.linalg import LOG_TWO_PI
from relnav_sim.measurements.interface import (
    Measurement,
    MeasurementDefaults,
    Mixture,
    has_own_density,
    joint_components,
    linearised,
)
from relnav_sim.measurements.partial import FIXED, MASKED, PartialMeasurement, Sensor


@dataclass(frozen=True)
class _Part:
    channels: slice
    measurement: Measurement


class JoinedMeasurement(MeasurementDefaults):
    """Several measurements one after the other, z = [z_a; z_b; ...], their noises independent.

    Args:
        measurements: What is measured, in the order of the channels.
    """

    def __init__(self, measurements: Sequence[Measurement]) -> None:
        ends = np.cumsum([measurement.dimension for measurement in measurements]).tolist()
        self._parts = tuple(
            _Part(slice(end - measurement.dimension, end), measurement)
            for end, measurement in zip(ends, measurements, strict=True)
        )
        self.dimension = ends[-1]
        self._unit = np.eye(self.dimension)
        self.angles = tuple(
            part.channels.start + place for part in self._parts for place in getattr(part.measurement, "angles", ())
        )
        self.depends_on = _union([getattr(measurement, "depends_on", None) for measurement in measurements])

    def check_extent(self, runs: int, epochs: int) -> None:
        """Refuse a block of measurements that one of the models is not for.

        Raises:
            ValueError: It is not.
        """
        for part in self._parts:
            check_extent = getattr(part.measurement, "check_extent", None)
            if check_extent is not None:
                check_extent(runs, epochs)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return h(states), (runs, ..., m); zero in the channels of a sensor that is passed over."""
        predicted = np.zeros((*states.shape[:-1], self.dimension))
        for part in self._active():
            predicted[..., part.channels] = part.measurement.predict(states, epoch)
        return predicted

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx at `states` (runs, ..., n): (runs, ..., m, n), or (m, n) where it is constant."""
        return self._rows([part.measurement.jacobian(states, epoch) for part in self._active()])

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return the block-diagonal R, (m, m) or (runs, m, m); 1 for the channels of a sensor that is passed over."""
        return self._blocks([part.measurement.noise(mean, epoch) for part in self._active()])

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return every combination of the components of the measurements, or None where all have Gaussian noise.

        A filter may carry a belief for each of them, so there are as many whoever is passed over.
        """
        active = self._active()
        mixtures = [part.measurement.mixture(mean, epoch) for part in self._parts]
        if all(mixture is None for mixture in mixtures):
            return None
        weights, covariances = np.ones(1), self._unit[None]
        for part, mixture in zip(self._parts, mixtures, strict=True):
            if mixture is None:
                own, blocks = np.ones(1), None
                if part in active:
                    blocks = part.measurement.noise(mean, epoch)[..., None, :, :]
            else:
                own, blocks = joint_components(mixture)
                blocks = blocks if part in active else None
            weights = (weights[:, None] * own).ravel()
            covariances = np.repeat(covariances, len(own), axis=-3)
            if blocks is None:
                continue
            tiled = np.tile(blocks, (*[1] * (blocks.ndim - 3), len(weights) // len(own), 1, 1))
            leading = np.broadcast_shapes(covariances.shape[:-2], tiled.shape[:-2])
            covariances = np.array(np.broadcast_to(covariances, (*leading, *covariances.shape[-2:])))
            covariances[..., part.channels, part.channels] = tiled
        return Mixture(weights, covariances, shared=True)

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return the residuals of the measurements, (runs, ..., m); zero for a sensor that is passed over."""
        residual = np.zeros(np.broadcast_shapes(z.shape, predicted.shape))
        for part in self._active():
            channels = part.channels
            residual[..., channels] = part.measurement.residual(z[..., channels], predicted[..., channels])
        return residual

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual (runs, m), Jacobian and R at the means (runs, n)."""
        residual = np.zeros(z.shape)
        rows, blocks = [], []
        for part in self._active():
            residual[:, part.channels], H, R = linearised(part.measurement, z[:, part.channels], mean, epoch)
            rows.append(H)
            blocks.append(R)
        return residual, self._rows(rows), self._blocks(blocks)

    @property
    def log_likelihood(self) -> Callable[[Array, Array, int], Array]:  # whose it is may change
        """The sum of the densities where a measurement has one of its own, else that of the functions above."""
        own = any(has_own_density(part.measurement) for part in self._parts)
        return self._own_densities if own else super().log_likelihood

    def _active(self) -> tuple[_Part, ...]:
        """Return the measurements that are not passed over."""
        return self._parts

    def _rows(self, rows: Sequence[Array]) -> Array:
        """Return the rows of the active measurements as one Jacobian, zero in the channels of the others."""
        H = np.zeros((*_leading(rows), self.dimension, rows[0].shape[-1]))
        for part, row in zip(self._active(), rows, strict=True):
            H[..., part.channels, :] = row
        return H

    def _blocks(self, blocks: Sequence[Array]) -> Array:
        """Return the covariances of the active measurements as one, with those of I in the channels of the others."""
        R = np.empty((*_leading(blocks), *self._unit.shape))
        R[...] = self._unit
        for part, block in zip(self._active(), blocks, strict=True):
            R[..., part.channels, part.channels] = block
        return R

    def _own_densities(self, z: Array, states: Array, epoch: int) -> Array:
        """Return the sum of log p(z_a | states); a channel that is passed over counts as N(0; 0, 1), as anywhere."""
        total = np.zeros(states.shape[:-1])
        read = 0
        for part in self._active():
            total += part.measurement.log_likelihood(z[..., part.channels], states, epoch)
            read += part.measurement.dimension
        return total - 0.5 * LOG_TWO_PI * (self.dimension - read)


def _leading(matrices: Sequence[Array]) -> tuple[int, ...]:
    """Return the axes before the last two that all of some matrices have room in."""
    shapes = {matrix.shape[:-2] for matrix in matrices}
    return shapes.pop() if len(shapes) == 1 else np.broadcast_shapes(*shapes)


def _union(seen: Sequence[tuple[int, ...] | None]) -> tuple[int, ...] | None:
    """Return the states that any of the measurements depends on; None: any."""
    places: set[int] = set()
    for own in seen:
        if own is None:
            return None
        places.update(own)
    return tuple(sorted(places))


class SeveralMeasurements(JoinedMeasurement):
    """The joined measurements of several sensors, told which channels are present.

    A sensor of which nothing is present in any run is passed over: its functions are not called, but for the weights of
    a mixture.

    Args:
        sensors: The measurements by name.

    Attributes:
        complete: The joined measurement with every channel present.
        present: The channels (runs, m) that are present; None: all.
        sensors: The sensors in order.
    """

    def __init__(self, sensors: Mapping[str, Measurement]) -> None:
        partial = [PartialMeasurement(measurement, name) for name, measurement in sensors.items()]
        super().__init__(partial)
        self._partial = tuple(partial)
        self.complete = JoinedMeasurement(tuple(sensors.values()))
        self.attend(None)
        self.sensors: tuple[Sensor, ...] = tuple(
            replace(one.sensors[0], channels=part.channels) for one, part in zip(partial, self._parts, strict=True)
        )

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse a function for all sensors at once, which would not say what it is of each, and other angles.

        Raises:
            AttributeError: It is one.
        """
        if "sensors" in vars(self) and name in (*FIXED, *MASKED, "log_likelihood", "take"):
            raise AttributeError(f"this is the measurement of several sensors; assign {name} to that of one of them")
        super().__setattr__(name, value)

    def attend(self, present: Mask | None) -> None:
        """Count the channels (runs, m) as present and the others as absent; None: all are present."""
        self.present = present
        self._looked = False  # which parts that leaves is found out when one of their functions is called

    def stand_aside(self, aside: bool) -> None:
        """Let the functions of each sensor be those of its measurement themselves, or not."""
        for one in self._partial:
            one.stand_aside(aside)

    def _active(self) -> tuple[_Part, ...]:
        if not self._looked:
            self._looked = True
            self._left = self._look(self.present)
        return self._left

    def _look(self, present: Mask | None) -> tuple[_Part, ...]:
        """Let the parts attend to their own channels; return those of which something is present."""
        if present is None:
            for one in self._partial:
                one.attend(None)
            return self._parts
        some: list[bool] = np.asarray(present.any(axis=0)).tolist()
        every: list[bool] = np.asarray(present.all(axis=0)).tolist()
        active = []
        for part, one in zip(self._parts, self._partial, strict=True):
            own = part.channels
            partly = any(some[own]) and not all(every[own])
            one.attend(present[:, own] if partly else None)
            if any(some[own]):
                active.append(part)
        return tuple(active)

"""Several sensors as one measurement: the channels of all, one after the other, of which some are read at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.linalg import LOG_TWO_PI
from relnav_sim.measurements.interface import (
    Measurement,
    MeasurementDefaults,
    Mixture,
    has_own_density,
    joint_components,
)
from relnav_sim.measurements.partial import PartialMeasurement, Sensor


@dataclass(frozen=True)
class _Part:
    channels: slice
    measurement: Measurement


class JoinedMeasurement(MeasurementDefaults):
    """The readings of several measurements one after the other, z = [z_a; z_b; ...], their noises independent.

    Args:
        measurements: What is measured, in the order of the channels.
    """

    def __init__(self, measurements: Sequence[Measurement]) -> None:
        ends = np.cumsum([measurement.dimension for measurement in measurements]).tolist()
        self._parts = tuple(
            _Part(slice(end - measurement.dimension, end), measurement)
            for end, measurement in zip(ends, measurements, strict=True)
        )
        self._active = self._parts
        self.dimension = ends[-1]
        self.angles = tuple(
            part.channels.start + place for part in self._parts for place in getattr(part.measurement, "angles", ())
        )
        self.depends_on = _union([getattr(measurement, "depends_on", None) for measurement in measurements])
        if any(has_own_density(measurement) for measurement in measurements):
            self.log_likelihood = self._own_densities  # type: ignore[method-assign]  # only then is there one of its own

    def check_extent(self, runs: int, epochs: int) -> None:
        """Refuse a block of readings that one of the measurements is not for.

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
        for part in self._active:
            predicted[..., part.channels] = part.measurement.predict(states, epoch)
        return predicted

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx at `states` (runs, ..., n): (runs, ..., m, n), or (m, n) where it is constant."""
        rows = [part.measurement.jacobian(states, epoch) for part in self._active]
        leading = np.broadcast_shapes(*(row.shape[:-2] for row in rows))
        H = np.zeros((*leading, self.dimension, states.shape[-1]))
        for part, row in zip(self._active, rows, strict=True):
            H[..., part.channels, :] = row
        return H

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return the block-diagonal R, (m, m) or (runs, m, m); 1 for the channels of a sensor that is passed over."""
        blocks = [part.measurement.noise(mean, epoch) for part in self._active]
        R = np.zeros((*np.broadcast_shapes(*(block.shape[:-2] for block in blocks)), self.dimension, self.dimension))
        R[...] = np.eye(self.dimension)
        for part, block in zip(self._active, blocks, strict=True):
            R[..., part.channels, part.channels] = block
        return R

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return every combination of the components of the measurements, or None where all have Gaussian noise.

        A filter may carry a belief for each of them, so there are as many whoever is passed over.
        """
        mixtures = [part.measurement.mixture(mean, epoch) for part in self._parts]
        if all(mixture is None for mixture in mixtures):
            return None
        weights, covariances = np.ones(1), np.eye(self.dimension)[None]
        for part, mixture in zip(self._parts, mixtures, strict=True):
            if mixture is None:
                own, blocks = np.ones(1), None
                if part in self._active:
                    blocks = part.measurement.noise(mean, epoch)[..., None, :, :]
            else:
                own, blocks = joint_components(mixture)
                blocks = blocks if part in self._active else None
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
        for part in self._active:
            channels = part.channels
            residual[..., channels] = part.measurement.residual(z[..., channels], predicted[..., channels])
        return residual

    def _own_densities(self, z: Array, states: Array, epoch: int) -> Array:
        """Return the sum of log p(z_a | states); a channel that is passed over counts as N(0; 0, 1), as anywhere."""
        total = np.zeros(states.shape[:-1])
        read = 0
        for part in self._active:
            total += part.measurement.log_likelihood(z[..., part.channels], states, epoch)
            read += part.measurement.dimension
        return total - 0.5 * LOG_TWO_PI * (self.dimension - read)


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
        self.present: Mask | None = None
        self.sensors: tuple[Sensor, ...] = tuple(
            replace(one.sensors[0], channels=part.channels) for one, part in zip(partial, self._parts, strict=True)
        )

    def attend(self, present: Mask | None) -> None:
        """Count the channels (runs, m) as present and the others as absent; None: all are present."""
        self.present = present
        if present is None:
            self._active = self._parts
            for one in self._partial:
                one.attend(None)
            return
        active = []
        for part, one in zip(self._parts, self._partial, strict=True):
            own = present[:, part.channels]
            some = bool(own.any())
            one.attend(own if some and not own.all() else None)
            if some:
                active.append(part)
        self._active = tuple(active)

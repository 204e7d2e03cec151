"""What arrives from each sensor: its measurements, and its NIS with the degrees of freedom of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.results import layout
from relnav_sim.results.block import BySensor
from relnav_sim.statistics.consistency import SensorSums, at_common_dof


@dataclass(frozen=True)
class NisOfSensors:
    """The NIS of a chunk of epochs by sensor.

    Attributes:
        nis: By the name of the sensor (runs, K), in the order in which the filter takes them; NaN where it was not
            read.
        dof: Channels that were present (runs, K); 0 where it was not read.
    """

    nis: Mapping[str, Array] = field(default_factory=dict)
    dof: Mapping[str, Integers] = field(default_factory=dict)


class CommonDof:
    """Brings the NIS of each run to the degrees of freedom of the run's first update."""

    def __init__(self, runs: int) -> None:
        self._common = np.zeros(runs, dtype=np.int64)

    def alike(self, nis: Array, dof: Integers) -> Array:
        """Return the NIS of the next chunk of epochs at common degrees of freedom; the same array where all are."""
        first = np.take_along_axis(dof, np.argmax(dof > 0, axis=1)[:, None], axis=1)[:, 0]
        self._common = np.where(self._common > 0, self._common, first)
        return nis if ((dof == self._common[:, None]) | (dof == 0)).all() else at_common_dof(nis, dof, self._common)


class ReadingSeries:
    """What is stored of each sensor at the stored epochs.

    Args:
        runs: Number of runs in the block.
        epochs: Number of stored epochs.
        store_every: Every how many epochs is stored.
        names: The sensors.
    """

    def __init__(self, runs: int, epochs: int, store_every: int, names: tuple[str, ...]) -> None:
        self.names = names
        self._every = store_every
        lengths = layout.sizes(runs, epochs) | {"sensor": len(names)}
        self._series = {
            spec.name.removeprefix("sensor_"): np.full(
                layout.shape(spec, lengths), np.nan if spec.dtype == "<f4" else 0, dtype=spec.dtype
            )
            for spec in layout.BY_SENSOR
            if "time" in spec.dims
        }

    def add(self, epochs: Integers, given: NisOfSensors, sound: Mask) -> None:
        """Store what the next chunk of epochs has; ``sound``: epochs before a failure (runs, K)."""
        chosen = np.flatnonzero(epochs % self._every == 0)
        rows = epochs[chosen] // self._every
        after = -(-epochs // self._every)  # the stored epoch that each one counts towards
        begins = np.flatnonzero(np.diff(after, prepend=-1))
        inside = after[begins] < self._series["readings"].shape[1]
        for place, name in enumerate(self.names):
            good, dof = sound[:, chosen], given.dof[name]
            self._series["nis"][:, rows, place] = np.where(good, given.nis[name][:, chosen], np.nan)
            self._series["dof"][:, rows, place] = np.where(good, dof[:, chosen], 0)
            # Measurements go on after a failure: they are the sensor's.
            counts = np.add.reduceat((dof > 0).astype(np.int32), begins, axis=1)
            self._series["readings"][:, after[begins[inside]], place] += counts[:, inside]

    def result(self, spans: list[tuple[SensorSums, ...]]) -> BySensor:
        """Return everything by sensor, with the sums over each span."""

        def over_spans(of: str) -> Array:
            return np.stack([np.stack([getattr(one, of) for one in span], axis=1) for span in spans], axis=1)

        return BySensor(
            self.names,
            nis_sum=over_spans("nis"),
            dof_sum=over_spans("dof"),
            updates=over_spans("updates"),
            nis_lag1=over_spans("lag1"),
            **self._series,
        )

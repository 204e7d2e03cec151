"""A filter whose measurements come late, in any order: it goes back to the epoch of each, and over all since again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Filter, Gaussian, Innovation, in_c_order
from relnav_sim.filters.failed_runs import StatedFailures
from relnav_sim.filters.history import FilterHistory, Innovations
from relnav_sim.filters.readings import Readings
from relnav_sim.filters.returned import Returned
from relnav_sim.filters.rewinding import RewindableSource
from relnav_sim.filters.run import update_read, with_failures


@dataclass(frozen=True)
class _Reached:
    """What was known at an epoch, where the random numbers were, and the innovations that led there, by sensor."""

    belief: Any
    state: list[Any]
    innovations: tuple[tuple[int, Innovation], ...]


class OutOfSequence:
    """Carries a filter over chunks of epochs whose measurements arrive some epochs after their own.

    An epoch's estimate is that of the filter on all measurements that have arrived by then, each at its own epoch.
    Where nothing is outstanding it is that of the filter that has had them in order, to the bit.

    Innovations are those of an epoch whose last measurements may just have arrived, `depth` epochs back: only then are
    they those of measurements in order, white and with a likelihood that adds up. Those of the run's last epochs never
    are.

    Args:
        filter: The filter; its dynamics and measurement can be asked for `depth` epochs back.
        source: Where its random numbers come from.
        depth: Most epochs that a measurement arrives after its own.
        step_s: Time between epochs, s.
    """

    def __init__(self, filter: Filter, source: RewindableSource, depth: int, step_s: float) -> None:
        self._filter, self._source, self._depth, self._step_s = filter, source, depth, step_s
        self._reached: dict[int, _Reached] = {}
        self._z: dict[str, Array] = {}
        self._delays: dict[str, Integers] = {}

    def advance(
        self,
        belief: Any,
        z: Mapping[str, Array],
        delays: Mapping[str, Integers],
        first_epoch: int,
        reached: Callable[[int], None] = lambda epoch: None,
    ) -> tuple[Any, FilterHistory]:
        """Carry the filter over the next chunk; return the last belief and the history.

        Args:
            belief: One epoch before the chunk; what was known before is remembered.
            z: Measurements by sensor, at their own epochs, (runs, K, m); NaN where a channel is missing.
            delays: How many epochs after its own each arrives, (runs, K), by the sensors of which any is late.
            first_epoch: Number of the chunk's first epoch.
            reached: Told of every epoch that begins.
        """
        filter, depth = self._filter, self._depth
        B, K = next(iter(z.values())).shape[:2]
        known, late = self._with_tail(z, delays)
        base = first_epoch - depth
        # Taken first, as the measurement is to know of all epochs in the end.
        settled = Innovations(Readings(filter.measurement, _until(known, K), base), B, K)
        readings = Readings(filter.measurement, known, base)
        returned = Returned(B, filter.dynamics.dimension)
        belief = returned.belief(belief, "start")
        if not self._reached:
            self._reached[first_epoch - 1] = _Reached(belief, self._source.state(), ())
        means = np.empty((K, B, filter.dynamics.dimension))
        covariances = np.empty((*means.shape, means.shape[-1]))
        stated, before = StatedFailures(), Gaussian(belief.mean, belief.covariance)
        with np.errstate(all="ignore"), readings:
            for k in range(K):
                epoch = first_epoch + k
                reached(epoch)
                for again in range(base + self._earliest(readings, late, k + depth), epoch + 1):
                    self._over(again, epoch, k, readings, late, base, returned, stated)
                found = self._reached[epoch].belief
                means[k], covariances[k] = returned.moment(found, "mean"), returned.moment(found, "covariance")
                for place, innovation in self._reached[epoch - depth].innovations if epoch > depth else ():
                    settled.add(place, k, innovation)
                self._reached.pop(epoch - depth - 1, None)
        self._z = {name: values[:, K:] for name, values in known.items()}
        self._delays = {name: values[:, K:] for name, values in zip(known, late, strict=True) if values is not None}
        history = settled.history(means.swapaxes(0, 1), covariances.swapaxes(0, 1))
        last = self._reached[first_epoch + K - 1].belief
        return last, with_failures(history, stated, filter, before, Step(first_epoch, self._step_s))

    def _over(
        self,
        again: int,
        now: int,
        k: int,
        readings: Readings,
        late: list[Integers | None],
        base: int,
        returned: Returned,
        stated: StatedFailures,
    ) -> None:
        """Go over an epoch, for the first time or again, with what has arrived by now."""
        filter, step, column = self._filter, Step(again, self._step_s), again - base
        self._source.rewind(self._reached[again - 1].state)
        readings.begin(column)
        belief = returned.belief(filter.predict(self._reached[again - 1].belief, step), "predict")
        innovations = []
        for place, one in enumerate(readings.sensors):
            delay = late[place]
            read = one.read[:, column] if delay is None else one.read[:, column] & (delay[:, column] <= now - again)
            if not (filter.stochastic or read.any()):
                continue
            if readings.several:
                belief = in_c_order(belief)
            z = readings.attend(place, column)
            if read.all():
                belief, innovation = returned.update(filter.update(belief, z, step))
            else:
                belief, innovation = update_read(filter, belief, z, read, step, returned)
            innovations.append((place, innovation))
            if innovation.failed:
                stated.add(k, innovation.failed, read)
        self._reached[again] = _Reached(belief, self._source.state(), tuple(innovations))

    def _earliest(self, readings: Readings, late: list[Integers | None], now: int) -> int:
        """Return the earliest column of which a measurement arrives at the column now: at the latest that itself."""
        columns = np.arange(now - self._depth, now)
        found = now
        for one, delay in zip(readings.sensors, late, strict=True):
            if delay is not None and self._depth:
                arriving = (one.read[:, columns] & (delay[:, columns] == now - columns)).any(axis=0)
                if arriving.any():
                    found = min(found, int(columns[np.argmax(arriving)]))
        return found

    def _with_tail(
        self, z: Mapping[str, Array], delays: Mapping[str, Integers]
    ) -> tuple[dict[str, Array], list[Integers | None]]:
        """Return measurements and delays (by sensor, None: never late) with those of the `depth` epochs before."""
        known, late = {}, []
        for name, readings in z.items():
            B, _, m = readings.shape
            tail = self._z.get(name, np.full((B, self._depth, m), np.nan))
            delay = delays.get(name)
            if delay is not None:
                # What arrives later than the filter looks back is lost to it.
                readings = np.where((delay > self._depth)[..., None], np.nan, readings)
                delay = np.concatenate(
                    [self._delays.get(name, np.zeros((B, self._depth), dtype=np.int64)), delay], axis=1
                )
            known[name] = np.concatenate([tail, readings], axis=1)
            late.append(delay)
        return known, late


def _until(z: Mapping[str, Array], columns: int) -> dict[str, Array]:
    return {name: readings[:, :columns] for name, readings in z.items()}

"""Epochs that a filter takes in one go, in compiled code; the others it takes one after the other."""

from __future__ import annotations

from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.filters.belief import Filter, Gaussian
from relnav_sim.filters.history import Innovations
from relnav_sim.filters.readings import Readings
from relnav_sim.measurements.interface import Stretch

_LONGEST_PAUSE = 31
"""Epochs after which it is tried again, at most."""
_SHORTEST = 16
"""Epochs that are asked for at once after one that needs more, at least."""


class InOneGo:
    """The epochs of a chunk that can be taken so.

    A filter that can has ``compiled_epochs(belief, stretch, first_epoch)``, which fills the stretch, to the last bit as
    `predict` and `update` would, and returns for how many epochs it could; None: for none of this run.

    Args:
        filter: The filter; None: every epoch is to be taken by itself.
        readings: What arrives in the chunk; where a channel is missing no epoch of it is taken so.
        first_epoch: Number of the chunk's first epoch.
        mean: Where the means go, (K, runs, n).
        covariance: Where their covariances go, (K, runs, n, n).
        innovations: Where the innovations go.

    Attributes:
        goes_on: Whether there may be epochs that can be taken so.
    """

    def __init__(
        self,
        filter: Filter | None,
        readings: Readings,
        first_epoch: int,
        mean: Array,
        covariance: Array,
        innovations: Innovations,
    ) -> None:
        self._take = getattr(filter, "compiled_epochs", None)
        self.goes_on = self._take is not None and readings.plain
        self._first_epoch = first_epoch
        self._mean, self._covariance, self._innovations = mean, covariance, innovations
        self._next, self._pause, self._longest = 0, 0, len(mean)
        if self.goes_on:
            self._z, self._read = readings.sensors[0].z, np.ascontiguousarray(readings.sensors[0].read.T)

    def take(self, belief: Any, k: int) -> tuple[Any, int]:
        """Return the belief after as many epochs from column k on as can be taken, and how many these are."""
        assert self._take is not None, "it goes on"
        # Why a run failed that was lost before the chunk is stated at its first epoch, by the filter itself.
        if k < self._next or (k == 0 and not np.isfinite(belief.covariance).all()):
            return belief, 0
        asked = slice(k, k + self._longest)
        nis, log_likelihood = (each[: self._longest] for each in self._innovations.room(k))
        room = self._mean[asked], self._covariance[asked], nis, log_likelihood
        stretch = Stretch(self._z[asked], self._read[asked], *room)
        taken = self._take(belief, stretch, self._first_epoch + k)
        self.goes_on = taken is not None
        # As many again as could be taken: what is made ready for all that is left would often be thrown away.
        self._longest = max(2 * (taken or 0), _SHORTEST)
        if not taken:
            # Where runs need more at one epoch after the other, trying costs nearly as much as it would save.
            self._next, self._pause = k + 1 + self._pause, min(2 * self._pause + 1, _LONGEST_PAUSE)
            return belief, 0
        self._pause = 0
        if self._read[k : k + taken].any():
            self._innovations.add_extras(k, {name: extra[:taken] for name, extra in stretch.extras.items()})
        # A copy: the history of a run that has failed is changed later.
        last = k + taken - 1
        return Gaussian(self._mean[last].copy(), self._covariance[last].copy()), taken

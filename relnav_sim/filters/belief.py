"""What filters hold and report: beliefs, innovations, and the interface of a filter."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol, TypeVar

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.linalg import Kind
from relnav_sim.measurements.interface import Measurement
from relnav_sim.streams import RandomSource


@dataclass(frozen=True)
class Gaussian:
    """A Gaussian belief per run: mean (runs, n) and covariance (runs, n, n)."""

    mean: Array
    covariance: Array


@dataclass(frozen=True)
class Innovation:
    """How a measurement compared with its prediction.

    Args:
        nis: Normalised innovation squared nu^T S^-1 nu, (runs,).
        log_likelihood: log p(z_k | z_1 ... z_{k-1}), (runs,).
        extras: Further numbers of an algorithm by name, each (runs,), for example ``ess``.
        failed: Why a run can't go on, in words, by its place in the block; without the epoch, which is added. What the
            belief holds of such a run is not used any more.
        edits: Where measurements are edited, what happened to this one, each (runs,): see `filters.editing.EDITS`.
        refused: Channels of the measurement that were not taken, (runs, m); None: it was taken whole in every run.
    """

    nis: Array
    log_likelihood: Array
    extras: Mapping[str, Array] = field(default_factory=dict)
    failed: Mapping[int, str] = field(default_factory=dict)
    edits: Mapping[str, Array] = field(default_factory=dict)
    refused: Mask | None = None


class Belief(Protocol):
    """What a filter carries from epoch to epoch; a frozen dataclass whose arrays lead with the runs."""

    @property
    def mean(self) -> Array:
        """State estimate (runs, n)."""
        ...

    @property
    def covariance(self) -> Array:
        """Covariance of the estimate's error (runs, n, n)."""
        ...


class Filter(Protocol):
    """A recursive filter over a block of runs.

    `stochastic` says that `update` draws random numbers; it is then called at every epoch, so that the numbers
    a run gets do not depend on which other runs of its block have a measurement.
    """

    dynamics: Dynamics
    measurement: Measurement
    stochastic: bool

    def start(self, prior: Gaussian, source: RandomSource) -> Any:
        """Return the belief one step before the first measurement."""
        ...

    def predict(self, belief: Any, step: Step) -> Any:
        """Return the belief carried over one step."""
        ...

    def update(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the belief after the measurement z (runs, m), all of it finite, and its innovation."""
        ...


class KeepsModels:
    """A filter whose dynamics and measurement, once it is made, stay those that it was made of: parts hold them too."""

    _is_made = False

    def keep_models(self) -> None:
        """Refuse other models from now on; until then a derived class may put its own in their places."""
        self._is_made = True

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute, but no other models.

        Raises:
            AttributeError: They are others.
        """
        if self._is_made and name in ("dynamics", "measurement") and vars(self).get(name, value) is not value:
            raise AttributeError(f"a filter keeps the {name} that it was made of; make another one with create_filter")
        super().__setattr__(name, value)


@dataclass(frozen=True)
class WrappedBelief:
    """The belief of a filter about another filter's: its estimate is that of the other.

    Attributes:
        inner: The other filter's belief.
    """

    inner: Any

    @property
    def mean(self) -> Array:
        """State estimate (runs, n)."""
        mean: Array = self.inner.mean
        return mean

    @property
    def covariance(self) -> Array:
        """Covariance of its error (runs, n, n)."""
        covariance: Array = self.inner.covariance
        return covariance


B = TypeVar("B")


def believed_noise(filter: Filter, belief: Any, epoch: int) -> Array | None:
    """Return R with which a filter takes the next measurement, (runs, m, m) or (m, m); None: the measurement's own.

    A filter that scales or estimates R says so by ``believed_noise(belief, epoch)``. What it says of channels that are
    absent counts for nothing.
    """
    own: Callable[[Any, int], Array | None] | None = getattr(filter, "believed_noise", None)
    return None if own is None else own(belief, epoch)


def considered_states(dynamics: Dynamics) -> tuple[int, ...]:
    """Return the places of the states that are accounted for but not estimated.

    Dynamics say so by an attribute ``considered``, as `AugmentedDynamics` has; without it there are none.
    """
    return tuple(getattr(dynamics, "considered", ()))


def keep_considered(predicted: Gaussian, corrected: Gaussian, considered: tuple[int, ...]) -> Gaussian:
    """Return the update of Schmidt's filter (NASA TN D-1493, 1962) from the optimal one.

    Schmidt's gain is the optimal one with the rows of the considered states set to zero. That leaves their mean and
    covariance as predicted, and all else, the correlations included, as in the optimal update: with K = [K_x; 0],
    (I - K H) P (I - K H)^T + K R K^T differs from the optimal covariance in the considered block alone.
    """
    if not considered:
        return corrected
    places = list(considered)
    block = np.ix_(range(len(corrected.mean)), places, places)
    mean, covariance = corrected.mean.copy(), corrected.covariance.copy()
    mean[:, places] = predicted.mean[:, places]
    covariance[block] = predicted.covariance[block]
    return replace(corrected, mean=mean, covariance=covariance)


def where_runs(condition: Mask, chosen: B, other: B) -> B:
    """Return a belief that takes the runs where `condition` (runs,) holds from `chosen`, the rest from `other`.

    Fields without a leading axis of runs (random streams, say) come from `chosen`; a belief within is mixed likewise.
    """
    mixed: dict[str, Any] = {}
    for item in fields(chosen):  # type: ignore[arg-type]  # beliefs are dataclasses; Protocols cannot say so
        new, old = getattr(chosen, item.name), getattr(other, item.name)
        if isinstance(new, np.ndarray):
            mixed[item.name] = np.where(condition.reshape(-1, *[1] * (new.ndim - 1)), new, old)
        elif hasattr(new, "covariance"):
            mixed[item.name] = where_runs(condition, new, old)
    return replace(chosen, **mixed)  # type: ignore[type-var]  # as above


def in_kind(belief: B, kind: Kind) -> B:
    """Return a belief whose numbers are of a type of floating-point numbers; counts and truth values stay."""
    made: dict[str, Any] = {}
    for item in fields(belief):  # type: ignore[arg-type]  # as in `where_runs`
        value = getattr(belief, item.name)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f":
            made[item.name] = np.ascontiguousarray(value, dtype=kind)
    return replace(belief, **made)  # type: ignore[type-var]  # as in `where_runs`


def in_c_order(belief: B) -> B:
    """Return a belief whose arrays lie in memory in C order.

    Sums may be taken in the order of memory. With several sensors an update begins with a prediction, or with another
    sensor's update of all runs or of some, as the block has it; its bits must not depend on which.
    """
    ordered: dict[str, Any] = {}
    for item in fields(belief):  # type: ignore[arg-type]  # as in `where_runs`
        value = getattr(belief, item.name)
        if isinstance(value, np.ndarray) and not value.flags.c_contiguous:
            ordered[item.name] = np.ascontiguousarray(value)
        elif hasattr(value, "covariance"):
            ordered[item.name] = in_c_order(value)
    if not ordered:
        return belief
    return replace(belief, **ordered)  # type: ignore[type-var]  # as in `where_runs`

"""Measurements as a filter sees them: the interface, and what follows from its functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any, Protocol

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.linalg import kernel_for, log_density, matrices, mixture_log_density

Linearised = Callable[[Array, Array, int], tuple[Array, Array, Array]]
SquaredErrors = Callable[[Array, Array, Array, Array, Array, int], Array]


@dataclass(frozen=True)
class CompiledUpdate:
    """A filter's update in compiled code.

    Args:
        kernel: Name of the kernel in `kernels.epochs`.
        settings: What that needs to know of the filter.
        extras: Names of the further numbers that it gives.
    """

    kernel: str
    settings: Any
    extras: tuple[str, ...] = ()


@dataclass(frozen=True)
class Stretch:
    """Consecutive epochs that are filtered in one go, and room for what comes of them.

    Args:
        z: Measurements (K, runs, m), complete where they are.
        read: Where there is one, (K, runs).
        mean: To be filled, (K, runs, n), as the others.
        covariance: (K, runs, n, n).
        nis: (K, runs); NaN without a measurement.
        log_likelihood: (K, runs); 0 without a measurement.
        extras: The filter's further numbers by name, which are put here, (K, runs); NaN without a measurement.
    """

    z: Array
    read: Mask
    mean: Array
    covariance: Array
    nis: Array
    log_likelihood: Array
    extras: dict[str, Array] = field(default_factory=dict)

    def filled(
        self,
        mean: Array,
        covariance: Array,
        F: Array,
        Q: Array,
        update: CompiledUpdate,
        converted: bool,
        radar: tuple[Array, Array, Array],
    ) -> int:
        """Fill it by a kernel of `kernels.epochs` with a radar's M, A and c; return for how many epochs."""
        in_order = np.ascontiguousarray
        given = in_order(mean), in_order(covariance), in_order(F), in_order(Q), in_order(self.z), in_order(self.read)
        extras = np.empty((len(self.z), len(update.extras), self.z.shape[1]))
        filled = self.mean, self.covariance, self.nis, self.log_likelihood, extras
        taken: int = getattr(kernels.epochs, update.kernel)(*given, converted, *radar, update.settings, *filled)
        self.extras.update(zip(update.extras, extras.swapaxes(0, 1), strict=True))
        return taken


@dataclass(frozen=True)
class Mixture:
    """The components of a mixture noise at one epoch: weights (k,), covariances (k, m, m) or (runs, k, m, m)."""

    weights: Array
    covariances: Array
    shared: bool


def joint_components(mixture: Mixture) -> tuple[Array, Array]:
    """Return weights (k,) and covariances (k, m, m) or (runs, k, m, m) of a mixture as one switch for all channels.

    Channels that switch by themselves give every combination of their components.
    """
    if mixture.shared:
        return mixture.weights, mixture.covariances
    k, m = mixture.covariances.shape[-3], mixture.covariances.shape[-1]
    choices = np.stack(np.meshgrid(*[np.arange(k)] * m, indexing="ij"), axis=-1).reshape(-1, m)
    variances = np.einsum("...kii->...ki", mixture.covariances)[..., choices, np.arange(m)]
    return mixture.weights[choices].prod(axis=-1), variances[..., None] * np.eye(m)


class Measurement(Protocol):
    """What a sensor should read in a given state, z = h(x) + v, and how noisy the measurement is."""

    dimension: int

    def predict(self, states: Array, epoch: int) -> Array:
        """Return h(states), (runs, ..., n) -> (runs, ..., m)."""
        ...

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx at `states` (runs, ..., n): (runs, ..., m, n), or (m, n) where it is constant."""
        ...

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return the covariance R of v at `mean` (runs, n): (m, m) or (runs, m, m)."""
        ...

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of v where it is a Gaussian mixture, else None."""
        ...

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return z - predicted with angles wrapped to [-pi, pi); shapes broadcast, last axis m."""
        ...

    def log_likelihood(self, z: Array, states: Array, epoch: int) -> Array:
        """Return log p(z | states) for z (runs, m) and states (runs, ..., n): (runs, ...)."""
        ...


class Turnable(Measurement, Protocol):
    """A measurement that can say what a small turn of its host does to it."""

    def turning(self, states: Array, epoch: int) -> Array:
        """Return the derivatives of the measurement by the turn, (runs, ..., m, 3)."""
        ...


def wrap_angle(angle: Array) -> Array:
    """Return the angle in [-pi, pi], rad. A value already inside is returned to the last bit."""
    return angle - 2 * np.pi * np.rint(angle / (2 * np.pi))


_PARTS = {
    "linearised": ("predict", "jacobian", "noise", "residual", "angles"),
    "squared_errors": ("predict", "jacobian", "residual", "angles"),
    "filtered": ("linearised", "squared_errors", "predict", "jacobian", "noise", "residual", "angles"),
}
"""What a measurement may do in one go, and what it then stands for."""


def depth(kind: type, name: str) -> int:
    """Return how far up among the bases of a class a function is said."""
    return next(depth for depth, base in enumerate(kind.__mro__) if name in vars(base))


@lru_cache(maxsize=256)
def _parts(kind: type, whole: str) -> frozenset[str]:
    """Return what counts as a part of what a class does in one go: such parts, or private ones of who says it."""
    says = kind.__mro__[depth(kind, whole)]
    private = [name for name in dir(says) if name.startswith("_") and not name.startswith("__")]
    return frozenset([*_PARTS[whole], *private])


def _is_replaced(kind: type, whole: str) -> bool:
    """Return whether a class has parts of its own of what a base does in one go."""
    said = depth(kind, whole)
    return any(depth(kind, part) < said for part in _parts(kind, whole))


@lru_cache(maxsize=64)
def _places(angles: tuple[int, ...]) -> Indices:
    return np.array(angles, dtype=np.int64)


class MeasurementDefaults:
    """The parts of a measurement that follow from the others; a measurement may replace any.

    Attributes:
        angles: Components of z that are angles, rad.
        depends_on: States that z depends on; None: any. Sampling filters draw only those.
        states: Number n of states it is for; None: any.
        whole: Whether a measurement counts with all its channels only (a converted position, say); one with a channel
            missing is then missing altogether.
    """

    angles: tuple[int, ...] = ()
    depends_on: tuple[int, ...] | None = None
    states: int | None = None
    whole: bool = False

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Let what a base does in one go follow from the parts again, where a class has other parts and says no more.

        A subclass of a radar, say, that only changes `predict`, or what the radar's `noise` calls, would else still be
        linearised as the radar.
        """
        super().__init_subclass__(**arguments)
        for whole in _PARTS:
            if _is_replaced(cls, whole):
                setattr(cls, whole, getattr(MeasurementDefaults, whole))

    def __setattr__(self, name: str, value: Any) -> None:
        """Let the same follow where it is one measurement that is given another part, as by `radar.noise = f`.

        Angles that its class leaves open are not others when they are first given.
        """
        own: type = type(self)
        is_other = name != "angles" or name in vars(self) or type(self).angles is not MeasurementDefaults.angles
        super().__setattr__(name, value)
        for whole in _PARTS if is_other else ():
            if name in _parts(own, whole) and whole not in vars(self):
                super().__setattr__(whole, partial(getattr(MeasurementDefaults, whole), self))

    def __copy__(self) -> MeasurementDefaults:
        """Return a copy that follows from its own parts, where what is done in one go follows from parts assigned."""
        copied = object.__new__(type(self))
        vars(copied).update(vars(self))
        for whole in _PARTS:
            follows = vars(self).get(whole)
            if isinstance(follows, partial) and follows.args == (self,):
                vars(copied)[whole] = partial(follows.func, copied)
        return copied

    def take(self, z: Array, first_epoch: int) -> Array:
        """Return the measurements (runs, K, m) of the epochs from `first_epoch` on as they are to be filtered.

        Called once for every chunk of epochs, before the chunk is filtered, so that a measurement can learn what
        arrives during a run. By default the measurements themselves.
        """
        return z

    def predict(self, states: Array, epoch: int) -> Array:
        """Return h(states)."""
        raise TypeError(f"{type(self).__name__} has no predict(states, epoch)")

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R."""
        raise TypeError(f"{type(self).__name__} has no noise(mean, epoch)")

    def turning(self, states: Array, epoch: int) -> Array:
        """Return the derivatives of the measurement by a small turn of the sensor's host, rad, (runs, ..., m, 3).

        About the sensor's axes; a turn dtheta takes a line of sight u to u + u x dtheta. Needed where augmented states
        turn the host by `turns` of their distortion.
        """
        raise TypeError(f"{type(self).__name__} has no turning(states, epoch)")

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return None: the noise is Gaussian."""
        return None

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return z - predicted with the components in `angles` wrapped."""
        if not self.angles:
            return z - predicted
        longer = z if z.size > predicted.size else predicted
        if z.ndim == predicted.ndim > 1 and longer.flags.c_contiguous:
            of, to = (z[None], predicted[None]) if z.ndim == 2 else (z, predicted)
            (runs, p, *rest), (others, q, *m) = of.shape, to.shape
            if of.ndim == 3 and runs == others and rest == m and (p == q or min(p, q) == 1):
                found = kernels.angles.difference(matrices(of), matrices(to), _places(tuple(self.angles)))
                return found.reshape(longer.shape)
        # Of other shapes, or with the points of a run last in memory, where they stay for whoever sums along them.
        difference: Array = z - predicted
        for component in self.angles:
            difference[..., component] = wrap_angle(difference[..., component])
        return difference

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx by central differences, (runs, ..., m, n)."""
        n = states.shape[-1]
        columns = []
        for j in range(n):
            # Cube root of the rounding error balances truncation against cancellation.
            width = np.cbrt(np.finfo(float).eps) * np.maximum(np.abs(states[..., j]), 1.0)
            ahead, behind = states.copy(), states.copy()
            ahead[..., j] += width
            behind[..., j] -= width
            change = self.residual(self.predict(ahead, epoch), self.predict(behind, epoch))
            columns.append(change / (ahead[..., j] - behind[..., j])[..., None])
        return np.stack(columns, axis=-1)

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return z - h(mean), dh/dx and R at the means (runs, n): what an update linearised there needs.

        A measurement may have it cheaper in one; a filter asks by the function `linearised`.
        """
        return one_by_one(self, z, mean, epoch)

    def squared_errors(self, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int) -> Array:
        """Return |W (z - h(x))|^2 of the samples x = centre + root e; a filter asks by the function of this name.

        A measurement may have it cheaper than by the states themselves.
        """
        return squares_of_states(self, z, W, centre, root, e, epoch)

    def filtered(
        self, mean: Array, covariance: Array, F: Array, Q: Array, update: CompiledUpdate, stretch: Stretch
    ) -> int | None:
        """Fill a stretch by a filter with linear dynamics; return for how many epochs, None: it can't for any.

        A measurement that has it in compiled code gives what the filter gives from epoch to epoch, to the last bit. It
        stops before an epoch in which a run needs more than the compiled update.

        Args:
            mean: One epoch before the first, (runs, n).
            covariance: Its covariance (runs, n, n).
            F: Transition matrices (K, n, n), or (1, n, n) for all epochs.
            Q: Process noise alike.
            update: The filter's update.
            stretch: The epochs.
        """
        return None

    def log_likelihood(self, z: Array, states: Array, epoch: int) -> Array:
        """Return log p(z | states) under the mixture where there is one, else under N(0, R)."""
        extra = states.ndim - 2
        spread = (slice(None), *[None] * extra)
        residual = self.residual(z[spread], self.predict(states, epoch))
        mean = states.reshape(len(states), -1, states.shape[-1]).mean(axis=1)
        mixture = self.mixture(mean, epoch)
        if mixture is None:
            return log_density(residual, self.noise(mean, epoch))
        return mixture_log_density(residual, mixture.weights, mixture.covariances, mixture.shared)


def linearised(measurement: Measurement, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
    """Return residual (runs, m), Jacobian and R of a measurement z at the means (runs, n).

    By the measurement's own ``linearised(z, mean, epoch)`` where it has one.
    """
    own: Linearised | None = getattr(measurement, "linearised", None)
    return one_by_one(measurement, z, mean, epoch) if own is None else own(z, mean, epoch)


def one_by_one(measurement: Any, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
    """Return the same as `linearised` by the measurement's other functions."""
    residual = measurement.residual(z, measurement.predict(mean, epoch))
    return residual, measurement.jacobian(mean, epoch), measurement.noise(mean, epoch)


def squared_errors(
    measurement: Measurement, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int
) -> Array:
    """Return |W (z - h(x))|^2 of the samples x = centre + root e, (runs, N).

    By the measurement's own ``squared_errors(z, W, centre, root, e, epoch)`` where it has one.

    Args:
        measurement: The measurement.
        z: Measurements (runs, m).
        W: Whitening, lower triangular, (runs, m, m), or (1, m, m) for all runs.
        centre: (runs, n).
        root: (runs, n, d).
        e: (runs, d, N), or (1, d, N) for all runs.
        epoch: Their epoch.
    """
    own: SquaredErrors | None = getattr(measurement, "squared_errors", None)
    if own is None:
        return squares_of_states(measurement, z, W, centre, root, e, epoch)
    return own(z, W, centre, root, e, epoch)


def squares_of_states(measurement: Any, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int) -> Array:
    """Return the same by the measurement's other functions."""
    residuals = sample_residuals(measurement, z, affine(centre, root, e), epoch)
    errors: Array = kernel_for(residuals, kernels.sampling, "squared")(residuals, W)
    return errors


def squares_of_linear(
    measurement: Measurement, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int
) -> Array:
    """Return the same where dh/dx is constant, (m, n)."""
    residual = measurement.residual(z, measurement.predict(centre, epoch))
    moved = measurement.jacobian(centre, epoch) @ root
    return kernels.sampling.squared_linear(*map(np.ascontiguousarray, (residual, moved, W, e)))


def sample_residuals(measurement: Any, z: Array, states: Array, epoch: int) -> Array:
    """Return z - h(states) with the samples last, (runs, m, N), of measurements (runs, m) and states (runs, N, n)."""
    residual = measurement.residual(z[:, None], measurement.predict(states, epoch))
    return np.ascontiguousarray(residual.swapaxes(1, 2))


def affine(centre: Array, root: Array, e: Array) -> Array:
    """Return the states centre + root e, (runs, N, n).

    They lie in memory with the samples last: a component's arithmetic then runs along them.
    """
    runs, n, d = root.shape
    # One product for all, [root centre] [e; 1]: adding the centre would cost another pass over memory.
    factor = np.empty((runs, n, d + 1), root.dtype)
    factor[:, :, :d], factor[:, :, d] = root, centre
    states: Array = factor @ np.concatenate([e, np.ones((len(e), 1, e.shape[2]), e.dtype)], axis=1)
    return states.swapaxes(1, 2)


def has_own_density(measurement: Measurement) -> bool:
    """Whether a measurement brings a log_likelihood of its own instead of the one that follows from its noise."""
    own = getattr(measurement, "log_likelihood", None)
    return own is not None and getattr(own, "__func__", own) is not MeasurementDefaults.log_likelihood

"""The loop over epochs: a filter, a block of measurements, a history."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relnav_sim.filters.belief import Filter, Gaussian, Innovation, where_runs
from relnav_sim.filters.returned import Returned, check_name
from relnav_sim.models.dynamics import Step
from relnav_sim.streams import RandomSource

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FilterHistory:
    """What a filter said at every epoch.

    Args:
        mean: State estimate after the measurement, (runs, T, n).
        covariance: Its covariance, (runs, T, n, n).
        nis: Normalised innovation squared, (runs, T); NaN where there was no measurement.
        log_likelihood: log p(z_k | earlier z), (runs, T); 0 where there was no measurement.
        extras: Further numbers of the algorithm by name, each (runs, T); NaN where there was no measurement.
    """

    mean: Array
    covariance: Array
    nis: Array
    log_likelihood: Array
    extras: Mapping[str, Array]


def run_filter(
    filter: Filter,
    z: ArrayLike,
    mean0: ArrayLike,
    cov0: ArrayLike,
    seed: int = 0,
    runs: Sequence[int] | None = None,
    step_s: float = 1.0,
) -> FilterHistory:
    """Run a filter over a block of measurements: each epoch predicts, then updates.

    Args:
        filter: From `create_filter`, or any object of the same interface.
        z: Measurements (runs, T, m). Any NaN in a row means that the row is missing: predict only.
        mean0: State estimate one step before the first measurement, (runs, n) or (n,).
        cov0: Its covariance, (runs, n, n) or (n, n).
        seed: Seed of the filter's random numbers.
        runs: Run numbers for the random streams, default 0, 1, ...; the same run number gets the same numbers
            whatever the block.
        step_s: Time between epochs, s, for dynamics that ask for it.

    Raises:
        ValueError: Shapes do not fit together.
    """
    z = np.asarray(z, dtype=float)
    if z.ndim != 3:
        raise ValueError(f"z has shape {z.shape}; it must be (runs, T, m)")
    B, n = len(z), filter.dynamics.dimension
    if z.shape[2] != filter.measurement.dimension:
        raise ValueError(f"z has {z.shape[2]} components, the measurement {filter.measurement.dimension}")
    try:
        mean = np.broadcast_to(np.asarray(mean0, dtype=float), (B, n)).copy()
        covariance = np.broadcast_to(np.asarray(cov0, dtype=float), (B, n, n)).copy()
    except ValueError:
        raise ValueError(
            f"mean0 has shape {np.shape(mean0)} and cov0 {np.shape(cov0)}; "
            f"for {B} runs of {n} states they must be ({B}, {n}) and ({B}, {n}, {n})"
        ) from None
    runs = tuple(range(B)) if runs is None else tuple(runs)
    if len(runs) != B:
        raise ValueError(f"{len(runs)} run numbers for {B} runs")
    with np.errstate(all="ignore"):  # for the reason in `advance`
        belief = filter.start(Gaussian(mean, covariance), RandomSource(seed, runs))
    return advance(filter, belief, z, first_epoch=0, step_s=step_s)[1]


def advance(
    filter: Filter,
    belief: Any,
    z: Array,
    first_epoch: int,
    step_s: float,
    reached: Callable[[int], None] = lambda epoch: None,
) -> tuple[Any, FilterHistory]:
    """Carry a belief over a stretch of epochs; return the last belief and the stretch's history.

    Args:
        filter: The filter.
        belief: Belief one step before z[:, 0].
        z: Measurements of the stretch, (runs, K, m).
        first_epoch: Number of the stretch's first epoch.
        step_s: Time between epochs, s.
        reached: Told of every epoch that begins.

    Raises:
        ValueError: The filter has returned something else than arrays of the right type and shape.
    """
    _keep_freed_memory()
    B, K, _ = z.shape
    n = filter.dynamics.dimension
    mean, covariance = np.empty((B, K, n)), np.empty((B, K, n, n))
    nis, log_likelihood = np.full((B, K), np.nan), np.zeros((B, K))
    extras: dict[str, Array] = {}
    present = np.asarray(~np.isnan(z).any(axis=2))
    z = z.view()
    z.flags.writeable = False  # it is the other filters' too
    returned = Returned(B, n)
    belief = returned.belief(belief, "start")
    # A diverging run turns to inf and NaN in its own row; its failure is reported from there.
    with np.errstate(all="ignore"):
        for k in range(K):
            step = Step(first_epoch + k, step_s)
            reached(step.epoch)
            belief = returned.belief(filter.predict(belief, step), "predict")
            if filter.stochastic or present[:, k].any():
                belief, innovation = _update_present(filter, belief, z[:, k], present[:, k], step, returned)
                nis[:, k] = innovation.nis
                log_likelihood[:, k] = innovation.log_likelihood
                for name, value in innovation.extras.items():
                    if name not in extras:
                        check_name(name)
                        extras[name] = np.full((B, K), np.nan)
                    extras[name][:, k] = value
            mean[:, k] = returned.moment(belief, "mean")
            covariance[:, k] = returned.moment(belief, "covariance")
    return belief, FilterHistory(mean, covariance, nis, log_likelihood, extras)


def _update_present(
    filter: Filter, belief: Any, z: Array, present: NDArray[np.bool_], step: Step, returned: Returned
) -> tuple[Any, Innovation]:
    if present.all():
        return returned.update(filter.update(belief, z, step))
    # A missing row is given its own prediction, so that the arithmetic stays harmless; the result is not used.
    expected = filter.measurement.predict(belief.mean, step.epoch)
    posterior, innovation = returned.update(filter.update(belief, np.where(present[:, None], z, expected), step))
    return where_runs(present, posterior, belief), Innovation(
        np.where(present, innovation.nis, np.nan),
        np.where(present, innovation.log_likelihood, 0.0),
        {name: np.where(present, value, np.nan) for name, value in innovation.extras.items()},
    )


def _keep_freed_memory() -> None:
    """Let the allocator keep what is freed for the next epoch instead of returning it to the kernel.

    glibc returns freed memory above twice the largest block it has seen freed; faulting a few MB in again at every
    epoch then costs more than the sampling itself (measured: 48 us a run-step instead of 14 with 512 samples and
    200 runs). Freeing one large block, never touched, raises that bound. Elsewhere it does nothing.
    """
    largest_that_counts = 31 << 20  # bytes; glibc's DEFAULT_MMAP_THRESHOLD_MAX is 32 MiB
    np.empty(largest_that_counts, dtype=np.uint8)

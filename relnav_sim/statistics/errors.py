"""Per-run statistics at full rate, gathered while a block of runs is simulated.

Everything is kept per run and computed by itself per run: any split of the runs into blocks gives the same bits,
as long as the chunks of epochs are the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim import kernels
from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.results import layout
from relnav_sim.results.block import Failure, FilterResult
from relnav_sim.results.covariance_root import covariance_roots
from relnav_sim.statistics import consistency, moments, quantiles
from relnav_sim.statistics.convergence import RELATIVE_CONVERGENCE, Convergence
from relnav_sim.statistics.convergence_seen import hold_epochs
from relnav_sim.statistics.readings import CommonDof, NisOfSensors, ReadingSeries

NO_MEAN = "non-finite mean"
NO_COVARIANCE = "non-finite covariance"
NOT_DEFINITE = "covariance not positive definite"
_NEVER = np.iinfo(np.int64).max


@dataclass(frozen=True)
class ScoringRules:
    """How errors are turned into figures.

    Attributes:
        step_s: Time between epochs, s.
        epochs: Number of epochs of a run, the start (epoch 0) included.
        store_every: Every how many epochs the series is stored.
        settle_s: Start of the settled span, s.
        convergence_m: Threshold of the convergence time, m.
        convergence_hold_s: How long the error must stay below it, s.
        store_covariance: Whether the covariance is stored whole with the series.
    """

    step_s: float
    epochs: int
    store_every: int
    settle_s: float
    convergence_m: float
    convergence_hold_s: float
    store_covariance: bool = False

    @property
    def stored_s(self) -> Array:
        """The stored epochs, s."""
        return self.step_s * np.arange(0, self.epochs, self.store_every, dtype=np.float64)

    @property
    def settled_epoch(self) -> int:
        """The first epoch with t >= settle_s (up to rounding of the division), and never the start."""
        return max(1, int(np.ceil(self.settle_s / self.step_s - 1e-9)))

    @property
    def late_epoch(self) -> int:
        """The first epoch of the run's last half."""
        return self.epochs // 2


@dataclass(frozen=True)
class _SpanSums:
    """Everything that is added up over a span of epochs; two successive spans can be merged."""

    errors: moments.Moments
    nees: consistency.NeesSums
    nis: consistency.NisSums
    alike: consistency.NisSums
    sensors: tuple[consistency.SensorSums, ...]
    log_likelihood: Array


@dataclass(frozen=True)
class _Nis:
    """The NIS of some epochs: as it is, at common degrees of freedom, and both by sensor with its degrees."""

    nis: Array
    alike: Array
    sensors: tuple[tuple[Array, Array, Integers], ...]


class ErrorAccumulator:
    """Takes successive chunks of a block's estimates and gives the filter's results at the end.

    Args:
        runs: Number of runs in the block.
        rules: How errors are turned into figures.
    """

    def __init__(self, runs: int, rules: ScoringRules) -> None:
        self.rules = rules
        self._runs = runs
        self._limits = consistency.nees_limits()
        self._next_epoch: int | None = None
        self._failed_epoch = np.full(runs, _NEVER)
        self._reasons = [""] * runs
        no_nis = consistency.no_nis(runs)
        empty = _SpanSums(
            moments.no_moments(len(layout.QUANTITIES), runs),
            consistency.no_nees(runs),
            no_nis,
            no_nis,
            (),
            np.zeros(runs),
        )
        self._spans = {"early": empty, "settled": empty}
        bins = (len(layout.NORMS), runs, quantiles.BINS)
        self._bins: dict[str, quantiles.Counts] = {name: np.zeros(bins, dtype=np.int32) for name in self._spans}
        self._common = CommonDof(runs)
        self._common_by: dict[str, CommonDof] = {}
        self._readings: ReadingSeries | None = None
        self._late = np.zeros((2, runs), dtype=np.int64)
        self._extras: dict[str, Array] = {}
        held = hold_epochs(rules.convergence_hold_s, rules.step_s)
        self._convergence = Convergence(runs, rules.convergence_m, held)
        lengths = layout.sizes(runs, len(rules.stored_s))
        self._series = {
            spec.name: np.full(layout.shape(spec, lengths), np.nan, dtype=spec.dtype)
            for spec in (*layout.SERIES, *((layout.COVARIANCE,) if rules.store_covariance else ()))
        }

    @property
    def failed_epoch(self) -> Integers:
        """The first epoch of each run that failed so far (runs,); -1: none."""
        return np.where(self._failed_epoch == _NEVER, -1, self._failed_epoch)

    def add(
        self,
        times_s: Array,
        error: Array,
        covariance: Array,
        nis: Array,
        log_likelihood: Array,
        extras: Mapping[str, Array] | None = None,
        stated: Mapping[int, tuple[int, str]] | None = None,
        by_sensor: NisOfSensors | None = None,
    ) -> None:
        """Count the next chunk of epochs. The start (epoch 0) may be given; it is stored but not counted.

        Args:
            times_s: (K,), s; continues where the last chunk ended, the first begins at epoch 0 or 1.
            error: Estimate minus truth, RTN, (runs, K, 6), m and m/s.
            covariance: What the filter states, (runs, K, 6, 6).
            nis: Normalised innovation squared (runs, K); NaN without a measurement.
            log_likelihood: Log likelihood of the measurement (runs, K); 0 without one.
            extras: Further numbers of the filter by name (runs, K); NaN where there is none.
            stated: Epoch and reason of the failures that the filter itself states, by the run's place in the block.
            by_sensor: The NIS of each sensor with its degrees of freedom, where the filter tells them apart; then of
                the same sensors in every chunk.

        Raises:
            ValueError: The chunk does not continue the last one, or shapes do not fit.
        """
        first = self._advance(times_s, error, covariance)
        shape = error.shape[:2]
        error, log_likelihood = np.ascontiguousarray(error), np.ascontiguousarray(log_likelihood)
        nees, definite, finite = consistency.normalised_errors(error, covariance)
        self._find_failures(first, error, definite, finite, stated or {})
        epochs = np.arange(first, first + shape[1])
        sound = epochs < self._failed_epoch[:, None]
        self._store(epochs, error, covariance, nis, nees[0], sound)
        innovations = _Nis(nis, nis, ())
        if by_sensor is not None and by_sensor.nis:
            self._readings_of(by_sensor).add(epochs, by_sensor, sound)
            innovations = self._innovations(nis, by_sensor)
        late = sound & (epochs >= self.rules.late_epoch)
        self._late = self._late + np.stack([late.sum(axis=1), (late & ~(nees[0] <= self._limits[0, -1])).sum(axis=1)])
        for name, values in (extras or {}).items():
            counted = sound & np.isfinite(values)
            total = np.where(counted, values, 0.0).sum(axis=1)
            before = self._extras.get(name, np.zeros((2, self._runs)))
            self._extras[name] = before + np.stack([counted.sum(axis=1), total])
        start = 1 if first == 0 else 0
        border = min(max(self.rules.settled_epoch - first, start), shape[1])
        distance = np.full(shape, np.inf)
        with np.errstate(over="ignore", invalid="ignore"):
            for name, part in (("early", slice(start, border)), ("settled", slice(border, shape[1]))):
                if part.start < part.stop:
                    span = self._span(name, part, error, nees, innovations, log_likelihood, sound, distance)
                    self._spans[name] = _merged(self._spans[name], span)
            if start < shape[1]:
                self._convergence.add(distance[:, start:])

    def failures(self, filter: str, runs: Sequence[int]) -> tuple[Failure, ...]:
        """Return the failures as rows of the results; ``runs`` are the numbers of the block's runs."""
        return tuple(
            Failure(run, filter, int(epoch), reason)
            for run, epoch, reason in zip(runs, self._failed_epoch, self._reasons, strict=True)
            if epoch != _NEVER
        )

    def result(self, cpu_us_per_step: float = np.nan) -> FilterResult:
        """Return the filter's results over everything counted.

        Args:
            cpu_us_per_step: CPU time of the filter per run and epoch, us.
        """
        settled = self._spans["settled"]
        with np.errstate(over="ignore", invalid="ignore"):
            whole = _merged(self._spans["early"], settled)
            bins = self._bins["settled"]
            spans = [_span_figures(whole, self._bins["early"] + bins), _span_figures(settled, bins)]
            threshold = RELATIVE_CONVERGENCE * spans[1]["rms"][:, layout.QUANTITIES.index("r")]
        step_s = self.rules.step_s
        summary: dict[str, NDArray[Any]] = {name: np.stack([span[name] for span in spans], axis=1) for name in spans[0]}
        summary |= {
            "failed": (self._failed_epoch != _NEVER).astype(np.int8),
            "failed_epoch": self.failed_epoch,
            "convergence": self._convergence.below_threshold() * step_s,
            "convergence_relative": self._convergence.below(threshold) * step_s,
            "convergence_final": self._convergence.below_to_the_end() * step_s,
            "convergence_level": np.stack(
                [self._convergence.below_edge(threshold) * step_s for threshold in layout.THRESHOLDS_M], axis=1
            ),
            "outside_late": _share(self._late[1], self._late[0]),
            "cpu_per_step": np.full(self._runs, cpu_us_per_step),
        }
        diagnostics = {name: _share(total, count) for name, (count, total) in self._extras.items()}
        by_sensor = None if self._readings is None else self._readings.result([whole.sensors, settled.sensors])
        return FilterResult(
            summary,
            **self._series,
            diagnostics=diagnostics,
            augmented=None,
            by_sensor=by_sensor,
            editing=None,
            by_channel=None,
        )

    def _advance(self, times_s: Array, error: Array, covariance: Array) -> int:
        runs, K = self._runs, len(times_s)
        if error.shape != (runs, K, 6) or covariance.shape != (runs, K, 6, 6) or K == 0:
            raise ValueError(f"error {error.shape} and covariance {covariance.shape} for {runs} runs, {K} epochs")
        first = round(float(times_s[0]) / self.rules.step_s)
        if first not in ((0, 1) if self._next_epoch is None else (self._next_epoch,)):
            raise ValueError(f"the chunk begins at epoch {first}, not at {self._next_epoch or 'the start'}")
        self._next_epoch = first + K
        if self._next_epoch > self.rules.epochs:
            raise ValueError(f"the chunk ends beyond the run's {self.rules.epochs} epochs")
        return first

    def _find_failures(
        self, first: int, error: Array, definite: Mask, finite: Mask, stated: Mapping[int, tuple[int, str]]
    ) -> None:
        # A sum is finite only if all its terms are, and one product with ones is quicker than looking at each. Terms
        # that overflow only when added are as good as infinite here.
        with np.errstate(over="ignore", invalid="ignore"):
            mean_ok = np.isfinite(error @ np.ones(6))
        ok = mean_ok & finite & definite
        if ok.all():
            return
        for run in np.flatnonzero(~ok.all(axis=1) & (self._failed_epoch == _NEVER)).tolist():
            k = int(np.argmin(ok[run]))
            self._failed_epoch[run] = first + k
            epoch, reason = stated.get(run, (first + k, ""))
            if not reason or epoch != first + k:
                reason = NO_MEAN if not mean_ok[run, k] else NO_COVARIANCE if not finite[run, k] else NOT_DEFINITE
            self._reasons[run] = reason

    def _store(self, epochs: Integers, error: Array, covariance: Array, nis: Array, nees: Array, sound: Mask) -> None:
        chosen = np.flatnonzero(epochs % self.rules.store_every == 0)
        rows = epochs[chosen] // self.rules.store_every
        good = sound[:, chosen]
        variances = np.diagonal(covariance[:, chosen], axis1=-2, axis2=-1)
        with np.errstate(over="ignore", invalid="ignore"):
            self._series["error"][:, rows] = np.where(good[..., None], error[:, chosen], np.nan)
            self._series["sigma"][:, rows] = np.where(good[..., None], np.sqrt(variances), np.nan)
            self._series["nis"][:, rows] = np.where(good, nis[:, chosen], np.nan)
            self._series["nees"][:, rows] = np.where(good, nees[:, chosen], np.nan)
            if self.rules.store_covariance:
                # Epochs first, as covariances lie in memory; a slice spares the copy where every epoch is stored.
                every = slice(-int(epochs[0]) % self.rules.store_every, None, self.rules.store_every)
                roots = covariance_roots(covariance.swapaxes(0, 1)[every]).swapaxes(0, 1)
                known = roots if good.all() else np.where(good[..., None], roots, np.nan)
                self._series[layout.COVARIANCE.name][:, rows] = known

    def _readings_of(self, given: NisOfSensors) -> ReadingSeries:
        """Return where the measurements of these sensors are stored; begin with it at the first chunk."""
        if self._readings is None:
            names, runs = tuple(given.nis), self._runs
            self._readings = ReadingSeries(runs, len(self.rules.stored_s), self.rules.store_every, names)
            self._common_by = {name: CommonDof(runs) for name in names}
            nothing = tuple(consistency.no_sensor(runs) for _ in names)
            self._spans = {name: replace(span, sensors=nothing) for name, span in self._spans.items()}
        return self._readings

    def _innovations(self, nis: Array, given: NisOfSensors) -> _Nis:
        with np.errstate(invalid="ignore"):
            alike = self._common.alike(nis, np.add.reduce(list(given.dof.values())))
            sensors = tuple(
                (given.nis[name], common.alike(given.nis[name], given.dof[name]), given.dof[name])
                for name, common in self._common_by.items()
            )
        return _Nis(nis, alike, sensors)

    def _span(
        self,
        name: str,
        epochs: slice,
        error: Array,
        nees: Array,
        innovations: _Nis,
        log_likelihood: Array,
        sound: Mask,
        distance: Array,
    ) -> _SpanSums:
        """Return the sums over some epochs of a chunk, (runs, K); fill in where the estimates are off by how much."""
        count, sums, totals, inside = kernels.counting.errors(
            error,
            nees,
            log_likelihood,
            sound,
            epochs.start,
            epochs.stop,
            self._limits,
            quantiles.BIN_RULE,
            self._bins[name],
            distance,
        )
        nis = consistency.nis_sums(innovations.nis, sound, epochs)
        alike = nis if innovations.alike is innovations.nis else consistency.nis_sums(innovations.alike, sound, epochs)
        single = len(innovations.sensors) == 1
        sensors = tuple(
            consistency.sensor_sums(
                alike if single else consistency.nis_sums(like, sound, epochs), own, dof, sound, epochs
            )
            for own, like, dof in innovations.sensors
        )
        return _SpanSums(
            moments.Moments(count, *sums),
            consistency.NeesSums(count, totals[:-1], inside),
            nis,
            alike,
            sensors,
            totals[-1],
        )


def _share(part: NDArray[Any], count: NDArray[Any]) -> Array:
    return np.where(count > 0, part / np.maximum(count, 1), np.nan)


def _merged(a: _SpanSums, b: _SpanSums) -> _SpanSums:
    nis = consistency.merged_nis(a.nis, b.nis)
    alike = nis if a.alike is a.nis and b.alike is b.nis else consistency.merged_nis(a.alike, b.alike)
    single = len(a.sensors) == 1
    return _SpanSums(
        moments.merged(a.errors, b.errors),
        consistency.merged_nees(a.nees, b.nees),
        nis,
        alike,
        tuple(
            consistency.merged_sensor(one, other, alike if single else None)
            for one, other in zip(a.sensors, b.sensors, strict=True)
        ),
        a.log_likelihood + b.log_likelihood,
    )


def _span_figures(span: _SpanSums, bins: quantiles.Counts) -> dict[str, NDArray[Any]]:
    """Return one span's figures by their names in the layout, runs first."""
    errors = span.errors
    largest = errors.known(errors.largest)
    values = quantiles.quantiles(bins, layout.PROBABILITIES, errors.largest[6:])
    return {
        "epochs": errors.count,
        "updates": span.nis.moments.count,
        "mean": errors.known(errors.mean).T,
        "std": errors.std().T,
        "rms": errors.rms().T,
        "max": largest.T,
        "quantile": values.transpose(1, 0, 2),
        "anees": span.nees.anees().T,
        "coverage": span.nees.coverage().transpose(2, 0, 1),
        "nis_mean": span.nis.mean(),
        "nis_lag1": span.alike.autocorrelation(),
        "log_likelihood": errors.known(span.log_likelihood[None])[0],
    }

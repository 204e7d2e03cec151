"""What a report needs to know of one filter in one case: its per-run figures, in the axes of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array, Indices, Integers, Mask
from relnav_sim.filters.operations import Operations
from relnav_sim.plots.axes import Axes
from relnav_sim.plots.in_full import InFull, covariances_in_full
from relnav_sim.plots.run_figures import RunFigures, Span, run_figures, span_index
from relnav_sim.plots.sensor_times import stored_epochs_between
from relnav_sim.plots.stated_operations import stated_operations
from relnav_sim.results import layout
from relnav_sim.results.afterwards import known_when
from relnav_sim.results.block import AugmentedStates, BySensor, Editing
from relnav_sim.results.by_channel import ByChannel
from relnav_sim.results.observability import Observability
from relnav_sim.results.settings import case_setting, filter_settings
from relnav_sim.sensors import sensor_kinds
from relnav_sim.sensors.interface import Role
from relnav_sim.statistics.bound_ratio import ratio_to_bound
from relnav_sim.statistics.correlation import integrated_time
from relnav_sim.statistics.divergence import diverged_runs
from relnav_sim.statistics.intervals import Interval

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


@dataclass(frozen=True)
class FilterFacts(RunFigures):
    """One filter in one case; every array has its computed runs as the leading axis.

    Attributes:
        anees: NEES / 6 over time (n, 2 spans).
        nis: Mean NIS over time (n, 2 spans).
        nis_sum: Sum of the NIS over the updates (n, 2 spans).
        dof: Its degrees of freedom, the channels that were present (n, 2 spans).
        cpu_us: CPU time per filter step (n,), microseconds.
        stored: Every dataset of `layout.SUMMARY` as it is stored.
        diagnostics: What the filter reports of its own working, by name (n,).
        diverged: In which runs it diverged, by the definition of `statistics.divergence` (n,).
        nees_time_s: Integrated correlation time of the NEES over the headline span, s; NaN where it is not known.
        times_bound: RMS of the position error over the completed runs and the stored epochs of a span, in multiples of
            the Cramér-Rao bound of a perfect model with its sensors over the same; NaN where the result holds none.
        times_own_bound: The same of the bound of the filter's own model.
        augmented: What it found out about its augmented states; None where it has none.
        by_sensor: What came of each of its sensors; None where the result does not tell them apart.
        host_mixtures: Sensors of a craft's own attitude and orbit whose noise is a mixture; bounds take its covariance.
        mixture_sensors: Sensors whose noise is a mixture of Gaussians, so that innovations are not Gaussian and only
            the mean of the NIS is known.
        observability: What its sensors can tell it of the state; None where the result does not say.
        named_sensors: Names of its sensors where it names any; empty: all of the case.
        known_when: When its estimates are known, in words; empty where that is at their own epoch, as in flight.
        editing: What came of the editing of its measurements; None where there is none.
        false_rejections: Share of the tests of its editing that fail where the filter is right; NaN where it is not
            known.
        operations: What one of its epochs costs by formula; None where it states none.
        by_channel: What its residuals say by channel; None where the campaign did not ask.
        stored_between: How many stored epochs the period of each sensor spans, rounded up.
        in_full: What its formal covariances say with their correlations; None where the result holds sigmas only.
    """

    anees: Array
    nis: Array
    nis_sum: Array
    dof: Integers
    cpu_us: Array
    stored: Mapping[str, NDArray[Any]]
    diagnostics: Mapping[str, Array]
    diverged: Mask
    nees_time_s: float
    times_bound: Mapping[Span, Interval]
    times_own_bound: Mapping[Span, Interval]
    augmented: AugmentedStates | None = None
    by_sensor: BySensor | None = None
    stored_between: Mapping[str, int] = field(default_factory=dict)
    host_mixtures: tuple[str, ...] = ()
    mixture_sensors: tuple[str, ...] = ()
    observability: Observability | None = None
    named_sensors: tuple[str, ...] = ()
    known_when: str = ""
    editing: Editing | None = None
    false_rejections: float = np.nan
    operations: Operations | None = None
    by_channel: ByChannel | None = None
    in_full: InFull | None = None

    @property
    def observable(self) -> bool:
        """Whether its sensors can observe the state, as far as the result says."""
        return self.observability is None or self.observability.observable

    @property
    def nis_is_chi_square(self) -> bool:
        """Whether its NIS would be chi-square were its model right."""
        return not self.mixture_sensors

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of its sensors, as far as the result tells them apart."""
        return () if self.by_sensor is None else self.by_sensor.names

    def dimensions(self) -> set[int]:
        """Return how many channels its updates had; 0 stands for a number that differs within a run."""
        updates, dof = (np.asarray(part)[self.ok, 0].astype(int) for part in (self.stored["updates"], self.dof))
        sizes = {
            0 if total % count else int(total // count) for count, total in zip(updates, dof, strict=True) if count
        }
        if self.by_sensor is None or not sizes:
            return sizes
        # As many in the mean may still be a mix of more and fewer.
        found = self.by_sensor.dof.sum(axis=-1)
        return sizes | set(np.unique(found[found > 0]).tolist())

    @property
    def diverged_completed(self) -> int:
        """Number of runs that diverged without failing, and so count in every mean."""
        return int((self.ok & self.diverged).sum())

    @property
    def mostly_diverged(self) -> bool:
        """Whether at least half of the completed runs diverged: how good the filter is cannot be read from them."""
        return self.completed > 0 and 2 * self.diverged_completed >= self.completed

    def consistency(self, which: Literal["anees", "nis"], span: Span) -> Array:
        """Return ANEES or mean NIS over a span, one figure for each computed run (n,)."""
        return (self.anees if which == "anees" else self.nis)[:, span_index(span)]

    def per_run(self, name: str, *place: int) -> Array:
        """Return one figure per completed run of a stored dataset, for example ``per_run("coverage", 1, 0, 2)``."""
        return np.asarray(self.stored[name][(self.ok, *place)], dtype=float)

    def nis_per_dof(self, span: Span) -> Array:
        """Return the NIS per degree of freedom over a span, 1 when consistent, for each computed run (n,)."""
        total, dof = self.nis_sum[:, span_index(span)], self.dof[:, span_index(span)]
        return np.asarray(total / np.where(dof > 0, dof, np.nan))

    def of_sensor(self, sensor: str, name: str, span: Span) -> Array:
        """Return one of the statistics of `BySensor` over a span, for each completed run; NaN without the sensor."""
        if self.by_sensor is None or sensor not in self.sensors:
            return np.full(self.completed, np.nan)
        values = getattr(self.by_sensor, name)[self.ok, span_index(span), self.sensors.index(sensor)]
        return np.asarray(values, dtype=float)

    def worst_rows(self, span: Span, count: int) -> Indices:
        """Return which of all rows are the completed runs with the largest position RMS, the largest first."""
        rows = np.flatnonzero(self.ok)
        return rows[np.argsort(-self.errors("rms", span, "r")[rows], kind="stable")[:count]]

    def times_median(self, span: Span) -> Array:
        """Return the position RMS of every computed run as a multiple of its median over the completed ones (n,).

        NaN where there is no such median, or it is 0.
        """
        sizes = self.errors("rms", span, "r")
        median = float(np.median(sizes[self.ok])) if self.completed else np.nan
        return np.asarray(sizes / (median if median > 0 else np.nan))

    def median_row(self, span: Span) -> int:
        """Return which of the completed runs has the median position RMS, the lower of two."""
        sizes = self.errors("rms", span, "r")[self.ok]
        return int(np.argsort(sizes, kind="stable")[(len(sizes) - 1) // 2])

    def median_run(self, span: Span) -> int:
        """Return the number of that run."""
        return int(self.runs[self.ok][self.median_row(span)])


def filter_facts(results: Results, index: int, name: str, axes: Axes, settled: Mask) -> FilterFacts:
    """Return the facts of one filter.

    Args:
        results: An opened result.
        index: Number of the case.
        name: The filter.
        axes: The axes of every figure.
        settled: Which of the stored epochs are of the settled span (K,).
    """
    stored = {spec.name: results.statistic(index, name, spec.name) for spec in layout.SUMMARY}

    def statistic(which: str) -> Array:
        return np.asarray(stored[which], dtype=float)

    figures = run_figures(results, index, name, axes)
    times_s, by_sensor = results.time_s(index), results.by_sensor(index, name)
    sensors = None if by_sensor is None else by_sensor.names
    whole_state = layout.BLOCKS.index("full")
    bounds = results.perfect_bound(index, name), results.bound(index, name)
    r = np.full((figures.completed, len(times_s)), np.nan)
    if any(bound is not None for bound in bounds):
        r = np.linalg.norm(results.error(index, name)[figures.ok][..., :3], axis=-1)
    spans: dict[Span, Mask] = {"whole": times_s > 0, "settled": (times_s > 0) & settled}
    facts = FilterFacts(
        **vars(figures),
        anees=statistic("anees")[..., whole_state],
        nis=statistic("nis_mean"),
        nis_sum=results.nis_sum(index, name),
        dof=results.dof_sum(index, name),
        cpu_us=statistic("cpu_per_step"),
        stored=stored,
        diagnostics=results.diagnostics(index, name),
        diverged=diverged_runs(results, index, name),
        nees_time_s=_correlation_time(results.nees(index, name), times_s, settled),
        times_bound=_ratios_to_bound(r, bounds[0], spans),
        times_own_bound=_ratios_to_bound(r, bounds[1], spans),
        augmented=results.augmented(index, name),
        by_sensor=by_sensor,
        stored_between=stored_epochs_between(results, index, sensors or (), times_s),
        host_mixtures=_host_mixtures(results, index),
        mixture_sensors=_mixture_sensors(results, index, sensors),
        observability=results.observability(index, name),
        named_sensors=results.named_sensors(index, name),
        known_when=known_when(results, index, name),
        editing=results.editing(index, name),
        false_rejections=_false_rejections(results, index, name),
        by_channel=results.by_channel(index, name),
        in_full=covariances_in_full(results, index, name, axes, spans),
    )
    states = 0 if facts.augmented is None else len(facts.augmented.names)
    return replace(facts, operations=stated_operations(results, index, name, states, facts.dimensions()))


def _false_rejections(results: Results, index: int, name: str) -> float:
    """Return the share of tests that fail where a filter is right: 1 less the probability of its editing."""
    path = f"filters.{name}.editing"
    varied = results.headers[index].variables
    editing = varied.get(path) or filter_settings(results, index, name).get("editing")
    probability = editing.get("probability") if isinstance(editing, Mapping) else None
    probability = varied.get(f"{path}.probability", probability)
    return 1 - probability if isinstance(probability, float) else np.nan


def _host_mixtures(results: Results, index: int) -> tuple[str, ...]:
    sensors = results.campaign_content.get("sensors", {})
    frames = ("attitude", "orbit")
    return tuple(name for name in sensors if _role(sensors[name], name) in frames and _is_mixture(results, index, name))


def _mixture_sensors(results: Results, index: int, used: Sequence[str] | None) -> tuple[str, ...]:
    """Return the sensors with innovations of mixture noise, whatever the filter is told; of all where none are named.

    The noise of what a craft knows of itself, such as its attitude, is in the innovations of every relative sensor.
    """
    sensors = results.campaign_content.get("sensors", {})
    mixtures = tuple(sensor for sensor in sensors if _is_mixture(results, index, sensor))
    if used is None:
        return mixtures
    of_hosts = any(_role(sensors[sensor], sensor) not in ("other", None) for sensor in mixtures)
    return tuple(sensor for sensor in used if of_hosts or sensor in mixtures)


def _role(options: Mapping[str, Any], sensor: str) -> Role | None:
    """Return what a sensor measures; None where its kind is not known here."""
    kind = sensor_kinds().get(options.get("kind", sensor))
    return None if kind is None else kind.role


def _is_mixture(results: Results, index: int, sensor: str) -> bool:
    parts = case_setting(results, index, f"sensors.{sensor}.noise", None)
    kinds = [part.get("kind") for part in parts] if isinstance(parts, list | tuple) else []
    return "mixture" in [*kinds, case_setting(results, index, f"sensors.{sensor}.noise.kind", None)]


def _ratios_to_bound(r: Array, bound: Array | None, spans: Mapping[Span, Mask]) -> dict[Span, Interval]:
    """Return the ratio over each span, from the position error of the completed runs at the stored epochs."""
    limit = np.full(r.shape[1], np.nan) if bound is None else bound[:, layout.QUANTITIES.index("r")]
    return {span: ratio_to_bound(r[:, chosen], limit[chosen]) for span, chosen in spans.items()}


def _correlation_time(nees: Array, times_s: Array, settled: Mask) -> float:
    chosen = settled if settled.sum() > 1 else np.arange(len(times_s)) > 0
    return integrated_time(nees[:, chosen], float(times_s[1] - times_s[0])) if chosen.sum() > 1 else np.nan

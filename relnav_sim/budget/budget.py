"""The error budget of a filter: how much of the variance of its error each source is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.budget.linearised import asked_numbers, linear_filter
from relnav_sim.budget.phases import Phase, phases
from relnav_sim.budget.recursion import means, variances
from relnav_sim.budget.sources import (
    INTERACTION,
    fixed_sources,
    injections_of,
    not_covered,
    random_sources,
)
from relnav_sim.budget.truth_errors import truth_numbers, with_truth_errors
from relnav_sim.campaign import Campaign
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.filters.kalman import GaussianFilter
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.wording import first_of


@dataclass(frozen=True)
class Budget:
    """An error budget: the variance of a filter's error by source, about the nominal truth and to first order.

    Attributes:
        filter: Name of the filter in the campaign.
        sources: Names of the S sources: those that each run draws, then those that are the same in every run, then, if
            there are two or more of these, their interaction, whose part may be negative.
        variance: Of position and velocity, RTN, (S, T, 6), m^2 and m^2/s^2; of a fixed source its square.
        means: The errors themselves of fixed sources, (S, T, 6), m and m/s; zero for the others.
        total: Mean square of the error, the sum of the variances, (T, 6).
        formal: The variance that the filter itself predicts, (T, 6).
        times_s: Epochs (T,), s.
        not_covered: What of the campaign is not in it, in words.
        sizes: How large each source is, its standard deviation or its absolute value, (S,), in `units`.
        units: Unit of each size: m, deg and the like; ``sigma`` of numbers without a unit, ``whole`` of fixed errors.
        phases: The phases of the flight, by what each ends with.

    Examples:
        >>> import relnav_sim
        >>> budget = relnav_sim.error_budget(relnav_sim.load_campaign("campaigns/demo.yaml"), filter="ekf")
        >>> budget.variance.shape, budget.sources[:2]
        ((15, 601, 6), ('radar range noise', 'radar azimuth noise'))
    """

    filter: str
    sources: tuple[str, ...]
    variance: Array
    means: Array
    total: Array
    formal: Array
    times_s: Array
    not_covered: tuple[str, ...]
    sizes: Array
    units: tuple[str, ...]
    phases: tuple[Phase, ...]

    def sensitivity(self) -> Array:
        """Return how the total's sigma grows with the size of each source, d sigma / d size, (S, T, 6).

        In m or m/s for each of `units`. The interaction has no size: 0.
        """
        found: Array = self.slope() / (2 * np.sqrt(self.total) * self.sizes[:, None, None])
        return found

    def slope(self) -> Array:
        """Return how the total grows with the relative size of each source, d total / d ln(size), (S, T, 6)."""
        found = 2 * np.where(self._fixed()[:, None, None], self.means * self.means.sum(axis=0), self.variance)
        if INTERACTION in self.sources:
            found[self.sources.index(INTERACTION)] = 0.0
        return np.asarray(found)

    def at_phases(self) -> Array:
        """Return the variances at the end of each phase, (S, P, 6), m^2 and m^2/s^2."""
        return self.variance[:, [phase.epoch for phase in self.phases]]

    def _fixed(self) -> Mask:
        return np.asarray(self.means.any(axis=(1, 2)))

    def halved(self) -> Array:
        """Return the total with each source in turn halved, the others as they are, (S, T, 6).

        That of the interaction, which is no source by itself, is the total.
        """
        sum_of_means = self.means.sum(axis=0)
        drawn = self.total - 0.75 * self.variance
        moved = self.total - np.square(sum_of_means) + np.square(sum_of_means - 0.5 * self.means)
        halved: Array = np.where(self._fixed()[:, None, None], moved, drawn)
        if INTERACTION in self.sources:
            halved[self.sources.index(INTERACTION)] = self.total
        return halved


def budgeted_filters(config: CaseConfig) -> tuple[str, ...]:
    """Return the filters of a case whose gain does not depend on the measurements, so that they have a budget."""
    return tuple(name for name, entry in config.filters.items() if _has_nominal_gain(entry))


def _has_nominal_gain(entry: FilterEntry) -> bool:
    factory: object = filter_kinds()[entry.kind].factory
    nominal = isinstance(factory, type) and issubclass(factory, GaussianFilter) and factory.nominal_gain
    # Process noise that is found from the measurements makes the gain depend on them.
    # A smoothed estimate depends on later measurements, and a fitted start has no gain at all.
    return nominal and entry.process_noise.adaptive is None and entry.smoother is None and entry.batch_start is None


def error_budget(campaign: Campaign, case: int = 0, filter: str | None = None) -> Budget:
    """Return the error budget of a filter: linear covariance analysis along the nominal truth.

    Markley and Carpenter, J. Astronautical Sciences 57, 2009; Geller, J. Guidance, Control, and Dynamics 29(6), 2006.
    The filter's own transitions, measurement matrices and gains are taken along the nominal truth, with its own R, Q
    and P0, and each source of error runs through them by itself. Process noise is what the filter believes, no error:
    it is in the gain and in `formal`, and no source.

    Args:
        campaign: From `load_campaign`.
        case: Index of the case.
        filter: Name of the filter; None: the first of the case that has a budget.

    Raises:
        IndexError: There is no such case.
        ValueError: There is no such filter, or its gain depends on the measurements, or there is nothing to start from.

    Examples:
        >>> import relnav_sim
        >>> campaign = relnav_sim.load_campaign("campaigns/demo.yaml")
        >>> budget = relnav_sim.error_budget(campaign, filter="ekf")
        >>> bool(abs(budget.variance.sum(axis=0) / budget.total - 1).max() < 1e-10)
        True
    """
    if not 0 <= case < len(campaign.cases):
        raise IndexError(f"there is no case {case}; the campaign has {len(campaign.cases)}, counted from 0")
    config = campaign.cases[case].config
    name = _chosen(config, filter)
    entry = config.filters[name]
    asked = asked_numbers(config)
    injections, numbers = injections_of(config, entry, asked), truth_numbers(config, entry)
    try:
        linear = linear_filter(config, entry, campaign.seed, injections)
    except ValueError as error:
        raise ValueError(f"filter {name!r} has no error budget: {error}") from None
    linear = with_truth_errors(linear, config, numbers)
    drawn, fixed = random_sources(config, injections, numbers, linear), fixed_sources(config, injections, linear)
    variance, mean = variances(linear, drawn), means(linear, fixed)
    parts, names = [variance, np.square(mean)], [*(one.name for one in drawn), *(one.name for one in fixed)]
    errors = [np.zeros_like(variance), mean]
    if len(fixed) > 1:
        parts.append((np.square(mean.sum(axis=0)) - np.square(mean).sum(axis=0))[None])
        errors.append(np.zeros_like(parts[-1]))
        names.append(INTERACTION)
    by_source = np.concatenate(parts)
    sizes = [*((one.size, one.unit) for one in drawn), *((one.size, one.unit) for one in fixed)]
    sizes += [(1.0, "whole")] * (len(names) - len(sizes))
    return Budget(
        filter=name,
        sources=tuple(names),
        variance=by_source,
        means=np.concatenate(errors),
        total=variance.sum(axis=0) + np.square(mean.sum(axis=0)),
        formal=np.ascontiguousarray(np.einsum("kii->ki", linear.formal)[:, :6]),
        times_s=linear.times_s,
        not_covered=tuple(not_covered(config, entry, linear, asked.by_chance)),
        sizes=np.array([size for size, _ in sizes]),
        units=tuple(unit for _, unit in sizes),
        phases=phases(config, linear.times_s, linear.read),
    )


def _chosen(config: CaseConfig, name: str | None) -> str:
    known = budgeted_filters(config)
    if name is None:
        if not known:
            raise ValueError(f"no filter of the case has an error budget: {_why(tuple(config.filters))}")
        return known[0]
    if name not in config.filters:
        raise ValueError(f"there is no filter {name!r}; there are {first_of(list(config.filters))}")
    if name not in known:
        raise ValueError(f"filter {name!r} has no error budget: {_why((name,))}")
    return name


def _why(names: tuple[str, ...]) -> str:
    whose = "its gain depends" if len(names) == 1 else "their gains depend"
    told = "on the measurements, or on later ones by a smoother or a fitted start"
    return f"{whose} {told}, so that there is none along the nominal truth; trust the Monte Carlo"

"""What the residuals of a filter say about it where no truth is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.measurements.channel import Channel
from relnav_sim.statistics.intervals import Band, sum_band
from relnav_sim.statistics.whiteness import Whiteness, whiteness

RELEVANT_RATIO = 0.05
"""A mean NIS nearer than this to its expectation is no finding, however many measurements make it significant."""
RELEVANT_MEAN = 0.1
"""The same of a channel's mean residual, in sigmas."""
RELEVANT_CORRELATION = 0.05
"""The same of an autocorrelation."""
BLOCKS = 20
"""Blocks of time over which the scatter of the NIS is looked at: long ones, so that correlation hardly matters."""
ASIDE, FEW = 2, 20
"""How many of these with the largest sums do not raise the band's upper end; with fewer measurements in a block than
the second number, where a single outlier looks like a fault, they do."""
SMOOTHER_SHARE = 0.99
"""Filter and smoother agree where at least this share of the estimates is within three sigmas; of white ones 0.997."""


@dataclass(frozen=True)
class ChannelCheck:
    """The residuals of one channel of a sensor over some runs.

    Attributes:
        sensor: Name of the sensor.
        channel: The channel.
        count: Measurements.
        mean: Mean residual, SI.
        sigma: Standard deviation of the residuals about their mean, SI.
        normalised_mean: Mean of the residuals in sigmas that the filter states.
        normalised_sigma: Their root mean square about 0; 1 where the filter is consistent.
        whiteness: The autocorrelation of the residuals in sigmas.
    """

    sensor: str
    channel: Channel
    count: int
    mean: float
    sigma: float
    normalised_mean: float
    normalised_sigma: float
    whiteness: Whiteness

    @property
    def name(self) -> str:
        """The sensor and the channel in words: ``radar range``."""
        return f"{self.sensor} {self.channel.label}"

    def is_biased(self, level: float) -> bool:
        """Return whether the mean is off by more than chance allows, at a level of significance, and matters."""
        return abs(self.normalised_mean) > max(RELEVANT_MEAN, _two_sided(level) / np.sqrt(max(1, self.count)))

    def is_correlated(self, level: float) -> bool:
        """Return whether the residuals are correlated by more than chance allows, and by what matters."""
        largest = np.abs(self.whiteness.correlation).max(initial=0.0)
        return self.whiteness.p_value < level and largest > max(RELEVANT_CORRELATION, self.whiteness.bound)


@dataclass(frozen=True)
class NisCheck:
    """The NIS of one sensor, summed over all its updates.

    Attributes:
        sensor: Name of the sensor.
        updates: Number of updates.
        dof: Sum of the degrees of freedom.
        ratio: Sum of the NIS over `dof`; NaN without updates.
        band: Where the ratio of a consistent filter is, in 95 % of all cases, by the chi-square distribution or by the
            scatter over time, whichever reaches farther; None without updates.
    """

    sensor: str
    updates: int
    dof: int
    ratio: float
    band: Band | None

    @property
    def finding(self) -> str:
        """``overconfident``, ``conservative`` or ``consistent``; empty without updates."""
        if self.band is None:
            return ""
        if self.ratio > max(self.band.high, 1 + RELEVANT_RATIO):
            return "overconfident"
        return "conservative" if self.ratio < min(self.band.low, 1 - RELEVANT_RATIO) else "consistent"


@dataclass(frozen=True)
class SmootherCheck:
    """Whether the filter's estimates agree with the smoother's, component by component.

    Attributes:
        names: The components.
        count: Estimates that later measurements changed, (n,).
        share: Share of them that changed by less than three sigmas, (n,); NaN where none did.
        rms: Root mean square of the change in sigmas, (n,).
    """

    names: tuple[str, ...]
    count: Integers
    share: Array
    rms: Array

    @property
    def disagreeing(self) -> list[str]:
        """The components in which filter and smoother do not agree."""
        return [name for name, share in zip(self.names, self.share.tolist(), strict=True) if share < SMOOTHER_SHARE]


def channel_check(sensor: str, channel: Channel, residual: Array, sigma: Array) -> ChannelCheck:
    """Return the check of one channel.

    Args:
        sensor: Name of the sensor.
        channel: The channel.
        residual: Residuals (runs, T); NaN where nothing was read.
        sigma: What the filter expects of them (runs, T).
    """
    runs = [_read(own, spread) for own, spread in zip(residual, sigma, strict=True)]
    plain = np.concatenate([own for own, _ in runs])
    normalised = [own / spread for own, spread in runs]
    together = np.concatenate(normalised)
    some = len(together) > 0
    return ChannelCheck(
        sensor=sensor,
        channel=channel,
        count=len(plain),
        mean=float(plain.mean()) if some else np.nan,
        sigma=float(plain.std()) if some else np.nan,
        normalised_mean=float(together.mean()) if some else np.nan,
        normalised_sigma=float(np.sqrt(np.mean(np.square(together)))) if some else np.nan,
        whiteness=whiteness(normalised),
    )


def nis_check(sensor: str, nis: Array, dof: Integers, level: float = CONFIDENCE) -> NisCheck:
    """Return the check of one sensor's NIS (runs, T) with its degrees of freedom (runs, T).

    The sum is chi-square with the sum of the degrees where the innovations are white and Gaussian and the filter states
    their covariance (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
    section 5.4.2). Noise with outliers scatters more: so the band is also that of Student's t over `BLOCKS` blocks of
    time, one after the other (ratio of means, Cochran 1977, eq. 6.4), which needs neither. A fault of a short time must
    not hide itself by its scatter: what it does to `ASIDE` blocks does not raise the upper end.
    """
    there = np.isfinite(nis) & (dof > 0)
    updates, total = int(there.sum()), int(dof[there].sum())
    if not updates:
        return NisCheck(sensor, 0, 0, np.nan, None)
    band = sum_band(total, total, level)
    below, above = _half_widths(nis[there], dof[there], level)
    band = replace(band, low=min(band.low, 1 - below), high=max(band.high, 1 + above))
    return NisCheck(sensor, updates, total, float(nis[there].sum() / total), band)


def _half_widths(nis: Array, dof: Integers, level: float) -> tuple[float, float]:
    """Return how far the interval of sum(nis) / sum(dof) reaches down and up, by blocks; 0 for too few updates."""
    if len(nis) < 2 * BLOCKS:
        return 0.0, 0.0
    blocks = [
        (part.sum(), own.sum()) for part, own in zip(*(np.array_split(x, BLOCKS) for x in (nis, dof)), strict=True)
    ]
    sums, degrees = np.array(blocks, dtype=float).T
    left = np.sort(sums - degrees * (sums.sum() / degrees.sum())) / degrees.sum()
    below = _half_width(left, 0, level)
    return below, below if len(nis) < FEW * BLOCKS else _half_width(left, ASIDE, level)


def _half_width(terms: Array, aside: int, level: float) -> float:
    """Return half of Student's interval of the sum of terms in ascending order.

    By the Winsorised variance where some at both ends are set aside (Tukey and McLaughlin, Sankhya A 25(3), 1963).
    """
    from scipy.special import stdtrit

    count, kept = len(terms), len(terms) - 2 * aside
    spread = terms.clip(terms[aside], terms[-1 - aside]).std(ddof=1)
    return float(spread * np.sqrt(count) * (count / kept) * stdtrit(kept - 1, (1 + level) / 2))


def smoother_check(change: Array, names: Sequence[str]) -> SmootherCheck:
    """Return the check of changes (runs, T, n) by smoothing, in sigmas; NaN where there was none."""
    there = np.isfinite(change)
    count = there.sum(axis=(0, 1))
    some = np.maximum(count, 1)
    inside = (there & (np.abs(np.where(there, change, 0.0)) < 3)).sum(axis=(0, 1))
    squares = np.square(np.where(there, change, 0.0)).sum(axis=(0, 1))
    return SmootherCheck(
        tuple(names),
        count,
        np.where(count > 0, inside / some, np.nan),
        np.where(count > 0, np.sqrt(squares / some), np.nan),
    )


@dataclass(frozen=True)
class FilterChecks:
    """Everything that the residuals of one filter say about it.

    Attributes:
        channels: By channel, in the order of the sensors.
        nis: By sensor.
        smoother: Filter against smoother.
    """

    channels: tuple[ChannelCheck, ...]
    nis: tuple[NisCheck, ...]
    smoother: SmootherCheck

    @property
    def level(self) -> float:
        """The level of significance of each channel's tests, so that all together stay at 5 % (Bonferroni)."""
        return (1 - CONFIDENCE) / max(1, len(self.channels))

    @property
    def biased(self) -> list[ChannelCheck]:
        """Channels whose residuals have a mean."""
        return [one for one in self.channels if one.is_biased(self.level)]

    @property
    def correlated(self) -> list[ChannelCheck]:
        """Channels whose residuals are not white."""
        return [one for one in self.channels if one.is_correlated(self.level)]

    def found(self, finding: str) -> list[NisCheck]:
        """Return the sensors whose NIS says that the filter is so."""
        return [one for one in self.nis if one.finding == finding]


def filter_checks(
    channels: Mapping[str, Sequence[Channel]],
    residuals: Mapping[str, tuple[Array, Array]],
    nis: Mapping[str, tuple[Array, Integers]],
    smoothed_change: Array,
    names: Sequence[str],
) -> FilterChecks:
    """Return the checks of a filter.

    Args:
        channels: The channels of each sensor.
        residuals: Residuals and their expected sigmas by sensor, each (runs, T, m).
        nis: NIS and degrees of freedom by sensor, each (runs, T).
        smoothed_change: Changes by smoothing in sigmas, (runs, T, n).
        names: The components of the state, (n,).
    """
    return FilterChecks(
        tuple(
            channel_check(sensor, channel, residual[..., place], sigma[..., place])
            for sensor, (residual, sigma) in residuals.items()
            for place, channel in enumerate(channels[sensor])
        ),
        tuple(nis_check(sensor, *each) for sensor, each in nis.items()),
        smoother_check(smoothed_change, names),
    )


def _read(residual: Array, sigma: Array) -> tuple[Array, Array]:
    there = np.isfinite(residual) & (sigma > 0)
    return residual[there], sigma[there]


def _two_sided(level: float) -> float:
    from scipy.special import ndtri

    return float(ndtri(1 - level / 2))

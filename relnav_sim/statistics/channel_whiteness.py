"""Are the residuals of each channel white? Gathered at full rate while a block runs, and judged over all runs.

Of a filter whose models are right the residuals in their formal sigmas are white with variance 1 in each channel (Mehra
1970). What is kept of a run are the mean products at each lag about 0, so that runs add up whatever their means.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.measurements.channel import Channel
from relnav_sim.results import layout
from relnav_sim.results.by_channel import ByChannel
from relnav_sim.statistics.residual_checks import ChannelCheck
from relnav_sim.statistics.whiteness import Whiteness, of_products

_LAGS = len(layout.LAGS)


class ChannelWhiteness:
    """Takes successive chunks of a block's residuals and gives the statistics of each run at the end.

    Args:
        runs: Number of runs in the block.
        names: The channels.
        settled_epoch: First epoch of the settled span.
    """

    def __init__(self, runs: int, names: tuple[str, ...], settled_epoch: int) -> None:
        self._names = names
        self._settled_epoch = settled_epoch
        self._spans = tuple(_Products(runs, len(names)) for _ in layout.SPANS)

    def add(self, first_epoch: int, residuals: Array, failed_epoch: Integers) -> None:
        """Count the next chunk of epochs.

        Args:
            first_epoch: Its first.
            residuals: In formal sigmas, (runs, K, channels); NaN where nothing was read.
            failed_epoch: First failed epoch of each run so far (runs,), -1: none.
        """
        epochs = first_epoch + np.arange(residuals.shape[1])
        sound = (failed_epoch[:, None] < 0) | (epochs < failed_epoch[:, None])
        for span, first in zip(self._spans, (1, self._settled_epoch), strict=True):
            span.add(residuals, sound & (epochs >= first))

    def result(self) -> ByChannel:
        """Return the statistics over everything counted."""
        count, total, products = (np.stack([getattr(one, of) for one in self._spans], axis=1) for of in _SUMS)
        pairs = np.maximum(count[..., None] - np.arange(_LAGS), 0)
        return ByChannel(self._names, count, _over(total, count), _over(products, pairs))


_SUMS = ("count", "total", "products")


class _Products:
    """Sums over one span: measurements and their sum (runs, c), products at each lag (runs, c, lags)."""

    def __init__(self, runs: int, channels: int) -> None:
        self.count = np.zeros((runs, channels), dtype=np.int64)
        self.total = np.zeros((runs, channels))
        self.products, self._last = np.zeros((2, runs, channels, _LAGS))

    def add(self, residuals: Array, counted: Mask) -> None:
        x = np.ascontiguousarray(residuals)
        kernels.lagged.products(x, counted, self.count, self.total, self.products, self._last)


def pooled_whiteness(count: Integers, mean: Array, product: Array) -> Whiteness:
    """Return how the residuals of one channel are correlated with themselves, over all runs.

    The mean over all runs is taken out, as in `whiteness`; what the ends of a run differ from its mean by is left out.

    Args:
        count: Measurements of each run (runs,).
        mean: Their mean (runs,).
        product: Mean products at each lag (runs, lags).
    """
    read = count > 0
    n, m = count[read].astype(float), mean[read]
    if not len(n):
        return of_products(0, 0.0, np.zeros(0), np.zeros(0))
    overall = float(n @ m / n.sum())
    most = min(product.shape[1] - 1, int(n.max()) // 5)
    pairs = np.maximum(n[:, None] - np.arange(most + 1), 0.0)
    about_zero = np.where(pairs > 0, product[read, : most + 1], 0.0)
    sums = (pairs * (about_zero - 2 * overall * m[:, None] + overall**2)).sum(axis=0)
    return of_products(int(n.sum()), float(sums[0]), sums[1:], pairs.sum(axis=0)[1:])


def campaign_checks(found: ByChannel, chosen: Mask, span: int) -> list[ChannelCheck]:
    """Return the check of each channel over some runs, in sigmas alone.

    Args:
        found: The statistics of each run.
        chosen: Which runs count (runs,).
        span: Which span.
    """
    checks = []
    for place, name in enumerate(found.names):
        n, mean = found.count[chosen, span, place], found.mean[chosen, span, place]
        product = found.product[chosen, span, place]
        read = n > 0
        total = int(n.sum())
        sensor, _, label = name.partition(" ")
        checks.append(
            ChannelCheck(
                sensor=sensor,
                channel=Channel(label, "1", label),
                count=total,
                mean=math.nan,
                sigma=math.nan,
                normalised_mean=float(n[read] @ mean[read]) / total if total else math.nan,
                normalised_sigma=math.sqrt(float(n[read] @ product[read, 0]) / total) if total else math.nan,
                whiteness=pooled_whiteness(n, mean, product),
            )
        )
    return checks


def _over(total: Array, count: Integers) -> Array:
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)

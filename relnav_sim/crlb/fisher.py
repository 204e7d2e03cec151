"""Fisher information about the location of a Gaussian mixture: what one noisy measurement can tell at most.

Location information I = E[s s^T] with the score s = -d log p / dv of the noise's density p. For a Gaussian it is the
inverse covariance; for a mixture it is larger than that of the Gaussian of the same covariance, by what a filter that
knows the mixture can gain. It has no closed form and is integrated numerically, never by random draws.
"""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array

SPACING = 0.1
"""Step of the trapezoidal rule in asinh of the whitened noise: 1e-7 of the information at ratios up to 100."""
REACH = 7.0
"""Standard deviations of the widest component at which the integral ends: 1e-11 of the probability lie beyond."""
TOLERANCE = 1e-3
"""Relative error of the information at which the next finer interpolation is fine enough."""
_NODE_COUNTS = (2, 3, 5, 9)
_NEGLIGIBLE = 1e-9
"""Range of a bounded variable that needs one node only."""


def mixture_information(weights: ArrayLike, covariances: ArrayLike) -> Array:
    """Return the location information (m, m) of a zero-mean Gaussian mixture.

    The trapezoidal rule on a product grid in whitened coordinates, whose error falls exponentially with the number of
    points for such analytic densities (Trefethen and Weideman, SIAM Review 56(3), 2014). The grid has some 40 points
    in each direction for two components and 80 for more: m should not exceed 3, or 2.

    Args:
        weights: (k,) probabilities of the components.
        covariances: (k, m, m), positive definite.
    """
    weights, covariances = np.asarray(weights, dtype=float), np.asarray(covariances, dtype=float)
    shown = weights > 0
    weights, covariances = weights[shown], covariances[shown]
    if len(weights) == 1:
        return _inverse(covariances[0])
    narrowest = int(np.argmin(np.linalg.det(covariances)))
    axes = np.linalg.cholesky(covariances[narrowest])
    if len(weights) == 2:  # common principal axes
        axes = axes @ np.linalg.eigh(_seen_in(axes, covariances[1 - narrowest]))[1]
        white = np.stack([np.diag(_seen_in(axes, covariance)) for covariance in covariances])
        information = np.diag(_along_principal_axes(weights, white))
    else:
        white = np.stack([_seen_in(axes, covariance) for covariance in covariances])
        information = _on_all_sides(weights, white)
    to_white = _inverse(axes)
    return np.asarray(to_white.T @ information @ to_white)


def _seen_in(axes: Array, covariance: Array) -> Array:
    """Return the covariance of u where v = axes u has the given one."""
    half = np.linalg.solve(axes, covariance)
    return np.asarray(np.linalg.solve(axes, half.T))


def _line(variances: Array) -> tuple[Array, Array]:
    """Return points on the positive half of an axis, and the length that each stands for on one side.

    Args:
        variances: Of the components along the axis, (k,).
    """
    narrow, wide = np.sqrt(variances.min()), np.sqrt(variances.max())
    steps = (np.arange(int(np.ceil(np.arcsinh(REACH * wide / narrow) / SPACING))) + 0.5) * SPACING
    return narrow * np.sinh(steps), narrow * SPACING * np.cosh(steps)


def _along_principal_axes(weights: Array, variances: Array) -> Array:
    """Return the diagonal (m,) of the information of two components with diagonal covariances, variances (2, m).

    Component densities are products over the channels, and every integrand is even in each of them.
    """
    m = variances.shape[1]
    lines = [_line(along) for along in variances.T]
    parts = []
    for weight, row in zip(weights, variances, strict=True):
        factors = [np.exp(-0.5 * x * x / v) / np.sqrt(2 * np.pi * v) for (x, _), v in zip(lines, row, strict=True)]
        parts.append(weight * reduce(np.multiply.outer, factors))
    volume = reduce(np.multiply.outer, [2 * length for _, length in lines])
    a, b = parts
    scaled = volume / np.maximum(a + b, np.finfo(float).tiny)
    squares = (scaled * a * a, 2 * scaled * a * b, scaled * b * b)
    information = np.empty(m)
    for i, (x, _) in enumerate(lines):
        others = tuple(j for j in range(m) if j != i)
        va, vb = variances[:, i]
        aa, ab, bb = (square.sum(axis=others) for square in squares)
        information[i] = np.sum(x * x * (aa / va**2 + ab / (va * vb) + bb / vb**2))
    return information


def _on_all_sides(weights: Array, covariances: Array) -> Array:
    """Return the information (m, m) of any components on a grid over all of space."""
    lines = [_line(along) for along in np.einsum("kii->ik", covariances)]
    grid = np.meshgrid(*(np.concatenate([-x[::-1], x]) for x, _ in lines), indexing="ij")
    points = np.stack([axis.ravel() for axis in grid], axis=-1)
    volume = reduce(np.multiply.outer, [np.concatenate([length[::-1], length]) for _, length in lines]).ravel()
    density, pull = np.zeros(len(points)), np.zeros(points.shape)
    for weight, covariance in zip(weights, covariances, strict=True):
        by_covariance = np.einsum("ij,nj->ni", _inverse(covariance), points)
        factor = weight / np.sqrt(np.linalg.det(2 * np.pi * covariance))
        part = factor * np.exp(-0.5 * (by_covariance * points).sum(axis=1))
        density += part
        pull += part[:, None] * by_covariance
    return np.einsum("n,ni,nj->ij", volume / np.maximum(density, np.finfo(float).tiny), pull, pull)


class ReadingInformation:
    """Information in a measurement of which two channels, or none, also carry a Gaussian error of the attitude.

    The noise is a mixture with independent channels in each component, plus a Gaussian of covariance A on the two
    channels that show a direction, which moves with the line of sight. Under a mixture the information is integrated at
    Chebyshev nodes over the range of A that is met and interpolated between them, with more nodes until fewer of them
    would do within `TOLERANCE`: errors are then some 1e-6, and 1e-3 at most where 9 nodes in each of three directions,
    the most there are, do not suffice (a line of sight near the axis of the azimuth).

    Interpolated is I^-1 - A, which A moves from one constant to another, over three bounded variables:
    a_i / (a_i + d) for the diagonal of A, and the correlation that A leaves beside d, the least variance of an angle.

    Args:
        weights: (k,) probabilities of the joint components.
        deviations: (k, m) standard deviations of the channels, m up to 3: of a radar range (m), azimuth and elevation
            (rad).
        attitude: (N, 2, 2) covariances A, rad^2, whose range the nodes shall cover; NaN is passed over. (N, 0, 0) where
            no channel shows a direction.
        directed: The channels that A is about.
    """

    def __init__(self, weights: Array, deviations: Array, attitude: Array, directed: tuple[int, ...] = (1, 2)) -> None:
        self._weights = weights
        self._variances = np.square(deviations)
        self._m = deviations.shape[1]
        self._directed = np.array(directed, dtype=int)
        self._row, self._column = np.ix_(self._directed, self._directed)
        self._constant: Array | None = None
        if len(weights) == 1:
            return
        self._apart = np.zeros((self._m, self._m))  # what channels tell that A is not about
        for channels in self._groups():
            shares, variances = self._marginal(channels)
            components = variances[:, :, None] * np.eye(len(channels))
            if set(channels) & set(directed):
                self._turned = channels, shares, components
            else:
                self._apart[np.ix_(channels, channels)] = mixture_information(shares, components)
        if not directed:
            self._constant = self._apart
            return
        self._d = float(self._variances[:, self._directed].min())
        known = self._bounded(attitude[~np.isnan(attitude).any(axis=(1, 2))])
        self._low: Array = known.min(axis=0, initial=1.0)
        self._high: Array = known.max(axis=0, initial=-1.0)
        self._nodes: list[Array] = []
        self._refine()

    def at(self, attitude: Array) -> Array:
        """Return the information (N, m, m) at attitude covariances (N, 2, 2) or (N, 0, 0); NaN stays NaN."""
        if self._constant is not None:
            return np.broadcast_to(self._constant, (len(attitude), self._m, self._m))
        if len(self._weights) == 1:
            R = np.zeros((len(attitude), self._m, self._m))
            R[:, self._row, self._column] = attitude
            return _inverse(R + np.diag(self._variances[0]))
        R = self._between(self._bounded(attitude))
        R[:, self._row, self._column] += attitude
        return _inverse(R)

    def _refine(self) -> None:
        for count in _NODE_COUNTS:
            ends = np.where(self._high - self._low > _NEGLIGIBLE, count, 1)
            nodes = [
                (low + high) / 2 + (high - low) / 2 * np.cos((np.arange(n) + 0.5) * np.pi / n)
                for low, high, n in zip(self._low, self._high, ends, strict=True)
            ]
            places = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1)
            values = np.stack([self._effective(place) for place in places.reshape(-1, 3)])
            before = self._between(places.reshape(-1, 3)) if self._nodes else None
            self._nodes, self._values = nodes, values.reshape(*places.shape[:3], self._m**2)
            scale = np.sqrt(np.einsum("nii->ni", values))
            if before is None:
                continue
            if np.abs((before - values) / (scale[:, :, None] * scale[:, None])).max() < TOLERANCE:
                return

    def _effective(self, place: Array) -> Array:
        """Return I^-1 - A (m, m) at one place."""
        diagonal = self._d * place[:2] / (1 - place[:2])
        mixed = place[2] * np.sqrt((diagonal + self._d).prod())
        attitude = np.array([[diagonal[0], mixed], [mixed, diagonal[1]]])
        effective = _inverse(self._exact(attitude))
        effective[self._row, self._column] -= attitude
        return effective

    def _exact(self, attitude: Array) -> Array:
        """Return the information (m, m) at one A; channels that switch alone are taken by themselves."""
        channels, weights, components = self._turned
        own = [channels.index(channel) for channel in self._directed]
        row, column = np.ix_(own, own)
        covariances = components.copy()
        covariances[:, row, column] += attitude
        information = self._apart.copy()
        information[np.ix_(channels, channels)] = mixture_information(weights, covariances)
        return information

    def _groups(self) -> list[list[int]]:
        """Return the channels in groups that switch independently; A keeps its channels together."""
        alone = [[channel] for channel in range(self._m) if channel not in self._directed]
        groups = [*alone, self._directed.tolist()] if len(self._directed) else alone
        counts = [len(self._marginal(group)[0]) for group in groups]
        return groups if np.prod(counts) == len(self._weights) else [list(range(self._m))]

    def _marginal(self, channels: list[int]) -> tuple[Array, Array]:
        """Return the mixture of some channels alone: weights (k,) and variances (k, channels)."""
        variances, place = np.unique(self._variances[:, channels], axis=0, return_inverse=True)
        weights: Array = np.bincount(place.ravel(), self._weights).astype(np.float64)
        return weights, variances

    def _bounded(self, attitude: Array) -> Array:
        """Return the three variables of A, (N, 3)."""
        a, b, mixed = attitude[:, 0, 0], attitude[:, 1, 1], attitude[:, 0, 1]
        d = self._d
        return np.stack([a / (a + d), b / (b + d), mixed / np.sqrt((a + d) * (b + d))], axis=-1)

    def _between(self, places: Array) -> Array:
        """Return I^-1 - A (N, m, m) at places (N, 3) by Lagrange's polynomials through the nodes."""
        by_a, by_b, by_mixed = (_lagrange(nodes, places[:, i]) for i, nodes in enumerate(self._nodes))
        return np.einsum("na,nb,nc,abcv->nv", by_a, by_b, by_mixed, self._values).reshape(-1, self._m, self._m)


def _lagrange(nodes: Array, x: Array) -> Array:
    """Return the values (N, n) at x of the polynomials that are 1 at one node and 0 at the others."""
    values = np.ones((len(x), len(nodes)))
    for i, node in enumerate(nodes):
        for j, other in enumerate(nodes):
            if i != j:
                values[:, i] *= (x - other) / (node - other)
    return values


def _inverse(R: Array) -> Array:
    return np.asarray(np.linalg.inv(R))

"""Prediction and update of sigma points in float32, by a root of the covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step, moves_by_transition
from relnav_sim.filters.arithmetic import ModelsInArithmetic
from relnav_sim.filters.belief import Gaussian, Innovation, considered_states
from relnav_sim.filters.square_root import semidefinite_root
from relnav_sim.linalg import symmetric, transpose
from relnav_sim.measurements.interface import Measurement

DROWNED = (
    "float32 can't tell a channel of the measurement from what is known without it; take ud_ekf, which takes channel "
    "by channel, or float64"
)


@dataclass(frozen=True)
class SingleRoot:
    """A Gaussian belief per run in float32: mean x (runs, n), lower-triangular root (runs, n, n) of the covariance."""

    x: Array
    root: Array

    @property
    def mean(self) -> Array:
        """The mean (runs, n), in float64."""
        return self.x.astype(np.float64)

    @property
    def covariance(self) -> Array:
        """The covariance root root^T, (runs, n, n), multiplied out in float64."""
        root = self.root.astype(np.float64)
        return symmetric(root @ transpose(root))


class SingleRoots:
    """The square-root unscented filter in float32.

    Roots of Q and R are found in float32 as well, as U D^(1/2): any root does, and this one stands singular matrices.

    Args:
        dynamics: The filter's.
        measurement: The filter's.
        scale: n + kappa.
        centre_weight: kappa / scale.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, scale: float, centre_weight: float) -> None:
        self._dynamics = dynamics
        self._models = ModelsInArithmetic(dynamics, measurement, "float32")
        self._spread, self._weight, self._centre_weight = np.sqrt(scale), 1 / (2 * scale), centre_weight

    def start(self, prior: Gaussian) -> SingleRoot:
        """Return the prior with its covariance factored in float64; then the root is rounded."""
        return SingleRoot(self._models.own(prior.mean), self._models.own(semidefinite_root(prior.covariance)))

    def predict(self, belief: SingleRoot, step: Step) -> SingleRoot:
        """Return the propagated belief, its root that of [deviations, Q^(1/2)]."""
        models, x = self._models, belief.x
        noise = self._root(models.process_noise(x, step))
        if self._dynamics.linear:
            F = models.transition(x, step)
            by_transition = moves_by_transition(self._dynamics)
            mean = _product(F, x[:, :, None])[:, :, 0] if by_transition else models.propagate(x, step)
            deviations = _product(F, belief.root)
        else:
            images = models.propagate(self._points(belief)[0], step)
            shift, deviations = self._deviations(images[:, 1:] - images[:, :1])
            mean = images[:, 0] + shift
        return SingleRoot(mean, kernels.roots.triangular_single(models.own(deviations), noise))

    def update(self, belief: SingleRoot, z: Array, step: Step) -> tuple[SingleRoot, Innovation]:
        """Return the update from the triangular form of [[Y, R^(1/2)], [X, 0]]."""
        models, x = self._models, belief.x
        points, offsets = self._points(belief)
        images, deviations = models.images(points, step.epoch)
        shift, Y = self._deviations(deviations[:, 1:])
        _, X = self._deviations(offsets)
        noise = self._root(models.noise(x, step.epoch))
        nu = models.residual(z, images[:, 0] + shift)
        # What rounds here is the deviations; how large the measurements are shows in their residual.
        gain, root, _, white, nis, log_likelihood, dead, _ = kernels.roots.update_single(
            X, Y, noise, nu, np.zeros_like(nu)
        )
        places = list(considered_states(self._dynamics))
        if places:
            kept = np.zeros_like(gain)
            kept[:, places], gain[:, places] = gain[:, places], 0.0
            root = kernels.roots.triangular_single(root, kept)
        corrected = SingleRoot(x + _product(gain, white[:, :, None])[:, :, 0], root)
        failed = models.coarse(corrected.x, corrected.covariance)
        failed |= dict.fromkeys(np.flatnonzero(dead).tolist(), DROWNED)
        return corrected, Innovation(nis, log_likelihood, failed=failed)

    def _root(self, A: Array) -> Array:
        """Return U D^(1/2) of positive semidefinite matrices (runs or 1, p, p)."""
        U, D = kernels.ud.factor_single(A, self._models.eps)
        root: Array = U * np.sqrt(D)[:, None, :]
        return root

    def _points(self, belief: SingleRoot) -> tuple[Array, Array]:
        x, root = np.ascontiguousarray(belief.x), np.ascontiguousarray(belief.root)
        return kernels.sigma_points.points_of_root_single(x, root, self._spread)

    def _deviations(self, images: Array) -> tuple[Array, Array]:
        images = np.ascontiguousarray(images)
        return kernels.sigma_points.weighted_deviations_single(images, self._weight, self._centre_weight)


def _product(A: Array, B: Array) -> Array:
    """Return A B (runs, p, r), its sums in order and never fused, as NumPy's `@` does not promise."""
    total: Array = A[:, :, :1] * B[:, :1, :]
    for k in range(1, A.shape[2]):
        total = total + A[:, :, k : k + 1] * B[:, k : k + 1, :]
    return total

"""A Joseph filter in 128 bits, problems of a given condition number, and forms of the covariance beside it."""

from dataclasses import dataclass

import mpmath
import numpy as np

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.streams import RandomSource

BITS = 128
EPOCHS = 8


@dataclass(frozen=True)
class Problem:
    """Six states, three channels with correlated noise; everything is a number of float32."""

    F: np.ndarray
    Q: np.ndarray
    H: np.ndarray
    R: np.ndarray
    z: np.ndarray
    cov0: np.ndarray

    def filter(self, kind, **options):
        return create_filter(kind, LinearDynamics(self.F, self.Q), LinearMeasurement(self.H, self.R), **options)


def single(x):
    """Round to float32, so that what all arithmetics are given is the same."""
    return np.asarray(x, dtype=np.float32).astype(float)


def orthogonal(rng, n):
    return np.linalg.qr(rng.normal(size=(n, n)))[0]


def problem(condition, seed=1):
    """A prior of this condition number, that the transition turns, and three channels in oblique directions.

    Sigmas go from 1 to the root of the condition number, those of the noise are about 10. There is next to no process
    noise, so what is known stays known.
    """
    rng = np.random.default_rng(seed)
    n, m = 6, 3
    widths = single(np.logspace(0, np.log10(condition) / 2, n))
    F = single(orthogonal(rng, n))
    G = rng.normal(size=(n, n))
    Q = single(1e-6 * G @ G.T)
    Q = (Q + Q.T) / 2
    H = single(rng.normal(size=(m, n)))
    R = 100 * single(np.array([[1.0, 0.3, -0.2], [0.3, 0.5, 0.1], [-0.2, 0.1, 2.0]]))
    x, z = widths * rng.normal(size=n), np.empty((EPOCHS, m))
    for k in range(EPOCHS):
        x = F @ x
        z[k] = H @ x + np.linalg.cholesky(R) @ rng.normal(size=m)
    return Problem(F, Q, H, single(R), single(z), np.diag(single(widths**2)))


def exactly(A):
    return mpmath.matrix(np.asarray(A, dtype=float).tolist())


def reference(given):
    """Return means and covariances after every epoch, in 128 bits, by Joseph's form."""
    with mpmath.workprec(BITS):
        F, Q, H, R = map(exactly, (given.F, given.Q, given.H, given.R))
        one = mpmath.eye(6)
        x, P, found = mpmath.zeros(6, 1), exactly(given.cov0), []
        for z in given.z:
            x, P = F * x, F * P * F.T + Q
            S = H * P * H.T + R
            K = mpmath.inverse(S).T * H * P.T
            K = K.T
            x = x + K * (exactly(z[:, None]) - H * x)
            P = (one - K * H) * P * (one - K * H).T + K * R * K.T
            found.append((x, P))
        return found


@dataclass(frozen=True)
class Distance:
    """How far an answer is from the reference, the largest over the epochs.

    Attributes:
        mean: sqrt(e^T P^-1 e) of the difference e of the means: in sigmas of the direction where that is largest.
        covariance: Largest eigenvalue of L^-1 (P' - P) L^-T with P = L L^T: the relative error of a variance in the
            direction where that is largest.
        definite: Whether every P' was positive definite.
    """

    mean: float
    covariance: float
    definite: bool


def distance(answers, references):
    """Compare means and covariances by epoch; a covariance may be a function that returns it in 128 bits."""
    mean, covariance, definite = 0.0, 0.0, True
    with mpmath.workprec(BITS):
        for (x, P), (x_ref, P_ref) in zip(answers, references, strict=True):
            if not (np.isfinite(x).all() and (callable(P) or np.isfinite(P).all())):
                return Distance(np.inf, np.inf, False)
            inverse = mpmath.inverse(mpmath.cholesky(P_ref))
            e = inverse * (exactly(np.asarray(x)[:, None]) - x_ref)
            mean = max(mean, float(mpmath.norm(e)))
            white = inverse * (P() if callable(P) else exactly(P)) * inverse.T
            values = mpmath.eigsy(white, eigvals_only=True)
            definite &= bool(min(values) > 0)
            covariance = max(covariance, float(max(abs(value - 1) for value in values)))
    return Distance(mean, covariance, definite)


def of_filter(kind, given, arithmetic, **options):
    """Return the answers of a filter of relnav, its covariance multiplied out of what it holds in 128 bits."""
    flt = given.filter(kind, arithmetic=arithmetic, **options)
    answers = []
    with np.errstate(all="ignore"):
        belief = flt.start(Gaussian(np.zeros((1, 6)), given.cov0[None]), RandomSource(0, (0,)))
        for k, z in enumerate(given.z):
            belief, innovation = flt.update(flt.predict(belief, Step(k)), z[None], Step(k))
            answers.append((belief.mean[0], _held(belief), not innovation.failed))
    return [answer[:2] for answer in answers], all(answer[2] for answer in answers)


def _held(belief):
    if hasattr(belief, "D"):
        U, D = belief.U[0].astype(float), belief.D[0].astype(float)
        return lambda: exactly(U) * mpmath.diag(D.tolist()) * exactly(U).T
    if hasattr(belief, "L"):
        L = belief.L[0].astype(float)
        return lambda: mpmath.inverse(exactly(L) * exactly(L).T)
    if hasattr(belief, "root"):
        root = belief.root[0].astype(float)
        return lambda: exactly(root) * exactly(root).T
    return belief.covariance[0]


def of_form(form, given, arithmetic):
    """Return the answers of a form that is written out here, in NumPy, or of Joseph's kernel."""
    dtype = np.dtype(arithmetic)
    F, Q, H, R, P = (A.astype(dtype) for A in (given.F, given.Q, given.H, given.R, given.cov0))
    x, answers = np.zeros(6, dtype), []
    if form == "root":
        X = np.linalg.cholesky(given.cov0).astype(dtype)
        G, N = np.linalg.cholesky(given.Q).astype(dtype), np.linalg.cholesky(given.R).astype(dtype)
    for z in given.z.astype(dtype):
        x = F @ x
        if form == "root":
            X = np.linalg.qr(np.hstack([F @ X, G]).T)[1].T
            M = np.linalg.qr(np.block([[N, H @ X], [np.zeros((6, 3), dtype), X]]).T)[1].T
            x = x + M[3:, :3] @ np.linalg.solve(M[:3, :3], z - H @ x)
            X = M[3:, 3:]
            held = X.astype(float)
            answers.append((x, lambda held=held: exactly(held) * exactly(held).T))
            continue
        P = F @ P @ F.T + Q
        S = H @ P @ H.T + R
        K = np.linalg.solve(S, H @ P).T
        x = x + K @ (z - H @ x)
        if form == "short":
            P = P - K @ (H @ P)
        else:
            A = np.eye(6, dtype=dtype) - K @ H
            P = A @ P @ A.T + K @ R @ K.T
        P = (P + P.T) / dtype.type(2)
        answers.append((x, P))
    return answers

"""Range, azimuth and elevation of many relative states, their derivatives, and the noise that an attitude error adds.

Shi et al. 2025, fig. 1: azimuth counts from the radar's x axis towards y, elevation towards minus z. With the line of
sight s = M r of the position r, p = (s_x^2 + s_y^2)^1/2 and the range q = |s|:

    az = atan2(s_y, s_x), el = atan2(-s_z, p),
    dq/ds = s / q, daz/ds = (-s_y, s_x, 0) / p^2, del/ds = (s_z s_x / p, s_z s_y / p, -p) / q^2.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inlined, inner, kernel
from relnav_sim.kernels.elementary import NARROW, atan2, atan_narrow, fused, hypot_narrow, wrapped
from relnav_sim.kernels.lanes import LANES, load_vectors, mirror, store, store_symmetric, store_vectors
from relnav_sim.kernels.sampling import SAMPLES


@kernel(given(2), given(2))
def spherical(states: Array, M: Array) -> Array:
    """Return range, azimuth and elevation (points, 3) of states (points, n >= 3), M (3, 3) from their axes to those."""
    points = len(states)
    z = np.empty((points, 3))
    s, h = np.empty((3, LANES)), np.empty((3, LANES))
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        seen(states, first, used, M, s)
        spherical_of(s, used, h)
        store_vectors(h, first, used, z)
    return z


@kernel(given(2), given(2))
def jacobian(states: Array, M: Array) -> Array:
    """Return the derivatives (points, 3, n) of `spherical` by the states."""
    points, n = states.shape
    H = np.empty((points, 3, n))
    s, h = np.empty((3, LANES)), np.zeros((3, n, LANES))
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        seen(states, first, used, M, s)
        derivatives(s, used, M, h)
        store(h, first, used, H)
    return H


@kernel(given(2), given(2), given(2), given(1))
def noise(states: Array, M: Array, P: Array, variances: Array) -> Array:
    """Return diag(variances) + G P G^T, (points, 3, 3), with P (3, 3) of an attitude error about the radar's axes."""
    points = len(states)
    R = np.empty((points, 3, 3))
    s, r = np.empty((3, LANES)), np.empty((3, 3, LANES))
    for first in range(0, points, LANES):
        used = min(LANES, points - first)
        seen(states, first, used, M, s)
        covariance(s, used, P, variances, r)
        store_symmetric(r, first, used, R)
    return R


@kernel(given(2), given(2), given(2), given(2), given(1))
def linearised(z: Array, m: Array, M: Array, P: Array, variances: Array) -> tuple[Array, Array, Array]:
    """Return z - h(m) with the angles in [-pi, pi), (runs, 3), `jacobian` and `noise` at m, in one pass.

    The noise is (1, 3, 3) where there is no attitude error.

    Args:
        z: Measurements (runs, 3).
        m: Means (runs, n).
        M: Rotation (3, 3) from the states' axes to the radar's.
        P: Covariance (3, 3) of the attitude error, rad^2.
        variances: Of range, azimuth and elevation (3,).
    """
    runs, n = m.shape
    turns = P.any()
    nu, H, R = np.empty((runs, 3)), np.empty((runs, 3, n)), np.zeros((runs if turns else 1, 3, 3))
    s, e, h = np.empty((3, LANES)), np.empty((3, LANES)), np.zeros((3, n, LANES))
    d, r = np.empty((3, LANES)), np.empty((3, 3, LANES))
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        seen(m, first, used, M, s)
        load_vectors(z, first, used, d)
        subtract_spherical(s, used, e, d)
        store_vectors(d, first, used, nu)
        derivatives(s, used, M, h)
        store(h, first, used, H)
        if turns:
            covariance(s, used, P, variances, r)
            store_symmetric(r, first, used, R)
    if not turns:
        for i in range(3):
            R[0, i, i] = variances[i]
    return nu, H, R


@kernel(given(2), given(3), given(2), given(3), given(3), given(2), wide=True)
def squared_errors(z: Array, W: Array, centre: Array, root: Array, e: Array, M: Array) -> Array:
    """Return |W (z - h(x))|^2 (runs, N) of measurements and `spherical` of the states x = centre + root e.

    Differences of angles, in [-pi, pi], are taken as one angle: in axes turned by the azimuth that was read, the line
    of sight lies at minus that difference; likewise, in the vertical plane through it, for the elevation.

    Args:
        z: Measurements (runs, 3).
        W: Whitening (runs or 1, 3, 3), lower triangular.
        centre: (runs, n >= 3).
        root: (runs, n, 3), of which the first three rows count.
        e: Samples (runs or 1, 3, N).
        M: Rotation (3, 3) from the states' axes to the radar's.
    """
    runs, N = len(z), e.shape[2]
    errors = np.empty((runs, N))
    axes, c, A = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for run in range(runs):
        samples, w = e[0 if len(e) == 1 else run], W[0 if len(W) == 1 else run]
        square_errors(z[run], w, centre[run], root[run], samples, M, axes, c, A, errors[run])
    return errors


@inner
def square_errors(
    z: Array,
    W: Array,
    centre: Array,
    root: Array,
    e: Array,
    M: Array,
    axes: Array,
    c: Array,
    A: Array,
    errors: Array,
) -> None:
    """Do as `squared_errors` for one run, errors (N,); axes (3, 3), c (3,) and A (3, 3) are room."""
    ca, sa, ce, se = math.cos(z[1]), math.sin(z[1]), math.cos(z[2]), math.sin(z[2])
    for j in range(3):
        axes[0, j], axes[1, j], axes[2, j] = ca * M[0, j] + sa * M[1, j], ca * M[1, j] - sa * M[0, j], M[2, j]
    for i in range(3):
        c[i] = axes[i, 0] * centre[0] + axes[i, 1] * centre[1] + axes[i, 2] * centre[2]
        for k in range(3):
            A[i, k] = axes[i, 0] * root[0, k] + axes[i, 1] * root[1, k] + axes[i, 2] * root[2, k]
    N = len(errors)
    for first in range(0, N, SAMPLES):
        last = min(first + SAMPLES, N)
        e0, e1, e2 = e[0, first:last], e[1, first:last], e[2, first:last]
        out = errors[first:last]
        # Nearly always all of them lie close to where they were read, and two quotients will do for all.
        aside = False
        for b in range(last - first):
            x, y, h = _image(c, A, e0[b], e1[b], e2[b])
            across = y / x
            p = hypot_narrow(x, across)
            u, v = fused(p, ce, h * -se), fused(p, se, h * ce)
            up = v / u
            aside |= not (x > 0 and u > 0 and abs(across) <= NARROW and abs(up) <= NARROW)
            range_error = z[0] - hypot_narrow(u, up)
            out[b] = _square(W, range_error, -atan_narrow(across), atan_narrow(up))
        if aside:
            for b in range(last - first):
                x, y, h = _image(c, A, e0[b], e1[b], e2[b])
                p = math.sqrt(x * x + y * y)
                range_error = z[0] - math.sqrt(x * x + y * y + h * h)
                out[b] = _square(W, range_error, -atan2(y, x), atan2(p * se + h * ce, p * ce - h * se))


@inlined
def _image(c: Array, A: Array, e0: float, e1: float, e2: float) -> tuple[float, float, float]:
    """Return c + A e."""
    return (
        fused(A[0, 2], e2, fused(A[0, 1], e1, fused(A[0, 0], e0, c[0]))),
        fused(A[1, 2], e2, fused(A[1, 1], e1, fused(A[1, 0], e0, c[1]))),
        fused(A[2, 2], e2, fused(A[2, 1], e1, fused(A[2, 0], e0, c[2]))),
    )


@inlined
def _square(W: Array, r0: float, r1: float, r2: float) -> float:
    """Return |W r|^2, W lower triangular."""
    w0, w1 = W[0, 0] * r0, fused(W[1, 1], r1, W[1, 0] * r0)
    w2 = fused(W[2, 2], r2, fused(W[2, 1], r1, W[2, 0] * r0))
    return fused(w2, w2, fused(w1, w1, w0 * w0))


@inner
def seen(states: Array, first: int, used: int, M: Array, s: Array) -> None:
    """Set s (3, LANES) to M r, r the first three of the states (points, n).

    Entries of M that are zero are passed over: the others keep the sign of a zero, on which side of pi an azimuth is.
    """
    for i in range(3):
        for b in range(used):
            s[i, b] = -0.0
        for j in range(3):
            if M[i, j] != 0:
                for b in range(used):
                    s[i, b] += M[i, j] * states[first + b, j]


@inner
def spherical_of(s: Array, used: int, z: Array) -> None:
    """Set z to range, azimuth and elevation of the lines of sight s, (3, LANES) both."""
    for b in range(used):
        level = s[0, b] * s[0, b] + s[1, b] * s[1, b]
        z[0, b] = math.sqrt(s[2, b] * s[2, b] + level)
        z[2, b] = math.sqrt(level)
    for b in range(used):
        z[1, b] = atan2(s[1, b], s[0, b])
    for b in range(used):
        z[2, b] = atan2(-s[2, b], z[2, b])


@inner
def linearise(x: Array, used: int, M: Array, P: Array, variances: Array, w: Array, h: Array, r: Array) -> None:
    """Do as `linearised` in lanes.

    Args:
        x: Means (n, LANES).
        used: How many lanes there are.
        M: Rotation (3, 3) from the states' axes to the radar's.
        P: Covariance (3, 3) of the attitude error.
        variances: (3,).
        w: Measurements (3, LANES), which residuals take the place of.
        h: Gets the Jacobians (3, n, LANES), of which the columns behind the third are left.
        r: Gets the noise (3, 3, LANES).
    """
    s, room = np.empty((3, LANES)), np.empty((3, LANES))
    seen(x.T, 0, used, M, s)
    subtract_spherical(s, used, room, w)
    derivatives(s, used, M, h)
    noise_along(s, used, P, variances, r)


@inner
def noise_along(s: Array, used: int, P: Array, variances: Array, r: Array) -> None:
    """Set r (3, 3, LANES) to the noise along the lines of sight s."""
    if P.any():
        covariance(s, used, P, variances, r)
        mirror(r, used, r)
    else:
        for i in range(3):
            for j in range(3):
                for b in range(used):
                    r[i, j, b] = variances[i] if i == j else 0.0


@inner
def subtract_spherical(s: Array, used: int, e: Array, d: Array) -> None:
    """Subtract the prediction along s from the measurements d, with angles in [-pi, pi); all (3, LANES), e is room."""
    spherical_of(s, used, e)
    for i in range(3):
        for b in range(used):
            d[i, b] -= e[i, b]
    for i in range(1, 3):
        for b in range(used):
            d[i, b] = wrapped(d[i, b])


@inner
def derivatives(s: Array, used: int, M: Array, H: Array) -> None:
    """Set the first three columns of H (3, n, LANES) to dh/ds M."""
    g = np.empty((3, 3, LANES))
    for b in range(used):
        x, y, z = s[0, b], s[1, b], s[2, b]
        in_plane = x * x + y * y
        squared = in_plane + z * z
        distance, level = math.sqrt(squared), math.sqrt(in_plane)
        slope = z / (squared * level)
        g[0, 0, b], g[0, 1, b], g[0, 2, b] = x / distance, y / distance, z / distance
        g[1, 0, b], g[1, 1, b], g[1, 2, b] = -y / in_plane, x / in_plane, 0.0
        g[2, 0, b], g[2, 1, b], g[2, 2, b] = slope * x, slope * y, -level / squared
    for i in range(3):
        for j in range(3):
            for b in range(used):
                H[i, j, b] = -0.0
            for k in range(3):
                if M[k, j] != 0:
                    for b in range(used):
                        H[i, j, b] += M[k, j] * g[i, k, b]


@inner
def covariance(s: Array, used: int, P: Array, variances: Array, R: Array) -> None:
    """Set the lower triangle of R (3, 3, LANES) to diag(variances) + G P G^T, G = [0; a^T; e^T].

    A turn dtheta moves the azimuth by a = (s_z s_x / p^2, s_z s_y / p^2, -1) and the elevation by (s_y, -s_x, 0) / p.
    """
    for b in range(used):
        x, y, z = s[0, b], s[1, b], s[2, b]
        in_plane = x * x + y * y
        level = math.sqrt(in_plane)
        slope = z / in_plane
        a0, a1, e0, e1 = slope * x, slope * y, y / level, -x / level
        R[0, 0, b], R[1, 0, b], R[2, 0, b] = variances[0], 0.0, 0.0
        Pa0 = P[0, 0] * a0 + P[0, 1] * a1 - P[0, 2]
        Pa1 = P[1, 0] * a0 + P[1, 1] * a1 - P[1, 2]
        Pa2 = P[2, 0] * a0 + P[2, 1] * a1 - P[2, 2]
        R[1, 1, b] = a0 * Pa0 + a1 * Pa1 + (variances[1] - Pa2)
        R[2, 1, b] = e0 * Pa0 + e1 * Pa1
        R[2, 2, b] = e0 * (P[0, 0] * e0 + P[0, 1] * e1) + e1 * (P[1, 0] * e0 + P[1, 1] * e1) + variances[2]

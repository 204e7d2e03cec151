"""Every particle's own unscented update, from which the unscented particle filter draws.

Van der Merwe, Doucet, de Freitas and Wan, The Unscented Particle Filter, CUED/F-INFENG/TR 380, 2000. All is in the
coordinates xi of the particle's process noise, x = f(ancestor) + G xi, where its transition density is N(0, I).
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import flag, given, inner, integer, kernel
from relnav_sim.kernels.elementary import log, wrapped
from relnav_sim.kernels.lanes import LANES, factor, forward, forward_vectors


@kernel(given(3), given(4), integer)
def sigma_points(centres: Array, G: Array, j: int) -> Array:
    """Return the particles (runs, 2, n, N) at +- sqrt(r) e_j in xi.

    Args:
        centres: f(ancestor), (runs, n, N).
        G: (1, 1, n, r), (runs, 1, n, r) or (runs, N, n, r).
        j: Column of G.
    """
    runs, n, N = centres.shape
    points = np.empty((runs, 2, n, N))
    scale = math.sqrt(G.shape[3])
    for run in range(runs):
        g = G[run if len(G) > 1 else 0]
        own = 1 if len(g) > 1 else 0
        for i in range(n):
            for p in range(N):
                offset = scale * g[own * p, i, j]
                points[run, 0, i, p] = centres[run, i, p] + offset
                points[run, 1, i, p] = centres[run, i, p] - offset
    return points


@kernel(given(5), given(3), given(3), given(1, flag), given(3))
def propose(image: Array, centre: Array, z: Array, angle: Mask, R: Array) -> tuple[Array, Array, Array]:
    """Return every particle's q: mean (runs, r, N), directions u (runs, m, r, N) and shrinkage s (runs, m, N).

    q = N(mean, A A^T), A = A_1 A_2 ... A_m with A_a = I - u_a u_a^T / (1 + s_a).

    With the images h+ and h- of the sigma points less that of the centre, the covariance of xi and z has rows
    C_j = (h+ - h-) / (2 sqrt r), and S = C^T C + M, M = R + the spread of the mid-images (h+ + h-) / 2. Then
    mean = C S^-1 nu and covariance I - C S^-1 C^T, whose square root is built up one component of the whitened
    measurement at a time (Potter 1963; Bierman 1977). Its factors s_a are ratios of the diagonals of the Cholesky
    factors of M and S, so a peaked likelihood costs no digits.

    Args:
        image: h of the sigma points, (r, runs, 2, N, m).
        centre: h of the centres, (runs, N, m).
        z: The measurement (runs, 1, m), or (runs, N, m) one for each particle.
        angle: Which components are angles, whose differences are wrapped, (m,).
        R: (runs, m, m), or (1, m, m) for all runs.
    """
    r, runs, _, N, m = image.shape
    mean, directions, shrinkage = np.empty((runs, r, N)), np.empty((runs, m, r, N)), np.empty((runs, m, N))
    C, mid, middle, nu = np.empty((m, r, LANES)), np.empty((m, r, LANES)), np.empty((m, LANES)), np.empty((m, LANES))
    M, S = np.empty((m, m, LANES)), np.empty((m, m, LANES))
    L_M, L_S, u = np.zeros((m, m, LANES)), np.zeros((m, m, LANES)), np.empty((m, r, LANES))
    s, along = np.empty((m, LANES)), np.empty(LANES)
    share, scale = 1 / r, 1 / (2 * math.sqrt(r))
    for run in range(runs):
        noise = R[run if len(R) > 1 else 0]
        for first in range(0, N, LANES):
            used = min(LANES, N - first)
            middle_image = centre[run, first : first + used]
            for a in range(m):
                for b in range(used):
                    nu[a, b] = z[run, first + b if z.shape[1] > 1 else 0, a] - middle_image[b, a]
                    middle[a, b] = 0.0
                _wrap(nu[a], angle[a], used)
                for j in range(r):
                    ahead, behind = C[a, j], mid[a, j]
                    plus, minus = image[j, run, 0, first : first + used], image[j, run, 1, first : first + used]
                    for b in range(used):
                        ahead[b] = plus[b, a] - middle_image[b, a]
                        behind[b] = minus[b, a] - middle_image[b, a]
                    _wrap(ahead, angle[a], used)
                    _wrap(behind, angle[a], used)
                    for b in range(used):
                        difference = ahead[b] - behind[b]
                        behind[b] = 0.5 * (ahead[b] + behind[b])
                        ahead[b] = scale * difference
                        middle[a, b] += share * behind[b]
                for b in range(used):
                    nu[a, b] -= middle[a, b]
            for a in range(m):
                for c in range(a + 1):
                    for b in range(used):
                        M[a, c, b] = noise[a, c] - middle[a, b] * middle[c, b]
                        S[a, c, b] = 0.0
                    for j in range(r):
                        for b in range(used):
                            M[a, c, b] += share * (mid[a, j, b] * mid[c, j, b])
                            S[a, c, b] += C[a, j, b] * C[c, j, b]
                    for b in range(used):
                        S[a, c, b] += M[a, c, b]
            factor(M, used, L_M)
            factor(S, used, L_S)
            forward(L_S, used, C)
            forward_vectors(L_S, used, nu)
            for j in range(r):
                for b in range(used):
                    mid[0, j, b] = C[0, j, b] * nu[0, b]
                for a in range(1, m):
                    for b in range(used):
                        mid[0, j, b] += C[a, j, b] * nu[a, b]
            _give(mid[0], first, used, mean[run])
            for a in range(m):
                for j in range(r):
                    for b in range(used):
                        u[a, j, b] = C[a, j, b]
                # A_c^-1 = I + u_c u_c^T / (s_c (1 + s_c))
                for c in range(a):
                    _dot(u[c], u[a], used, along)
                    for b in range(used):
                        along[b] /= s[c, b] * (1 + s[c, b])
                    for j in range(r):
                        for b in range(used):
                            u[a, j, b] += u[c, j, b] * along[b]
                for b in range(used):
                    s[a, b] = L_M[a, a, b] / L_S[a, a, b]
                _give(u[a], first, used, directions[run, a])
            _give(s, first, used, shrinkage[run])
    return mean, directions, shrinkage


@kernel(given(3), given(4), given(3), given(3))
def draw(mean: Array, directions: Array, shrinkage: Array, normals: Array) -> tuple[Array, Array]:
    """Return xi of q (runs, r, N) from standard normal numbers, and the logarithm of p / q there, (runs, N).

    Args:
        mean: (runs, r, N), as the next two from `propose`.
        directions: u, (runs, m, r, N).
        shrinkage: s, (runs, m, N).
        normals: (runs, r, N).
    """
    runs, r, N = mean.shape
    m = shrinkage.shape[1]
    xi, log_ratio = np.empty((runs, r, N)), np.empty((runs, N))
    x, u, along, ratio = np.empty((r, LANES)), np.empty((r, LANES)), np.empty(LANES), np.empty(LANES)
    for run in range(runs):
        for first in range(0, N, LANES):
            used = min(LANES, N - first)
            _take(normals[run], first, used, x)
            _dot(x, x, used, ratio)
            for b in range(used):
                ratio[b] *= 0.5
            for a in range(m - 1, -1, -1):
                _take(directions[run, a], first, used, u)
                _dot(u, x, used, along)
                s = shrinkage[run, a, first : first + used]
                for b in range(used):
                    along[b] /= 1 + s[b]
                    ratio[b] += log(s[b])
                for j in range(r):
                    for b in range(used):
                        x[j, b] -= u[j, b] * along[b]
            _take(mean[run], first, used, u)
            for j in range(r):
                for b in range(used):
                    x[j, b] += u[j, b]
            _give(x, first, used, xi[run])
            _dot(x, x, used, along)
            result = log_ratio[run, first : first + used]
            for b in range(used):
                result[b] = ratio[b] - 0.5 * along[b]
    return xi, log_ratio


@inner
def _take(x: Array, first: int, used: int, out: Array) -> None:
    """Copy particles (r, N) from `first` on to lanes (r, LANES)."""
    for j in range(len(out)):
        block = x[j, first : first + used]
        for b in range(used):
            out[j, b] = block[b]


@inner
def _give(x: Array, first: int, used: int, out: Array) -> None:
    """Copy lanes (r, LANES) back to particles (r, N) from `first` on."""
    for j in range(len(x)):
        block = out[j, first : first + used]
        for b in range(used):
            block[b] = x[j, b]


@inner
def _wrap(difference: Array, angle: bool, used: int) -> None:
    """Take an angle's difference (LANES,) into [-pi, pi]."""
    if angle:
        for b in range(used):
            difference[b] = wrapped(difference[b])


@inner
def _dot(x: Array, y: Array, used: int, out: Array) -> None:
    """Set out (LANES,) to x^T y of x and y (r, LANES)."""
    for b in range(used):
        out[b] = x[0, b] * y[0, b]
    for j in range(1, len(x)):
        for b in range(used):
            out[b] += x[j, b] * y[j, b]

"""What errors of a radar do to its readings, against angles and rotations in NumPy and against differences."""

import numpy as np
import pytest
from checks import check_runs_are_alone

from relnav_sim import kernels
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, mounting_matrix

M = mounting_matrix(30.0, -20.0, 75.0) @ NADIR_FROM_RTN


def problem(points, e, cartesian):
    rng = np.random.default_rng([points, e])
    E = rng.standard_normal((6, e)) * np.array([5.0, 1e-2, 1e-2, 1e-3, 1e-3, 1e-3])[:, None]
    positions = rng.standard_normal((points, 3)) * 1000
    predicted = positions if cartesian else np.array([read(M @ r) for r in positions])
    return predicted, rng.standard_normal((points, e)), E


def read(s):
    return np.array([np.linalg.norm(s), np.arctan2(s[1], s[0]), np.arctan2(-s[2], np.hypot(s[0], s[1]))])


def sight(q, azimuth, elevation):
    level = q * np.cos(elevation)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), -q * np.sin(elevation)])


def distorted(predicted, b, E, cartesian):
    errors = E @ b
    s = sight(*((read(M @ predicted) if cartesian else predicted) + errors[:3]))
    s = s + np.cross(s, errors[3:])
    return M.T @ s if cartesian else read(s)


@pytest.mark.parametrize("cartesian", [True, False], ids=["position", "angles"])
@pytest.mark.parametrize(("points", "e"), [(1, 1), (7, 6), (33, 2), (1000, 3)])
def test_readings_and_their_derivatives(points, e, cartesian):
    predicted, extra, E = problem(points, e, cartesian)
    rest = E, M, cartesian
    expected = np.array([distorted(p, b, E, cartesian) for p, b in zip(predicted, extra, strict=True)])
    scale = np.abs(expected).max(axis=0)
    z = kernels.distortion.readings(predicted, extra, *rest)
    np.testing.assert_allclose(z / scale, expected / scale, rtol=1e-12, atol=1e-14)
    by_predicted, by_extra = kernels.distortion.by_both(predicted, extra, *rest)
    for derivatives, place, widths in (
        (by_predicted, 0, np.full(3, 1e-2) if cartesian else np.array([1e-2, 1e-6, 1e-6])),
        (by_extra, 1, np.full(e, 1e-5)),
    ):
        for j, width in enumerate(widths):
            ahead, behind = ([x.copy() for x in (predicted, extra)] for _ in range(2))
            ahead[place][:, j] += width
            behind[place][:, j] -= width
            change = kernels.distortion.readings(*ahead, *rest) - kernels.distortion.readings(*behind, *rest)
            if not cartesian:  # across the cut at pi
                change[:, 1] = np.angle(np.exp(1j * change[:, 1]))
            # Rounding of the readings over the width, and what the second derivative leaves near the azimuth's axis.
            size = np.abs(derivatives).max(axis=(1, 2))[:, None]
            assert (np.abs(change / (2 * width) - derivatives[:, :, j]) < 1e-5 * size + 1e-12 * scale / width).all()
    if points > 1:
        check_runs_are_alone(kernels.distortion.readings, (predicted, extra), *rest)
        check_runs_are_alone(kernels.distortion.by_both, (predicted, extra), *rest)

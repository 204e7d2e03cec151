import numpy as np
import pytest
from gravity_in_lanes import gradient

from relnav_sim.astro.constants import J2, MU_M3_S2, RADIUS_M
from relnav_sim.astro.gravity import Gravity
from relnav_sim.dynamics.averaged_j2 import AveragedJ2, SchweighartSedwickOptions
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Step


def test_without_j2_it_is_clohessy_and_wiltshire(scene):
    orbit = scene(0.0, j2=0.0).orbit
    F = AveragedJ2(orbit).transition(np.array([0.0, 1234.5]), 60.0)
    np.testing.assert_allclose(F, np.broadcast_to(cw_transition(orbit.mean_motion_rad_s, 60.0), F.shape), atol=1e-11)


@pytest.mark.parametrize("i_deg", [0.5, 30.0, 51.6, 97.6])
def test_in_plane_terms_are_the_average_gradient_of_j2(scene, i_deg):
    orbit = scene(0.0, i_deg).orbit
    u, i, n = np.linspace(0, 2 * np.pi, 64, endpoint=False), orbit.inclination_rad, orbit.mean_motion_rad_s
    zero = np.zeros_like(u)
    R = np.stack([np.cos(u), np.sin(u) * np.cos(i), np.sin(u) * np.sin(i)])
    T = np.stack([-np.sin(u), np.cos(u) * np.cos(i), np.cos(u) * np.sin(i)])
    N = np.stack([zero, zero - np.sin(i), zero + np.cos(i)])
    axes, position = np.stack([R, T, N]), (7e6 * R)[None]
    oblate = gradient(Gravity(MU_M3_S2, RADIUS_M, J2), position) - gradient(Gravity(MU_M3_S2), position)
    average = np.einsum("ijk,jlk,mlk->im", axes, oblate[:, :, 0], axes) / len(u) / n**2
    s = 3 * J2 * (RADIUS_M / 7e6) ** 2 * (1 + 3 * np.cos(2 * i)) / 8
    np.testing.assert_allclose(average, np.diag([4 * s, -s, -3 * s]), atol=1e-12)
    A = AveragedJ2(orbit).in_plane / n**2
    # 3 + 5 s: the average gradient and the faster turn of the frame, n c.
    assert A[2, 0] == pytest.approx(3 + 5 * s, rel=1e-12)
    assert A[2, 3] * n == pytest.approx(2 * np.sqrt(1 + s), rel=1e-12)


@pytest.mark.parametrize("i_deg", [30.0, pytest.param(51.6, marks=pytest.mark.slow), 97.6])
def test_growth_across_the_orbit_is_the_true_one(scene, i_deg):
    """Planes of different inclination drift apart under J2: up to 0.4 % of the distance a revolution."""
    s = scene(0.0, i_deg)
    revolutions, per = 8, 40
    times = np.arange(revolutions * per + 1) * s.period_s / per
    u, tilt = s.orbit.argument_of_perigee_rad + s.orbit.true_anomaly_rad, 100.0
    # r di = tilt and r sin i dO = tilt: the angle between the planes grows at half the rate of the node's drift.
    across = tilt * np.array([np.sin(u) - np.cos(u), s.orbit.mean_motion_rad_s * (np.cos(u) + np.sin(u))])
    x0 = np.array([[0, 0, across[0], 0, 0, across[1]]])
    truth = s.truth(x0, times, zonals=(J2,))[1][0, :, 2]
    dynamics, x, z = SchweighartSedwickOptions().build(DynamicsContext(s.orbit, s.noise, times[1])), x0, [x0[0, 2]]
    for k in range(1, len(times)):
        x = dynamics.propagate(x, Step(k))
        z.append(x[0, 2])
    squares = [np.square(series[1:]).reshape(revolutions, per).mean(axis=1) for series in (np.array(z), truth)]
    growth = [np.sqrt(square[-1] / square[0]) - 1 for square in squares]
    drift = 2 * np.pi * (revolutions - 1) * 1.5 * J2 * (RADIUS_M / 7e6) ** 2 * np.sin(s.orbit.inclination_rad) ** 2
    assert growth[1] == pytest.approx(drift / 2, rel=0.15)
    assert growth[0] == pytest.approx(growth[1], rel=0.1)

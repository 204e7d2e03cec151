"""Orbits about the Earth as it is: other programs, what is conserved, steps, and independence of the batch."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from relnav_sim import ForceModel, GravityField, kernels, propagate
from relnav_sim.astro.atmosphere import LayeredAtmosphere
from relnav_sim.astro.earth_orientation import eme2000_from_gcrf, gcrf_from_eme2000
from relnav_sim.astro.orbits import Elements, state_from_elements
from relnav_sim.astro.sky import still_sky
from relnav_sim.truth.propagation import DenseTrajectory
from relnav_sim.truth.stepping import Batch

EPOCH = "2010-07-27T00:00:00 UTC"
AREA = 0.01
FIELDS = {degree: GravityField.load("ggm05s", degree, degree) for degree in (8, 12, 40, 60)}

# By brahe 1.8.1, RKN1210 with a relative tolerance of 1e-14, GGM05S alone, IAU 2006/2000A, UT1 - UTC and polar motion
# zero: degree, state (GCRF) at the epoch, position and velocity a day later. At 1e-13 it is 8e-6 m elsewhere.
BRAHE = [
    (
        40,
        [6.85e6, 1e4, -2e4, 100.0, 1e3, 7.55e3],
        [-5189935.484436718, 669365.8000260151, 4414435.522290808],
        [-4906.977525718838, -686.9270731048113, -5784.395696012488],
    ),
    (
        60,
        [5.0e6, -4.5e6, 2e4, 400.0, 600.0, 7.6e3],
        [3533794.134768723, -2640920.6638420844, 4941426.786434843],
        [-4016.0081073813353, 4359.520908031646, 4988.472265875903],
    ),
    (
        8,
        [1.2e7, 1e4, -2e4, 100.0, 4e3, 4.2e3],
        [-12110422.17750348, 1701965.6107252534, 1657647.6598510598],
        [-1006.0409976294055, -3822.1165062028904, -4023.8210950725684],
    ),
]


def force_of(degree, **others):
    field = FIELDS[degree]
    return ForceModel(field.mu_m3_s2, field.radius_m, zonals=(), gravity=field, epoch=EPOCH, **others)


def everything(radiation=True):
    return force_of(12, atmosphere=LayeredAtmosphere(), third_bodies=("sun", "moon"), radiation=radiation)


def dispersed(count, a=6.85e6, e=0.0, size=(1e3, 1.0)):
    nominal = state_from_elements(Elements(a, e, 1.5, 0.3, 0.2, 0.1), FIELDS[40].mu_m3_s2)
    return nominal + np.random.default_rng(5).normal(size=(count, 6)) * np.repeat(size, 3)


@pytest.mark.parametrize("degree, start, position, velocity", BRAHE)
def test_brahe_flies_the_same_day(degree, start, position, velocity):
    found = propagate(eme2000_from_gcrf(start)[None], [86_400.0], force_of(degree))
    found = gcrf_from_eme2000(found)[0, 0]
    assert np.abs(found[:3] - position).max() < 3e-5
    assert np.abs(found[3:] - velocity).max() < 3e-8


def test_scipy_flies_the_same_under_every_force_but_sunlight():
    """SciPy's integrator of the same method with short steps on the same accelerations at the same times."""
    force, state = everything(radiation=False), dispersed(1)[0]

    def slope(t, y):
        return np.concatenate([y[3:], force.acceleration(y, AREA, t)])

    times = np.linspace(0.0, 6000.0, 101)
    peer = solve_ivp(slope, (0, 6000), state, method="DOP853", rtol=1e-13, atol=1e-9, max_step=40, dense_output=True)
    found = propagate(state[None], times, force, AREA)[0]
    assert np.abs(found - peer.sol(times).T)[:, :3].max() < 5e-6


def test_the_jacobi_integral_is_conserved_for_a_day(monkeypatch):
    """About an Earth that turns evenly v^2/2 - U - w (x vy - y vx) stays the same, to 1e-11 of itself."""
    monkeypatch.setattr(ForceModel, "_sky", lambda self, first_s, last_s: still_sky(first_s, last_s))
    field = FIELDS[12]
    times = np.linspace(0.0, 86_400.0, 49)
    x, y, z, vx, vy, vz = np.moveaxis(propagate(dispersed(3, 7e6, 0.02), times, force_of(12)), -1, 0)
    rate = 2 * np.pi * (1 + kernels.sky.TURNS_A_DAY_BEYOND_ONE) / 86_400.0
    angle = rate * times
    fixed = np.stack([x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle), z], axis=-1)
    jacobi = (vx * vx + vy * vy + vz * vz) / 2 - potential(field, fixed) - rate * (x * vy - y * vx)
    assert np.abs(jacobi / jacobi[:, :1] - 1).max() < 1e-11


def potential(field, p):
    """Return the potential at p (..., 3) by normalised Legendre functions, degree by degree."""
    r = np.sqrt(np.square(p).sum(axis=-1))
    sine, cosine, longitude = p[..., 2] / r, np.hypot(p[..., 0], p[..., 1]) / r, np.arctan2(p[..., 1], p[..., 0])
    total, sectoral = np.zeros_like(r), np.ones_like(r)
    for m in range(field.order + 1):
        if m:
            sectoral = sectoral * cosine * np.sqrt(3 if m == 1 else (2 * m + 1) / (2 * m))
        before, P = np.zeros_like(r), sectoral
        for n in range(m, field.degree + 1):
            if n > m:
                a = np.sqrt((2 * n + 1) * (2 * n - 1) / ((n - m) * (n + m)))
                below = np.sqrt((n - 1 - m) * (n - 1 + m) / ((2 * n - 1) * (2 * n - 3)))
                before, P = P, a * (sine * P - below * before)
            wave = field.C[n, m] * np.cos(m * longitude) + field.S[n, m] * np.sin(m * longitude)
            total += (field.radius_m / r) ** n * P * wave
    return field.mu_m3_s2 / r * total


@pytest.mark.parametrize(
    "degree, a, e, within_m",
    [
        (40, 6.75e6, 0.0, 1e-5),
        (40, 2.66e7, 0.74, 1e-4),
        *(pytest.param(*other, marks=pytest.mark.slow) for other in ((60, 6.85e6, 0.0, 1e-5), (40, 7.2e6, 0.0, 1e-5))),
    ],
)
def test_half_a_day_is_exact_and_so_are_differences(degree, a, e, within_m):
    """At the default tolerance, against steps of half the length."""
    states, times = dispersed(3, a, e), np.linspace(0.0, 43_200.0, 200)
    coarse, fine = (propagate(states, times, force_of(degree), rtol=rtol) for rtol in (1e-12, 1e-14))
    error = (coarse - fine)[..., :3]
    assert np.abs(error).max() < within_m
    assert np.abs(error - error[:1]).max() < within_m


def test_neighbours_take_the_same_steps_and_none_is_rejected():
    """Over mountains as over the sea, although the error estimate there is a thousand times smaller."""
    trajectory = DenseTrajectory(dispersed(20), force_of(60))
    trajectory.at([20_000.0])
    flights = trajectory._batch._flights
    assert len(np.unique(flights.base)) == 1
    assert not flights.level.any()
    assert np.array_equal(flights.steps, np.full(20, 20_000.0 // flights.base[0] + 1))


def test_steps_grow_away_from_the_earth_and_are_at_most_a_day():
    trajectory = DenseTrajectory(dispersed(1, 2.66e7, 0.74), force_of(60))
    trajectory.at(np.linspace(0.0, 43_000.0, 50))
    spans = trajectory._batch._flights.spans[0, : trajectory._batch._flights.steps[0]]
    assert spans[:, 2].max() > 8 * spans[:, 2].min()
    far = DenseTrajectory([[9e8, 0.0, 0.0, 0.0, 800.0, 0.0]], force_of(8), rtol=1e-6)
    far.at([2e6])
    assert not far.failures
    assert far._batch._flights.spans[0, : far._batch._flights.steps[0], 2].max() <= 86_400.0


def test_bits_depend_neither_on_the_batch_nor_on_other_times():
    states, times, force = dispersed(20), np.arange(0.0, 100_000.0, 5000.0), everything()
    whole = propagate(states, times, force, AREA, radiation_m2_kg=AREA)
    for rows in ([0], [19, 7, 12], list(range(13, 20))):
        assert np.array_equal(propagate(states[rows], times, force, AREA, radiation_m2_kg=AREA), whole[rows])
    some = propagate(states[:2], times[:5], force, AREA, radiation_m2_kg=AREA)
    assert np.array_equal(some, whole[:2, :5])


def test_it_is_the_same_from_a_later_epoch():
    """Times are rounded differently, by 1e-12 s; the sky's polynomials are made for other days."""
    states, force = dispersed(2), everything()
    whole = propagate(states, [30_000.0, 60_000.0], force, AREA)
    later = ForceModel(**(vars_of(force) | {"epoch": force.epoch.later(30_000.0)}))
    apart = propagate(whole[:, 0], [30_000.0], later, AREA)[:, 0] - whole[:, 1]
    assert np.abs(apart[:, :3]).max() < 5e-5


def vars_of(force):
    return {name: getattr(force, name) for name in force.__dataclass_fields__}


def test_time_runs_backwards_to_where_it_came_from():
    states, force = dispersed(2), force_of(40, third_bodies=("sun", "moon"))
    back = Batch(states * [1, 1, 1, -1, -1, -1], force, np.zeros(2), np.zeros(2), 1e-12, kept_steps=1, sense=-1.0)
    before = np.empty((2, 1, 6))
    back.write(np.array([20_000.0]), before)
    earlier = ForceModel(**(vars_of(force) | {"epoch": force.epoch.later(-20_000.0)}))
    found = propagate(before[:, 0] * [1, 1, 1, -1, -1, -1], [20_000.0], earlier)[:, 0]
    assert np.abs(found - states)[:, :3].max() < 3e-5


def test_layers_and_sky_over_a_zonal_body_as_over_its_own_kernel():
    """Without Sun and Moon's pull, within rounding, the kernel of fields does what that of zonal bodies does."""
    states, times = dispersed(2), np.linspace(0.0, 20_000.0, 5)
    plain = ForceModel(3.986e14, 6378137.0)
    lit = ForceModel(3.986e14, 6378137.0, epoch=EPOCH, radiation=True)
    apart = propagate(states, times, plain) - propagate(states, times, lit)
    assert np.abs(apart[..., :3]).max() < 1e-5

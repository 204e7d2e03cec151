"""Orbits in sunlight through the Earth's shadow: SciPy's integrator with short steps in the penumbra, and the steps."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from relnav_sim import ForceModel, GravityField, propagate
from relnav_sim.astro.atmosphere import LayeredAtmosphere
from relnav_sim.astro.orbits import Elements, state_from_elements
from relnav_sim.astro.sun_moon import sun_position
from relnav_sim.kernels.sky import SHARE_OF_WAY, SUN_RADIUS_M, longest_by_shadow
from relnav_sim.truth.propagation import DenseTrajectory

FIELD = GravityField.load("ggm05s", 4, 4)
SUMMER, EQUINOX = "2010-07-27T00:00:00 GPS", "2010-03-21T00:00:00 GPS"
AREA = 0.013
ORBITS = {
    "low": (SUMMER, Elements(6.778e6, 1e-4, 0.9, 1.0, 2.0, 3.0)),
    "sun-synchronous": (SUMMER, Elements(7.138e6, 1e-4, 1.72, 1.3, 1.0, 5.0)),
    "geostationary": (EQUINOX, Elements(4.2164e7, 1e-4, 1e-3, 1.0, 2.0, 4.0)),
    "e = 0.7": (SUMMER, Elements(2.4e7, 0.7, 1.1, 5.3, 4.0, 3.0)),
    "penumbra alone": (SUMMER, Elements(2.4e7, 0.7, 1.1, 4.3, 0.5, 3.0)),
}

SOME_ORBITS = [pytest.param(name, marks=[] if name == "low" else pytest.mark.slow) for name in ORBITS]


def force_at(epoch, radiation=True, **others):
    return ForceModel(
        FIELD.mu_m3_s2, FIELD.radius_m, zonals=(), gravity=FIELD, epoch=epoch, radiation=radiation, **others
    )


def pair_of(elements):
    """Return the states (2, 6) of two craft, the second one ahead by 10 km or so."""
    ahead = replace(elements, true_anomaly_rad=elements.true_anomaly_rad + 1e4 / elements.semi_major_axis_m)
    return np.stack([state_from_elements(each, FIELD.mu_m3_s2) for each in (elements, ahead)])


def period_of(elements):
    return 2 * np.pi * np.sqrt(elements.semi_major_axis_m**3 / FIELD.mu_m3_s2)


def sun_at(times, epoch):
    """Return where the Sun is at many times within a day, to 0.2 km: on lines between some of them."""
    some = np.linspace(times[0], times[-1], 200)
    return np.stack([np.interp(times, some, each) for each in sun_position(some, epoch).T], axis=-1)


def in_sight(positions, sun):
    """Return -1 in the umbra, 0 in the penumbra and 1 in the light, from the angles of the two discs."""
    to_sun = sun - positions
    d, r = np.linalg.norm(to_sun, axis=-1), np.linalg.norm(positions, axis=-1)
    apart = np.arccos(np.clip(-np.sum(to_sun * positions, axis=-1) / d / r, -1, 1))
    earth, disc = np.arcsin(FIELD.radius_m / r), np.arcsin(SUN_RADIUS_M / d)
    return np.where(apart >= earth + disc, 1, np.where(apart <= earth - disc, -1, 0))


def flown_by_scipy(start, end_s, force, ballistic=0.0):
    """Return where SciPy's Dormand-Prince flies: steps as it likes, and in the penumbra 30 to each passage."""
    times = np.linspace(0.0, end_s, 20_000)
    dark = force_at(force.epoch, radiation=False)
    coarse = propagate(start[None], times, dark)[0, :, :3]
    sight = in_sight(coarse, sun_at(times, force.epoch))
    edges = np.flatnonzero((np.diff(sight) != 0) | (sight[1:] == 0))
    first = edges[np.append(True, np.diff(edges) > 10)]
    last = edges[np.append(np.diff(edges) > 10, True)]
    breaks = [0.0, *(t for i, j in zip(first, last, strict=True) for t in (times[max(i - 1, 0)], times[j + 2])), end_s]

    def slope(t, y):
        return np.concatenate([y[3:], force.acceleration(y, ballistic, t, AREA)])

    state = start
    for k, (begin, end) in enumerate(pairwise(breaks)):
        longest = (end - begin) / 30 if k % 2 else np.inf
        peer = solve_ivp(
            slope, (begin, end), state, method="DOP853", rtol=3e-14, atol=np.repeat([1e-7, 1e-10], 3), max_step=longest
        )
        state = peer.y[:, -1]
    assert len(first)
    return state


@pytest.mark.parametrize("name", SOME_ORBITS)
def test_scipy_flies_the_same_revolution(name):
    """Over the ellipses also truncation counts, as it does in the dark: 2e-5 m."""
    epoch, elements = ORBITS[name]
    start, end_s, force = pair_of(elements), period_of(elements), force_at(epoch)
    found = propagate(start, [end_s], force, radiation_m2_kg=AREA)[:, 0]
    error = (found - [flown_by_scipy(each, end_s, force) for each in start])[:, :3]
    assert np.linalg.norm(error, axis=1).max() < (3e-5 if elements.eccentricity > 0.1 else 1e-5)
    assert np.linalg.norm(error[1] - error[0]) < 1e-5


def test_scipy_flies_the_same_under_every_force():
    epoch, elements = ORBITS["low"]
    force = force_at(epoch, atmosphere=LayeredAtmosphere(), third_bodies=("sun", "moon"))
    start, end_s = pair_of(elements)[0], 6000.0
    found = propagate(start[None], [end_s], force, 0.01, radiation_m2_kg=AREA)[0, 0]
    assert np.linalg.norm((found - flown_by_scipy(start, end_s, force, 0.01))[:3]) < 5e-6


@pytest.mark.parametrize("name", SOME_ORBITS)
def test_a_day_is_as_exact_as_with_a_tenth_of_the_tolerance(name):
    """Steps in the penumbra then are half as long or shorter."""
    epoch, elements = ORBITS[name]
    start, end_s, force = pair_of(elements), max(5 * period_of(elements), 86_400.0), force_at(epoch)
    found, finer = (propagate(start, [end_s], force, rtol=rtol, radiation_m2_kg=AREA)[:, 0] for rtol in (1e-12, 1e-13))
    error = (found - finer)[:, :3]
    assert np.linalg.norm(error, axis=1).max() < (3e-4 if elements.eccentricity > 0.1 else 1e-4)
    assert np.linalg.norm(error[1] - error[0]) < 1e-4


def test_no_step_runs_into_the_penumbra():
    """From places all over orbits, low and high: what is foreseen against what is met."""
    mu, radius = FIELD.mu_m3_s2, FIELD.radius_m
    sun = sun_position(0.0, force_at(SUMMER).epoch)
    rng, met = np.random.default_rng(3), 0
    for r in (6.7e6, 7.5e6, 1.2e7, 4.2e7):
        step = 0.09 * np.sqrt(r**3 / mu)  # about that of the default tolerance
        e, *angles = rng.uniform(0, np.array([0.02, np.pi, 2 * np.pi, 2 * np.pi, 2 * np.pi])[:, None], (5, 1000))
        states, times = state_from_elements(Elements(r, e, *angles), mu), np.linspace(0.0, step, 50)
        sights = in_sight(propagate(states, times, ForceModel(mu, radius, ()))[..., :3], sun)
        for i, sight in enumerate(sights):
            longest = longest_by_shadow(states, i, sun[:, None], 0, mu, radius)
            if sight[0] == 0:
                assert longest < step / 10
            else:
                assert (sight[times <= longest] == sight[0]).all()
            if sight[0] != 0 and longest < 0.8 * step:
                met += 1
                assert (sight[times < longest / SHARE_OF_WAY * 1.1 + step / 25] != sight[0]).any()
    assert met > 40


def test_steps_are_short_in_the_penumbra_only():
    epoch, elements = ORBITS["low"]
    start, times = pair_of(elements)[:1], np.arange(0.0, period_of(elements), 0.25)
    counts = {}
    for area in (0.0, AREA):
        trajectory = DenseTrajectory(start, force_at(epoch), radiation_m2_kg=area)
        states = trajectory.at(times)[0]
        counts[area] = int(trajectory._batch._flights.steps[0])
    spans = trajectory._batch._flights.spans[0, : counts[AREA]]
    sight = in_sight(states[:, :3], sun_at(times, force_at(epoch).epoch))
    for begin, end, length in spans:
        within = sight[int(np.ceil(begin * 4)) : int(end * 4)]
        assert len(set(within)) < 2 or length < 1.1
    assert counts[0.0] + 20 < counts[AREA] < 2 * counts[0.0]


def test_bits_depend_neither_on_the_batch_nor_on_other_times():
    epoch, elements = ORBITS["low"]
    start = np.concatenate([pair_of(replace(elements, true_anomaly_rad=0.3 * k)) for k in range(20)])
    times, force = np.arange(0.0, 20_000.0, 1000.0), force_at(epoch)
    whole = propagate(start, times, force, radiation_m2_kg=AREA)
    for rows in ([0], [39, 7, 12]):
        assert np.array_equal(propagate(start[rows], times, force, radiation_m2_kg=AREA), whole[rows])
    assert np.array_equal(propagate(start[:2], times[:5], force, radiation_m2_kg=AREA), whole[:2, :5])
    chunks = DenseTrajectory(start[:2], force, radiation_m2_kg=AREA)
    assert np.array_equal(np.concatenate([chunks.at(times[:7]), chunks.at(times[7:])], axis=1), whole[:2])

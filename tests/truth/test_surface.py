"""Where orbits meet the surface: closed forms of Kepler motion, in air too thin to matter."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from relnav_sim.astro.orbits import elements_from_state
from relnav_sim.streams import RandomSource
from relnav_sim.truth import (
    ExponentialAtmosphere,
    ForceModel,
    TruthOptions,
    eci_from_rtn,
    propagate,
    rtn_from_eci,
    truth_trajectory,
)

MU, RADIUS = 3.986004418e14, 6378137.0
NO_AIR_TO_SPEAK_OF = ForceModel(MU, RADIUS, (), ExponentialAtmosphere(0.0, 1e-30, 8500.0))


def from_apogee(perigee, apogee):
    """Return the state at apogee (6,), and the time in s from there to the surface, by Kepler's equation."""
    a, e = (perigee + apogee) / 2, (apogee - perigee) / (apogee + perigee)
    toward, ahead = np.array([2.0, 1.0, -2.0]) / 3, np.array([1.0, 2.0, 2.0]) / 3
    state = np.concatenate([apogee * toward, np.sqrt(MU * (2 / apogee - 1 / a)) * ahead])
    eccentric = 2 * np.pi - np.arccos(np.clip((1 - RADIUS / a) / e, -1, 1))
    return state, (eccentric - e * np.sin(eccentric) - np.pi) * np.sqrt(a**3 / MU)


@pytest.mark.parametrize("apogee", [6.6e6, 42.164e6, 4e8])
@pytest.mark.parametrize("depth", [1.0, 1e3, 100e3])
def test_the_surface_is_met_at_keplers_time_however_few_times_are_asked_for(apogee, depth):
    state, meets = from_apogee(RADIUS - depth, apogee)
    # A grazing orbit meets the surface at a time that its perigee's rounding moves: dt = d(height) / vertical speed.
    tolerance = 1e-3 + 1e-4 / np.sqrt(2 * MU / RADIUS**2 * depth)
    for beyond in (2 * tolerance, 3 * meets):
        with pytest.warns(RuntimeWarning, match="orbit 0 ends at .* it goes below the surface"):
            before, after = propagate([state], [meets - tolerance, meets + beyond], NO_AIR_TO_SPEAK_OF)[0]
        assert np.isfinite(before).all() and np.isnan(after).all()


@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-8])
@pytest.mark.parametrize("apogee", [6.6e6, 42.164e6, 4e8])
def test_no_output_is_below_the_surface_whatever_rtol(apogee, rtol):
    """Long steps: what is asked for is their dense output, and that never is below the surface, or after it was."""
    states = np.array([from_apogee(RADIUS - depth, apogee)[0] for depth in np.geomspace(100, 2e6, 12)])
    period = 2 * np.pi * np.sqrt(((RADIUS + apogee) / 2) ** 3 / MU)
    with pytest.warns(RuntimeWarning, match="below the surface"):
        found = propagate(states, np.linspace(0, 1.2 * period, 20_001), NO_AIR_TO_SPEAK_OF, rtol=rtol)
    ended = np.isnan(found).any(axis=2)
    assert ended[4:, -1].all()  # the shallowest may pass above it within so large an rtol
    assert (np.diff(ended.astype(int), axis=1) >= 0).all()
    assert np.nanmin(np.linalg.norm(found[..., :3], axis=2)) > RADIUS * (1 - 1e-12)


@pytest.mark.parametrize("height", [1.0, 1e3])
def test_an_orbit_just_above_the_surface_goes_on(height):
    state, _ = from_apogee(RADIUS + height, 42.164e6)
    assert np.isfinite(propagate([state], [0.0, 40_000.0, 80_000.0], NO_AIR_TO_SPEAK_OF)).all()


@pytest.mark.parametrize("velocity", [(3000.0, 0, 0), (-3000.0, 0, 0), (0, 7905.0, 0), (9000.0, 0, 7000.0)])
@pytest.mark.parametrize("depth", [1.0, 8e3, 378e3])
def test_a_start_below_the_surface_is_no_orbit_whatever_its_direction(velocity, depth):
    with pytest.warns(RuntimeWarning, match="orbit 1 ends at t = 0 s: it starts below the surface"):
        found = propagate([[7e6, 0, 0, 0, 7500, 0], [RADIUS - depth, 0, 0, *velocity]], [0.0, 9.0], NO_AIR_TO_SPEAK_OF)
    assert np.isnan(found[1]).all() and np.isfinite(found[0]).all()


def test_without_an_atmosphere_there_is_no_surface():
    """As documented: a point mass. Half a revolution from apogee leads to perigee, below the ground."""
    state, _ = from_apogee(RADIUS - 100e3, 42.164e6)
    a = (RADIUS - 100e3 + 42.164e6) / 2
    found = propagate([state], [np.pi * np.sqrt(a**3 / MU)], ForceModel(MU, RADIUS, ()))[0, 0]
    assert np.linalg.norm(found[:3]) == pytest.approx(RADIUS - 100e3, abs=1e-3)


@pytest.mark.parametrize("drag", ["none", "exponential"])
def test_a_campaigns_run_ends_at_the_surface_between_its_epochs(drag):
    """A kick into a dip of 7 minutes between epochs an hour apart, in which both epochs' states are above ground."""
    truth = {
        "chief": {"orbit": {"a_km": 6478.137, "e": 0, "i_deg": 0}, "mass_kg": 1, "area_m2": 1},
        "deputy": {"relative": {"position_m": [0, 5000, 0], "velocity_m_s": [0, 0, 0]}, "mass_kg": 1, "area_m2": 1},
        "forces": {"zonals": 0, "drag": drag, "atmosphere": {"density_kg_m3": 1e-30}},
        "manoeuvres": {"down": {"craft": "deputy", "time_s": 1, "delta_v_m_s": [0, -31, 0]}},
    }
    options = TruthOptions.model_validate_json(json.dumps(truth), strict=True)
    path = truth_trajectory(options, 7200.0, RandomSource(1, (0, 1)))
    found = path.at([0.0, 1800.0, 3600.0, 7200.0])
    start = path.at([1.0]).deputy[0, 0]
    peer = solve_ivp(
        lambda t, y: np.concatenate([y[3:], -MU * y[:3] / np.linalg.norm(y[:3]) ** 3]),
        (1, 7200),
        start,
        method="DOP853",
        rtol=1e-12,
        atol=1e-6,
        events=lambda t, y: np.linalg.norm(y[:3]) - RADIUS,
        dense_output=True,
    )
    down, up = peer.t_events[0][:2]
    assert 1800 < down < up < 3600  # so no epoch is below the surface
    assert path.failures == {0: f"the deputy falls to the Earth at {down:g} s: it goes below the surface"}
    assert np.array_equal(np.isnan(found.relative).any(axis=2)[0], [False, False, True, True])


@pytest.mark.parametrize("along", [3.0, -1e-3, 1e-9, 0.0])
def test_parallel_position_and_velocity_span_no_frame_in_any_direction(along):
    """Rounding gives most of them an angular momentum that is not quite zero."""
    positions = np.random.default_rng(3).normal(size=(500, 3)) * np.geomspace(1e-3, 1e9, 500)[:, None]
    force = ForceModel(MU, RADIUS)
    for state in np.hstack([positions, along * positions]):
        for function, arguments in (
            (rtn_from_eci, (state, state)),
            (eci_from_rtn, (state, np.ones(6))),
            (elements_from_state, (state, MU)),
            (force.normal_acceleration, (state,)),
        ):
            with pytest.raises(ValueError, match="parallel"):
                function(*arguments)


def test_an_orbit_that_is_merely_steep_has_its_frame():
    state = np.array([0.6, 0.8, 0.0, 0.6 - 0.8e-6, 0.8 + 0.6e-6, 0.0])
    assert rtn_from_eci(state, [*(2 * state[:3]), *state[3:]])[:3] == pytest.approx([1, 0, 0], abs=1e-9)

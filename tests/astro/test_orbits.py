"""Orbital elements: round trips, a textbook case and the degenerate ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relnav_sim.astro.orbits import Elements, elements_from_state, state_from_elements

MU = 3.986004418e14
angles = st.floats(0, 6.28)


def same_state(elements, state):
    back = state_from_elements(elements, MU)
    scale = np.repeat([np.linalg.norm(state[:3]), np.linalg.norm(state[3:])], 3)
    assert np.abs((back - state) / scale).max() < 1e-12


def test_vallados_example():
    """Vallado, 4th ed., examples 2-5 and 2-6; the book gives six to eight digits."""
    state = np.array([6524.834, 6862.875, 6448.296, 4.901327, 5.533756, -1.976341]) * 1e3
    elements = elements_from_state(state, MU)
    degrees = [
        np.degrees(float(x))
        for x in (
            elements.inclination_rad,
            elements.raan_rad,
            elements.argument_of_perigee_rad,
            elements.true_anomaly_rad,
        )
    ]
    assert float(elements.semi_major_axis_m) == pytest.approx(36127.343e3, rel=1e-6)
    assert float(elements.eccentricity) == pytest.approx(0.832853, abs=1e-6)
    assert degrees == pytest.approx([87.870, 227.898, 53.38, 92.335], abs=5e-3)
    same_state(elements, state)


@settings(deadline=None, max_examples=200)
@given(st.floats(0, 0.99), st.floats(0, np.pi), angles, angles, angles)
def test_round_trip(e, i, raan, argp, nu):
    """Every inclination and eccentricity, also nearly circular and nearly equatorial."""
    state = state_from_elements(Elements(8e6, e, i, raan, argp, nu), MU)
    elements = elements_from_state(state, MU)
    same_state(elements, state)
    assert float(elements.semi_major_axis_m) == pytest.approx(8e6, rel=1e-11)
    assert float(elements.eccentricity) == pytest.approx(e, abs=1e-14)


@pytest.mark.parametrize("i", [0.0, 1e-9, 1.0, np.pi])
@pytest.mark.parametrize("e", [0.0, 1e-9, 0.3])
def test_degenerate_angles_have_fixed_values(e, i):
    state = state_from_elements(Elements(7e6, e, i, 0.5, 0.25, 1.0), MU)
    elements = elements_from_state(state, MU)
    same_state(elements, state)
    if i in (0.0, np.pi):
        assert elements.raan_rad == 0
    if e == 0:
        assert elements.argument_of_perigee_rad == 0
    whole = [float(x) for x in (elements.raan_rad, elements.argument_of_perigee_rad, elements.true_anomaly_rad)]
    assert all(0 <= angle < 2 * np.pi for angle in whole)
    # What does not degenerate: the angle from x (the node counts backwards seen from the other pole).
    sign = -1 if i > 2 else 1
    assert np.exp(1j * (sign * whole[0] + whole[1] + whole[2])) == pytest.approx(
        np.exp(1j * (sign * 0.5 + 1.25)), abs=1e-7
    )


def test_a_hyperbola():
    state = state_from_elements(Elements(-2e7, 1.5, 0.6, 1.0, 2.0, -1.2), MU)
    elements = elements_from_state(state, MU)
    assert float(elements.semi_major_axis_m) == pytest.approx(-2e7)
    assert float(elements.eccentricity) == pytest.approx(1.5)
    same_state(elements, state)


def test_arrays_of_elements():
    elements = Elements(np.array([7e6, 8e6]), 0.1, 0.5, 0.0, 0.0, np.array([[0.0], [1.0], [2.0]]))
    states = state_from_elements(elements, MU)
    assert states.shape == (3, 2, 6)
    assert np.array_equal(states[2, 1], state_from_elements(Elements(8e6, 0.1, 0.5, 0.0, 0.0, 2.0), MU))
    np.testing.assert_allclose(elements_from_state(states, MU).eccentricity, 0.1)


@pytest.mark.parametrize(
    ("elements", "sentence"),
    [
        (Elements(7e6, -0.1, 0, 0, 0, 0), "eccentricity must be a number of at least 0"),
        (Elements(7e6, 1.0, 0, 0, 0, 0), "e = 1 has none"),
        (Elements(7e6, 1.5, 0, 0, 0, 0), "negative for e > 1"),
        (Elements(-7e6, 1.5, 0, 0, 0, 3.0), "past the asymptote"),
    ],
)
def test_elements_of_no_orbit(elements, sentence):
    with pytest.raises(ValueError, match=sentence):
        state_from_elements(elements, MU)


def test_a_straight_fall_has_no_elements():
    with pytest.raises(ValueError, match="span no orbit plane"):
        elements_from_state([7e6, 0, 0, 1, 0, 0], MU)

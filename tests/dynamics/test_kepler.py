import numpy as np
import pytest

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.constants import MU_M3_S2, RADIUS_M
from relnav_sim.astro.kepler import arc, eccentric_anomaly, initial_state
from relnav_sim.astro.orbits import Elements, state_from_elements


@pytest.mark.parametrize("e", [0.0, 0.1, 0.7, 0.95])
def test_eccentric_anomaly_solves_keplers_equation(e):
    M = np.linspace(-10, 10, 2001)
    E, lead = eccentric_anomaly(M, e)
    assert np.abs(np.exp(1j * (E - e * np.sin(E))) - np.exp(1j * M)).max() < 1e-14
    assert np.abs(lead - e * np.sin(E)).max() < 1e-14


@pytest.mark.parametrize("e", [0.0, 0.1, 0.7])
def test_initial_state_is_that_of_the_elements(e):
    angles = np.radians([51.6, 20.0, 40.0, 30.0])
    orbit = ChiefOrbit(7e6 / (1 - e), e, *angles, MU_M3_S2, RADIUS_M, j2=0.0)
    elements = Elements(
        orbit.semi_major_axis_m,
        e,
        orbit.inclination_rad,
        orbit.raan_rad,
        orbit.argument_of_perigee_rad,
        orbit.true_anomaly_rad,
    )
    np.testing.assert_allclose(initial_state(orbit), state_from_elements(elements, MU_M3_S2), rtol=1e-14, atol=1e-8)


@pytest.mark.parametrize("e", [0.0, 0.1, 0.7])
def test_arc_follows_the_true_orbit(scene, e):
    s = scene(e)
    starts, offsets = np.array([0.0, 0.3, 0.8]) * s.period_s, np.array([1.0, 60.0, 3000.0])
    times = np.concatenate([[start, *(start + offsets)] for start in starts])
    order = np.argsort(times)
    states = np.empty((len(times), 6))
    states[order] = s.truth(np.zeros((1, 6)), times[order])[0][0]
    states = states.reshape(3, 4, 6)
    along = arc(s.orbit, starts, offsets)
    # The propagator's own error is 1e-6 m at most.
    np.testing.assert_allclose(along.radius_m, np.linalg.norm(states[:, 1:, :3], axis=-1), atol=1e-5)
    np.testing.assert_allclose(along.start_radius_m, np.linalg.norm(states[:, 0, :3], axis=-1), atol=1e-5)
    unit = states[..., :3] / np.linalg.norm(states[..., :3], axis=-1, keepdims=True)
    cosine = np.einsum("ki,ksi->ks", unit[:, 0], unit[:, 1:])
    np.testing.assert_allclose(np.cos(along.sweep_rad), cosine, atol=1e-11)
    assert (np.diff(along.sweep_rad) > 0).all()


def test_a_short_sweep_keeps_its_digits_after_a_thousand_turns(scene):
    orbit = scene(0.0).orbit
    sweep = arc(orbit, np.array([6e6]), np.array([0.1])).sweep_rad[0, 0]
    assert sweep == pytest.approx(orbit.mean_motion_rad_s * 0.1, rel=1e-12)

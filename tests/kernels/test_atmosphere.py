"""Layers of air, and drag in them against plain NumPy."""

import numpy as np
import pytest
from checks import check_runs_are_alone

from relnav_sim import kernels
from relnav_sim.astro.atmosphere import LayeredAtmosphere
from relnav_sim.kernels.atmosphere import Layers

RADIUS, TURN = 6378137.0, 7.292115e-5


def flights(count, seed=0):
    rng = np.random.default_rng(seed)
    position, velocity = rng.normal(size=(2, count, 3))
    position *= (RADIUS + rng.uniform(1e5, 1.2e6, (count, 1))) / np.linalg.norm(position, axis=1, keepdims=True)
    return np.hstack([position, 5e3 * velocity]), rng.uniform(0.0, 0.05, count)


def test_drag_is_the_plain_formula():
    states, ballistic = flights(300)
    r, v = states[:, :3], states[:, 3:]
    past_air = v - np.cross([0.0, 0.0, TURN], r)
    density = LayeredAtmosphere().density(np.linalg.norm(r, axis=1) - RADIUS)
    expected = -0.5 * (ballistic * density * np.linalg.norm(past_air, axis=1))[:, None] * past_air
    found = kernels.atmosphere.drag(LayeredAtmosphere().compiled, RADIUS, TURN, states, ballistic)
    # A nanometre of altitude, in its rounding, is 1e-13 of the density.
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_one_layer_is_the_exponential_atmosphere_to_the_bit():
    states, ballistic = flights(100)
    layers = Layers(np.array([4e5]), np.array([1e-12]), np.array([6e4]))
    found = kernels.atmosphere.drag(layers, RADIUS, TURN, states, ballistic)
    pull = kernels.forces.Forces(3.986004418e14, RADIUS, np.zeros(0), 0.0, 0.0, 1.0, TURN)
    both = pull._replace(density=1e-12, base=4e5, scale_height=6e4)
    alone = kernels.forces.acceleration(pull, states, ballistic)
    assert np.array_equal(alone + found, kernels.forces.acceleration(both, states, ballistic))


def test_the_layers_join():
    """The table has four digits of density and five of height: 1e-4, but for the lowest layer's 1.4e-3."""
    air = LayeredAtmosphere()
    edges = air.compiled.bases[1:]
    jump = air.density(edges) / air.density(np.nextafter(edges, 0.0)) - 1
    assert np.abs(jump[0]) < 1.4e-3
    assert np.abs(jump[1:]).max() < 1.1e-4
    assert (np.diff(air.density(np.linspace(-1e3, 2e6, 5000))) < 0).all()


def test_known_densities():
    """Rows of the table, and its first and last layer beyond it."""
    air = LayeredAtmosphere()
    assert air.density([0.0, 200e3, 500e3, 1000e3]).tolist() == [1.225, 2.789e-10, 6.967e-13, 3.019e-15]
    assert air.density(-7249.0) == pytest.approx(1.225 * np.e)
    assert air.density(1268e3) == pytest.approx(3.019e-15 / np.e)
    assert LayeredAtmosphere(2.0).density(450e3) == pytest.approx(2 * 1.585e-12)
    with pytest.raises(ValueError, match="density_factor is 0"):
        LayeredAtmosphere(0.0)


def test_lanes_are_alone():
    layers = LayeredAtmosphere().compiled
    check_runs_are_alone(lambda *by_run: kernels.atmosphere.drag(layers, RADIUS, TURN, *by_run), list(flights(70)))

"""Fields of any degree and order against another library, a plain potential, and the zonal kernel."""

import re

import numpy as np
import pytest

from relnav_sim import GravityField, kernels
from relnav_sim.astro.harmonic_series import derivatives, packed

# By brahe 1.8.1, `accel_gravity_spherical_harmonics` with its GGM05S: degree and order, position in m, m/s^2.
BRAHE = [
    (60, 60, [0, 0, 6678e3], [0.00011218832629767261, -2.8503027514159995e-05, -8.911786449692553]),
    (60, 60, [0, 0, -8378e3], [4.846732402226124e-05, 1.318510803312516e-05, 5.668100323068097]),
    (60, 60, [6900e3, 0, 0], [-8.38389655950252, -2.312076087728404e-05, 3.003666050438642e-05]),
    (60, 60, [1e-3, 2e-3, 7000e3], [8.240062712499153e-05, -1.8148045327009205e-05, -8.112899938252646]),
    (60, 60, [1266226, -1330425, 6449681], [-1.6645312095013012, 1.749224598240489, -8.504359847824558]),
    (60, 60, [-2983284, -5364393, -2642194], [3.9859078178859293, 7.167197135201609, 3.540657546072912]),
    (20, 10, [0, 0, 6678e3], [0.00010924434649278219, -3.14372486838415e-05, -8.911809722956756]),
    (20, 10, [6900e3, 0, 0], [-8.383907752849444, -2.8954366021274512e-05, 3.9104065569455326e-05]),
    (20, 10, [-6128306, -576690, -3283967], [7.192571756070156, 0.6769381732288297, 3.864844025692344]),
    (20, 10, [-655503, 6968708, -3392368], [0.555241903043329, -5.902923489319512, 2.8797858523572324]),
]


def points(count, seed=0, nearest=6.678e6, farthest=8.378e6):
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    r = rng.uniform(nearest, farthest, (count, 1)) * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    r[:2] = [[0.0, 0.0, nearest], [0.0, 0.0, -farthest]]
    return r


def potential(field, p):
    """Return the potential at p (..., 3): normalised Legendre functions by degree, with 64 bits of mantissa."""
    p = p.astype(np.longdouble)
    r = np.sqrt(np.square(p).sum(axis=-1))
    sine, cosine, longitude = p[..., 2] / r, np.hypot(p[..., 0], p[..., 1]) / r, np.arctan2(p[..., 1], p[..., 0])
    total, sectoral = np.zeros_like(r), np.ones_like(r)
    for m in range(field.order + 1):
        if m:
            sectoral = sectoral * cosine * np.sqrt(np.longdouble(3 if m == 1 else (2 * m + 1) / np.longdouble(2 * m)))
        before, P = np.zeros_like(r), sectoral
        for n in range(m, field.degree + 1):
            if n > m:
                a = np.sqrt(np.longdouble((2 * n + 1) * (2 * n - 1)) / ((n - m) * (n + m)))
                below = np.sqrt(np.longdouble((n - 1 - m) * (n - 1 + m)) / ((2 * n - 1) * (2 * n - 3)))
                before, P = P, a * (sine * P - below * before)
            wave = field.C[n, m] * np.cos(m * longitude) + field.S[n, m] * np.sin(m * longitude)
            total += (field.radius_m / r) ** n * P * wave
    return field.mu_m3_s2 / r * total


def slope(field, p):
    """Return the gradient of the potential by differences of fourth order."""
    h = np.longdouble(200.0)
    aside = h * np.array([1, -1, 2, -2])[:, None, None, None] * np.eye(3)[:, None]
    near, before, far, behind = potential(field, p + aside)
    return ((8 * (near - before)) - (far - behind)).T / (12 * h)


def rough(degree):
    """Return a field whose coefficients fall as the Earth's (Kaula's rule), to a degree of which there are no data."""
    n = np.maximum(np.arange(degree + 1.0), 1)[:, None]
    C, S = np.tril(np.random.default_rng(1).normal(size=(2, degree + 1, degree + 1)) * 1e-5 / n**2)
    C[0, 0], S[:, 0] = 1.0, 0.0
    return GravityField(3.986e14, 6.378e6, C, S, degree)


@pytest.mark.parametrize("degree, order, position, expected", BRAHE)
def test_brahe_finds_the_same(degree, order, position, expected):
    found = GravityField.load("ggm05s", degree, order).acceleration(position)
    assert np.linalg.norm(found - expected) < 1e-14 * np.linalg.norm(expected)


def test_brahe_finds_the_same_at_a_thousand_points():
    brahe = pytest.importorskip("brahe")
    model = brahe.GravityModel.from_model_type(brahe.GravityModelType.GGM05S)
    r = points(1000)
    expected = np.array([brahe.accel_gravity_spherical_harmonics(p, np.eye(3), model, 60, 60) for p in r])
    found = GravityField.load("ggm05s", 60).acceleration(r)
    assert (np.linalg.norm(found - expected, axis=1) < 1e-14 * np.linalg.norm(expected, axis=1)).all()


@pytest.mark.parametrize("field", [GravityField.load("ggm05s", 60, 60), rough(121)], ids=["ggm05s", "degree 121"])
def test_it_is_the_slope_of_the_potential(field):
    """The differences round: 6e7 m^2/s^2 with 64 bits over 200 m, and the recursion adds up some tens of roundings."""
    r = points(6, nearest=6.4e6)[2:]
    np.testing.assert_allclose(field.acceleration(r), slope(field, r).astype(float), rtol=0, atol=3e-12)


def test_high_degrees_neither_overflow_nor_lose_digits_at_the_poles():
    field = rough(360)
    r = np.array([[0.0, 0.0, 6.4e6], [1e-9, 0.0, -6.4e6], [1.0, 0.0, 6.4e6]])
    found = field.acceleration(r)
    assert np.isfinite(found).all()
    assert np.abs(found[0] - found[2]).max() < 1e-5  # a metre away: the gradient is 3e-6 / s^2


def test_orders_above_the_one_asked_for_are_left_out():
    field = GravityField.load("ggm05s", 12, 5)
    assert (field.degree, field.order, field.name) == (12, 5, "GGM05S")
    assert not field.C[:, 6:].any() and not field.S[:, 6:].any() and field.C[12, 5]


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4, 9])
def test_zonal_fields_are_the_zonal_kernels(degree):
    field, r = GravityField.load("ggm05s", degree, 0), points(40)
    n = np.arange(2, degree + 1)
    zonals = -np.sqrt(2 * n + 1.0) * field.C[2:, 0]
    expected = kernels.gravity.acceleration(r, field.mu_m3_s2, field.radius_m, zonals)
    np.testing.assert_allclose(field.acceleration(r), expected, rtol=1e-14, atol=1e-14)


def test_second_derivatives_are_slopes_of_the_acceleration():
    field, r, h = GravityField.load("ggm05s", 20, 12), points(8), 5.0
    first = derivatives(field.C - 1j * field.S)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = (
        kernels.spherical_harmonics.at_points(
            packed(derivatives(c), 14, field.mu_m3_s2 / field.radius_m**3, field.radius_m), r
        ).T
        for c in first
    )
    G = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    found = [(field.acceleration(r + h * e) - field.acceleration(r - h * e)) / (2 * h) for e in np.eye(3)]
    # Rounding of 9 m/s^2 over 10 m, and h^2 / 6 of a derivative that is some 24 mu / r^5.
    np.testing.assert_allclose(G, np.stack(found, axis=-1), rtol=0, atol=1e-15)
    assert np.abs(xx + yy + zz).max() < 1e-14 * np.abs(zz).max()  # Laplace


def test_bits_do_not_depend_on_the_block_and_nan_stays_in_its_row():
    field, r = GravityField.load("ggm05s", 15, 15), points(200)
    whole = field.acceleration(r)
    for rows in (slice(0, 1), slice(31, 34), slice(100, 141)):
        assert np.array_equal(field.acceleration(r[rows]), whole[rows])
    spoilt = r.copy()
    spoilt[17] = np.nan
    found, others = field.acceleration(spoilt), np.arange(200) != 17
    assert np.isnan(found[17]).all() and np.array_equal(found[others], whole[others])


def test_any_shape_of_points():
    field, r = GravityField.load("ggm05s", 3), points(6)
    assert np.array_equal(field.acceleration(r.reshape(2, 3, 3)), field.acceleration(r).reshape(2, 3, 3))
    assert field.acceleration(np.zeros((0, 3))).shape == (0, 3)


@pytest.mark.parametrize(
    "changed, message",
    [
        ({"mu_m3_s2": -1.0}, "mu_m3_s2 is -1.0; it must be a positive number"),
        ({"C": np.eye(2)}, "C and S must both be"),
        ({"S": np.full((3, 3), np.nan)}, "S must hold finite numbers"),
        ({"order": 3}, "order is 3; it must be between 0 and the degree, 2"),
    ],
)
def test_what_is_no_field_is_refused(changed, message):
    good = {"mu_m3_s2": 1.0, "radius_m": 1.0, "C": np.eye(3), "S": np.zeros((3, 3)), "order": 2}
    GravityField(**good)
    with pytest.raises(ValueError, match=re.escape(message)):
        GravityField(**(good | changed))


def test_points_of_another_shape_are_refused():
    with pytest.raises(ValueError, match="positions has shape"):
        GravityField.load("ggm05s", 2).acceleration([1.0, 2.0])

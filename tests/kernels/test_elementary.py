"""The elementary functions within one unit in the last place of mpmath's."""

import llvmlite.binding
import mpmath
import numba
import numpy as np
import pytest

from relnav_sim.kernels import elementary
from relnav_sim.kernels.compiler import part

PROCESSOR = {feature for feature, has in llvmlite.binding.get_host_cpu_features().items() if has}


NAMES = ("exp", "exp_of_loss", "log", "sin", "cos", "atan2", "atan_narrow", "hypot_narrow")
OF_TWO = ("atan2", "hypot_narrow")


def over_lanes(name):
    function = part(getattr(elementary, name))

    @numba.njit(error_model="numpy")
    def one(x, out):
        for b in range(len(out)):
            out[b] = function(x[b])

    @numba.njit(error_model="numpy")
    def two(y, x, out):
        for b in range(len(out)):
            out[b] = function(y[b], x[b])

    return two if name in OF_TWO else one


@pytest.fixture(scope="module")
def lanes():
    return {name: over_lanes(name) for name in NAMES}


def applied(function, *arguments):
    out = np.empty(len(arguments[0]))
    function(*(np.array(argument, dtype=float) for argument in arguments), out)
    return out


def worst_error(found, exact, *arguments):
    """Return the largest error in units in the last place."""
    with mpmath.workprec(160):
        worst = 0.0
        for value, *numbers in zip(found.tolist(), *(np.asarray(a).tolist() for a in arguments), strict=True):
            true = exact(*map(mpmath.mpf, numbers))
            worst = max(worst, float(abs(mpmath.mpf(value) - true) / mpmath.mpf(float(np.spacing(abs(float(true)))))))
    return worst


def test_sine_and_cosine(lanes):
    """All quadrants, and next to their edges, where one of both is small; thousands of turns."""
    rng = np.random.default_rng(2)
    edges = np.arange(-40, 41) * (np.pi / 4)
    x = [rng.uniform(-1, 1, 3000), rng.uniform(-50, 50, 3000), rng.uniform(-1e5, 1e5, 3000), edges]
    x = np.concatenate(
        [*x, np.nextafter(edges, 9e9), 10 ** rng.uniform(-9, 0, 300), np.arange(1, 60000, 97) * np.pi / 2]
    )
    for name, exact in (("sin", mpmath.sin), ("cos", mpmath.cos)):
        found = applied(lanes[name], x)
        at_zero = np.abs(found) < 1e-10
        assert at_zero.sum() > 100
        assert worst_error(found[~at_zero], exact, x[~at_zero]) <= 1
        with mpmath.workprec(160):
            assert max(abs(value - exact(at)) for value, at in zip(found[at_zero], x[at_zero], strict=True)) < 1e-27
    for function in (lanes["sin"], lanes["cos"]):
        assert np.isnan(applied(function, [np.nan, np.inf, -np.inf])).all()


def test_exponential(lanes):
    rng = np.random.default_rng(1)
    x = [rng.uniform(-1, 1, 4000), rng.uniform(-745.1, 709.78, 4000), rng.uniform(-745.1, -708, 2000)]
    x = np.concatenate([*x, 10 ** rng.uniform(-300, 0, 500), np.arange(-700, 700) * np.log(2) / 2])
    assert worst_error(applied(lanes["exp"], x), mpmath.exp, x) <= 1
    special = [0.0, -0.0, np.inf, -np.inf, np.nan, 709.79, -745.2, 1e300, -1e300, 5e-324]
    with np.errstate(over="ignore"):
        np.testing.assert_array_equal(applied(lanes["exp"], special), np.exp(special))


def test_exponential_of_a_loss(lanes):
    rng = np.random.default_rng(6)
    x = -np.concatenate([rng.uniform(0, 1, 2000), rng.uniform(0, 708, 3000), 10 ** rng.uniform(-300, 0, 500), [0.0]])
    assert worst_error(applied(lanes["exp_of_loss"], x), mpmath.exp, x) <= 1
    least, none = applied(lanes["exp_of_loss"], [-708.0, np.nan])
    assert np.isnan(none)
    np.testing.assert_array_equal(applied(lanes["exp_of_loss"], [-709.0, -1e9, -np.inf]), least)


def test_logarithm(lanes):
    rng = np.random.default_rng(2)
    near = 10 ** rng.uniform(-15, -1, 2000)
    x = np.concatenate([rng.uniform(0.4, 2.1, 4000), 10 ** rng.uniform(-323, 308, 4000), 1 + near, 1 - near])
    assert worst_error(applied(lanes["log"], x), mpmath.log, x) <= 1
    special = [1.0, 0.0, -0.0, np.inf, -np.inf, np.nan, -1.0, -5e-324]
    with np.errstate(divide="ignore", invalid="ignore"):
        np.testing.assert_array_equal(applied(lanes["log"], special), np.log(special))


def test_angle(lanes):
    rng = np.random.default_rng(3)
    size, around = 10 ** rng.uniform(-323, 308, (2, 4000)), rng.choice([-1.0, 1.0], (2, 4000))
    wide = size * around
    tiny = np.array([1e-321, 1e-318])[:, None] * rng.uniform(1, 1e3, (2, 1000))
    huge = rng.uniform(0.1, 1.7, (2, 1000)) * 1e308
    octant = np.array([np.sin(0.3925 + rng.uniform(-1e-3, 1e-3, 2000)), np.ones(2000)])  # where the reduction changes
    y, x = np.concatenate([rng.standard_normal((2, 6000)), wide, tiny, huge, octant], axis=1)
    assert worst_error(applied(lanes["atan2"], y, x), mpmath.atan2, y, x) <= 1


def test_special_angles_are_those_of_c99(lanes):
    numbers = [0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 5e-324, -5e-324, 1.7e308, -1.7e308]
    y, x = (axis.ravel() for axis in np.meshgrid(numbers, numbers))
    found, expected = applied(lanes["atan2"], y, x), np.arctan2(y, x)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    known = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(found[known]), np.signbit(expected[known]))
    np.testing.assert_allclose(found[known], expected[known], rtol=2e-16)
    quarters = applied(lanes["atan2"], [0.0, 1.0, 0.0, -1.0, -0.0], [1.0, 0.0, -1.0, 0.0, -1.0])
    np.testing.assert_array_equal(quarters, [0.0, np.pi / 2, np.pi, -np.pi / 2, -np.pi])


def test_narrow_angles(lanes):
    """Angle and length from a small tangent."""
    rng = np.random.default_rng(4)
    t = elementary.NARROW * np.concatenate([rng.uniform(-1, 1, 4000), 10 ** rng.uniform(-300, 0, 500), [-1, 0, 1]])
    x = 10 ** rng.uniform(-6, 9, len(t))
    assert worst_error(applied(lanes["atan_narrow"], t), mpmath.atan, t) <= 1
    assert worst_error(applied(lanes["hypot_narrow"], x, t), lambda x, t: mpmath.hypot(x, x * t), x, t) <= 1


@pytest.mark.parametrize("name", NAMES)
def test_a_lane_does_not_depend_on_its_neighbours(name, lanes):
    rng = np.random.default_rng(5)
    arguments = rng.standard_normal((2 if name in OF_TWO else 1, 67))
    whole = applied(lanes[name], *arguments)
    alone = [applied(lanes[name], *arguments[:, b : b + 1])[0] for b in range(67)]
    np.testing.assert_array_equal(whole, alone)


@pytest.mark.skipif(not ({"fma", "neon"} & PROCESSOR), reason="the processor has no fused multiply-add")
def test_loops_are_vectorised(lanes):
    for name in NAMES:
        applied(lanes[name], *[[1.0]] * (2 if name in OF_TWO else 1))
        code = "".join(lanes[name].inspect_llvm().values())
        assert "x double> @llvm.fma.v" in code, name

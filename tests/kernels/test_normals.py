"""Normal numbers by Box and Muller, against mpmath."""

import mpmath
import numpy as np
import pytest

from relnav_sim import kernels


def test_normals_are_those_of_box_and_muller():
    uniform = np.random.default_rng(0).random((1, 400))
    uniform[0, :3] = 0.0, 1 - 2.0**-53, 2.0**-53
    uniform[0, 203:209] = 0.0, 0.125, 0.25, 0.5, 0.875, 1 - 2.0**-53
    found = uniform.copy()
    kernels.normals.box_muller(found)
    with mpmath.workdps(40):
        for i in range(200):
            u, v = mpmath.mpf(uniform[0, i]), mpmath.mpf(uniform[0, 200 + i])
            radius = mpmath.sqrt(-2 * mpmath.log(1 - u))
            x, y = radius * mpmath.cospi(2 * v - 1), radius * mpmath.sinpi(2 * v - 1)
            assert abs(found[0, i] - x) <= 4e-16 * abs(x)
            assert abs(found[0, 200 + i] - y) <= 4e-16 * abs(y)


@pytest.mark.parametrize("pairs", [1, 7, 32, 1001])
def test_bits_of_a_normal_do_not_depend_on_its_place(pairs):
    uniform = np.random.default_rng(1).random((3, 2 * pairs))
    whole = uniform.copy()
    kernels.normals.box_muller(whole)
    for i in range(pairs):
        alone = uniform[1:2, [i, pairs + i]]
        kernels.normals.box_muller(alone)
        assert np.array_equal(alone[0], whole[1, [i, pairs + i]])

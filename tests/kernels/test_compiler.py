"""What numba is told of the parts of kernels."""

import sys
import threading

import numba
import numpy as np
import pytest
from plain_orbits import INTEGRATION, PARTS, STEP, chiefs, field_of

from relnav_sim import kernels
from relnav_sim.kernels import collocation, compiler, dop853, field_paths, lanes, relative_gravity, scores
from relnav_sim.kernels.compiler import owns_arrays


@pytest.mark.parametrize(
    "part, owns",
    [
        (lanes.factor, False),
        (dop853.evaluate, False),
        (dop853.error_estimate, True),  # makes some
        (scores.places, True),  # returns one
        (relative_gravity.during, True),  # returns what it was given
        (field_paths.field_during, True),  # returns some in a tuple
        (collocation.orbit_path, False),
    ],
)
def test_parts_own_the_arrays_that_they_make_or_hand_on(part, owns):
    assert owns_arrays(part) is owns


def test_kernels_keep_no_reference_to_what_they_are_given():
    """Nor give back one too many, where a part hands on the array that it was given."""
    (state,), field = chiefs(1)[0], field_of(())
    before = sys.getrefcount(state), sys.getrefcount(field)
    for _ in range(3):
        kernels.chief_orbit.walk(state, 4, *INTEGRATION, PARTS, STEP / PARTS, field)
    assert (sys.getrefcount(state), sys.getrefcount(field)) == before
    assert np.isfinite(field).all()


def test_the_width_of_registers_does_not_show():
    """Numbers of a wide kernel are those of the same loops compiled as numba does by itself."""
    rng = np.random.default_rng(3)
    numbers = rng.random((3, 2 * 77))
    wide, narrow = numbers.copy(), numbers.copy()
    kernels.normals.box_muller(wide)
    assert not np.array_equal(wide, numbers)
    numba.njit(error_model="numpy")(kernels.normals.box_muller.py_func)(narrow)
    np.testing.assert_array_equal(wide, narrow)


def test_threads_that_compile_at_once_leave_numba_as_it_was():
    """One that ends while another is at work must not put back what the other has replaced."""
    function = numba.core.types.functions.BaseFunction.get_call_type
    inside, may_end = threading.Event(), threading.Event()

    def compiling():
        with compiler._no_type_asked_twice():
            inside.set()
            may_end.wait(5)

    threads = [threading.Thread(target=compiling) for _ in range(2)]
    for thread in threads:
        thread.start()
    assert inside.wait(5)
    may_end.set()
    for thread in threads:
        thread.join()
    assert numba.core.types.functions.BaseFunction.get_call_type is function

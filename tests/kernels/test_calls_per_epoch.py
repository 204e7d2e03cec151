"""How many functions are called in an epoch of one run, where calls are nearly all of the cost; nothing is timed.

Counted are Python's own functions and the C functions that `sys.setprofile` tells of: methods and functions of NumPy
and of the interpreter. It does not tell of operators on arrays, ufuncs and kernels.
"""

import sys
from collections import Counter

import numpy as np
import pytest

from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.measurements.converted_radar import ConvertedRadar
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar

# Python functions and C functions an epoch, at most. Epochs that are taken in one go call none; with dynamics that are
# not known ahead `kf` and `ekf` go from epoch to epoch, as the others do, and these call two functions themselves.
BUDGET = {
    "kf": (0, 0),
    "kf, epoch by epoch": (42, 26),
    "ekf": (0, 0),
    "ekf, epoch by epoch": (38, 29),
    "ukf": (0, 0),
    "ukf, epoch by epoch": (49, 49),
}
SIGMAS = np.array([4.0, 1.2e-3, 1.2e-3])


class NotAhead(LinearDynamics):
    """Dynamics that may be others than their base says."""

    def process_noise(self, states, step):
        return super().process_noise(states, step)


def calls(filter, z, mean0, cov0):
    """Return how often functions were called, by the profiler's event."""
    counted = Counter()

    def count(frame, event, argument):
        counted[event] += 1

    sys.setprofile(count)
    try:
        run_filter(filter, z, mean0, cov0)
    finally:
        sys.setprofile(None)
    return counted


@pytest.mark.parametrize("name", BUDGET)
def test_an_epoch_of_one_run_calls_no_more_than(name):
    kind, _, steps = name.partition(", ")
    noise = SightNoise(np.ones(1), SIGMAS[None], SIGMAS, np.zeros((3, 3)), assumed="nominal")
    measurement = (ConvertedRadar if kind == "kf" else SphericalRadar)(np.eye(3), noise)
    filter = create_filter(
        kind, (NotAhead if steps else LinearDynamics)(cw_transition(1.1e-3, 2.0), 1e-6 * np.eye(6)), measurement
    )
    mean0, cov0 = np.array([0.0, 5000.0, 200.0, 0.0, 0.0, 0.0]), np.diag([10.0] * 3 + [0.1] * 3) ** 2
    z = np.broadcast_to(measurement.predict(mean0[None], 0), (40, 3)) + SIGMAS * np.random.default_rng(0).normal(
        size=(40, 3)
    )
    run_filter(filter, z[None], mean0, cov0)  # compiles, and imports what is imported late
    few, many = (calls(filter, z[None, :steps], mean0, cov0) for steps in (10, 40))
    found = tuple((many[event] - few[event]) / 30 for event in ("call", "c_call"))
    assert all(have <= most for have, most in zip(found, BUDGET[name], strict=True)), found

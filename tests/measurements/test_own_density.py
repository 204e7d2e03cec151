"""A user's own density stays itself under a latency, and is refused where only the noise can be changed."""

import numpy as np
import pytest

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.measurements.augmented import AdditiveBias, AugmentedMeasurement
from relnav_sim.measurements.delayed import Delayed
from relnav_sim.measurements.frame_error import FrameError


class Laplace(LinearMeasurement):
    """A measurement of x[0] whose noise is Laplace's."""

    def log_likelihood(self, z, states, epoch):
        spread = (slice(None), *[None] * (states.ndim - 2))
        return -np.abs(z[spread] - self.predict(states, epoch))[..., 0] - np.log(2)


def laplace(states=6):
    return Laplace(np.eye(1, states), np.eye(1))


def test_a_latency_takes_it_at_the_state_that_long_ago():
    states = np.arange(12.0).reshape(2, 6)
    z = np.array([[1.0], [2.0]])
    expected = -np.abs(z[:, 0] - (states[:, 0] - 3.0 * states[:, 3])) - np.log(2)
    np.testing.assert_allclose(Delayed(laplace(), 3.0).log_likelihood(z, states, 0), expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("measurement", "words"),
    [
        (FrameError(laplace(), 1e-9 * np.eye(6)), "the error of its host's frame"),
        (AugmentedMeasurement(laplace(), 6, AdditiveBias([[1.0]])), "what augmented states do to a measurement"),
    ],
)
def test_who_asks_for_what_is_not_known_is_told(measurement, words):
    n = 6 if isinstance(measurement, FrameError) else 7
    motion = LinearDynamics(np.eye(n), np.eye(n))
    given = np.zeros((1, 3, 1)), np.zeros(n), np.eye(n)
    run_filter(create_filter("ekf", motion, measurement), *given)  # by the noise alone
    with pytest.raises(ValueError, match=f"Laplace has a log_likelihood of its own, to which {words} can't be applied"):
        run_filter(create_filter("particle", motion, measurement, particles=20), *given)

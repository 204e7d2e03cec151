"""What is said of measurements that cannot tell the state."""

import numpy as np
import pytest

from relnav_sim.results.observability import Observability, not_observable

STATES = ("x", "y", "z", "vx", "vy", "vz")


@pytest.mark.parametrize(("left", "words"), [(0.934, "leave 93 % of"), (1.0, "leave 100 % of")])
def test_the_sentence_says_how_much_of_the_sigma_is_left_at_the_end(left: float, words: str) -> None:
    ratio = np.array([1.0, 0.99, left])
    found = Observability(("lidar",), ratio, STATES, np.eye(6)[0], np.full(6, left), 1, "radial position")
    (said,) = not_observable({"ekf": found})
    assert said.startswith("Filter ekf (sensor lidar): not observable: radial position. ")
    assert f"{words} the start's sigma there" in said

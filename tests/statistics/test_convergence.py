"""Convergence times against a search that follows the definition word for word."""

import numpy as np
import pytest
from taking_turns import taking_turns

from relnav_sim.results import layout
from relnav_sim.statistics.convergence import Convergence


def _search(r: np.ndarray, threshold: float, hold: int) -> float:
    for start in range(len(r) - hold):
        if (r[start : start + hold + 1] < threshold).all():
            return start + 1.0
    return np.nan


@pytest.mark.parametrize(
    ("hold", "chunk"), taking_turns([(hold,) for hold in (0, 1, 5, 40, 199, 200, 500)], [1, 7, 64, 200])
)
def test_against_a_search(hold: int, chunk: int) -> None:
    rng = np.random.default_rng(hold)
    r = np.exp(rng.standard_normal((30, 200)) * 0.5 + np.linspace(4, rng.uniform(-3, 4, 30), 200).T)
    r[3, 120:] = np.inf
    r[4] = 0.5
    r[5] = 0.0
    streaming = Convergence(30, 2.0, hold)
    for start in range(0, 200, chunk):
        streaming.add(r[:, start : start + chunk])
    np.testing.assert_array_equal(streaming.below_threshold(), [_search(row, 2.0, hold) for row in r])
    thresholds = rng.uniform(0.5, 50, 30)
    found = streaming.below(thresholds)
    at_threshold = np.array([_search(row, t, hold) for row, t in zip(r, thresholds, strict=True)])
    above_it = np.array([_search(row, t * 33 / 32, hold) for row, t in zip(r, thresholds, strict=True)])
    late, early = np.nan_to_num(at_threshold, nan=1e9), np.nan_to_num(above_it, nan=1e9)
    assert ((early <= np.nan_to_num(found, nan=1e9)) & (np.nan_to_num(found, nan=1e9) <= late)).all()
    for edge in layout.THRESHOLDS_M:  # every one the edge of a bin: no rounding
        np.testing.assert_array_equal(streaming.below_edge(edge), [_search(row, edge, hold) for row in r])
    last = [np.flatnonzero(row >= 2.0)[-1] if (row >= 2.0).any() else -1 for row in r]
    wanted = [np.nan if k == 199 else k + 2.0 for k in last]
    np.testing.assert_array_equal(streaming.below_to_the_end(), wanted)


def test_no_threshold_gives_no_time() -> None:
    streaming = Convergence(2, 1.0, 1)
    streaming.add(np.zeros((2, 5)))
    np.testing.assert_array_equal(streaming.below(np.array([np.nan, 3.0])), [np.nan, 1.0])

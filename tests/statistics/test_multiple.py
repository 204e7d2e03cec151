"""Holm's adjustment against the published example and against its promise."""

import numpy as np
import pytest

from relnav_sim.statistics.multiple import holm


def test_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx((0.03, 0.06, 0.06, 0.02))
    assert holm([0.9, 0.8]) == (1.0, 1.0)
    assert holm([]) == ()


def test_the_family_is_wrong_in_5_percent_whatever_hangs_together() -> None:
    """All pairs of four equal filters on common random numbers: any verdict at all is wrong."""
    from scipy.stats import ttest_rel

    rng = np.random.default_rng(3)
    figures = np.array([rng.normal(size=(20, 1)) + 0.1 * rng.normal(size=(20, 4)) for _ in range(300)])
    p = [ttest_rel(figures[..., i], figures[..., j], axis=1).pvalue for i in range(4) for j in range(i)]
    wrong = sum(min(holm(family)) < 0.05 for family in np.transpose(p))
    assert wrong / 300 < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 300)

from typing import Any

import numpy as np
import pytest

from replication.inverse.pairs import claims_together, pair_p_values, pulling


def test_numbers_that_never_go_together_are_found_and_others_are_not(linear: Any) -> None:
    rng = np.random.default_rng(6)
    seen = rng.standard_normal((4000, 6))
    seen[:, 3] = seen[:, 0] + 0.1 * rng.standard_normal(4000)
    paper = np.array([1.0, 0.3, 4.5, -1.0, 0.1, 0.2])  # the first and the fourth: 20 sigma; the third alone is too far
    p, off = pair_p_values(seen, paper)
    assert p[0, 3] == p[3, 0] == pytest.approx(2 / 201)
    assert off[0, 3] == pytest.approx(20, rel=0.3)
    assert (p[2] == 1).all()
    assert p[1, 4] > 0.05
    found = pulling(linear.numbers, seen, paper, rng.standard_normal((3, 6)))
    first = found["pairs"][0]
    assert (first["first"], first["second"]) == (linear.numbers[0].name, linear.numbers[3].name)


def test_the_least_compatible_claims_come_first() -> None:
    a, b = np.arange(100) < 50, np.arange(100) >= 45
    found = claims_together({"A": a, "B": b, "C": a, "never": np.zeros(100, dtype=bool)})
    assert [pair["claims"] for pair in found] == [["A", "B"], ["B", "C"], ["A", "C"]]
    assert found[0]["share"] == pytest.approx(0.1)
    assert found[2]["share"] == 1

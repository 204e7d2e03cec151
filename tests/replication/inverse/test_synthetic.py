from typing import Any

import numpy as np

from replication.inverse.bank import Bank, settings
from replication.inverse.page_evidence import searched_table
from replication.inverse.synthetic import EACH, FACTOR, papers_of, searched


def _bank(linear: Any) -> Bank:
    u = settings(linear, 2, 0, 300)
    return Bank(2, u, linear.flown(u, [[2, n, 1] for n in range(300)], 1)[:, 0], np.empty((300, 0)), 0.0)


def test_the_search_reaches_papers_that_were_flown_and_not_the_forged_one(linear: Any) -> None:
    linear.printed = np.array([3.5, 3.5, 3.5, 3.7, 3.7, 3.5])  # twice the first column is more than any setting gives
    found = searched(linear, _bank(linear), 2, lambda line: None)
    assert [each["near"] for each in found] == [True] * EACH + [False] * EACH + [True]
    assert [each["forged"] for each in found] == [""] * 2 * EACH + ["table_1 one"]
    every = [each["tables"]["all tables"] for each in found]
    reached = [each["distance"] <= each["honest"][1] for each in every]
    assert reached == [True] * 2 * EACH + [False]
    assert every[-1]["distance"] > 3 * every[-1]["honest"][1]
    rows = searched_table(found).splitlines()
    assert rows[0] == "| setting | all tables |"
    distance, limit = every[-1]["distance"], every[-1]["honest"][1]
    forged = "near this paper's; Table 1, one \N{MULTIPLICATION SIGN} 2"
    assert rows[-1] == f"| {forged} | **not reached**: {distance:.0f} ({limit:.0f}) |"


def test_a_synthetic_paper_is_one_rounded_run_and_one_has_its_first_column_doubled(linear: Any) -> None:
    u = settings(linear, 5, 0, 2 * EACH)
    *honest, forged = (known.printed for known in papers_of(linear, u, 7))
    flown = linear.flown(u, [[7, 10, row] for row in range(len(u))], 1)[:, 0]
    np.testing.assert_allclose(honest, flown, atol=0.0005 + 1e-12)  # three digits are printed
    np.testing.assert_allclose(forged[:3], FACTOR * honest[0][:3])
    np.testing.assert_allclose(forged[3:], honest[0][3:])

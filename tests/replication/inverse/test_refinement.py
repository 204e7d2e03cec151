from pathlib import Path
from typing import Any

import numpy as np

from replication.inverse.bank import Bank, settings
from replication.inverse.findings import add_findings, read_findings, table_rows
from replication.inverse.refinement import best_fit


def _bank(linear: Any) -> Bank:
    u = settings(linear, 2, 0, 300)
    return Bank(2, u, linear.flown(u, [[2, n, 1] for n in range(300)], 1)[:, 0], np.empty((300, 0)), 0.0)


def test_the_search_finds_the_setting_that_made_the_numbers(linear: Any) -> None:
    known = np.array([[0.3, 0.8, 0.2]])
    printed = linear.flown(known, [[9]], 1)[0, 0]
    fit = best_fit(linear, _bank(linear), printed, 12, 1, lambda line: None)
    # The 4 readings of a and 2 of b have noise of 0.1, and so do the 4 runs that a setting is judged by.
    assert abs(fit.u[0] - 0.3) < 4 * 0.1 / np.sqrt(4)
    assert abs(fit.u[1] - 0.8) < 4 * 0.1 / np.sqrt(2)
    assert fit.u[2] < 0.5
    assert np.abs(fit.residual).max() < 4.5
    np.testing.assert_allclose(fit.scatter, 0.1, rtol=0.5)


def test_a_number_that_no_setting_gives_is_told_and_leaves_the_others(linear: Any, tmp_path: Path) -> None:
    printed = np.array([0.3, 0.3, 9.0, 0.8, 0.8, 0.3])  # the third is forged
    linear.printed = printed
    fit = best_fit(linear, _bank(linear), printed, 12, 1, lambda line: None)
    assert fit.residual[2] > 20
    assert np.abs(np.delete(fit.residual, 2)).max() < 4.5
    add_findings("linear", {"tables": table_rows(linear, {"all tables": fit})}, tmp_path / "findings.json")
    table = read_findings(tmp_path / "findings.json")["papers"]["linear"]["tables"]["table_1"]
    assert table["columns"] == ["one", "two"]
    assert [row["paper"] for row in table["rows"]] == [[0.3, 0.8], [0.3, 0.8], [9.0, 0.3]]

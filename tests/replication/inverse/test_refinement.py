from pathlib import Path
from typing import Any

import numpy as np

from replication.inverse.bank import Bank, settings
from replication.inverse.descent import Sought, representatives, stepped
from replication.inverse.findings import add_findings, read_findings, table_rows
from replication.inverse.prior import Unknown, choice, log_uniform, or_else
from replication.inverse.refinement import best_fit, continued, honest_residuals


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


def test_a_search_never_loses_what_it_has_found_and_ends_flat(linear: Any) -> None:
    printed = linear.flown(np.array([[0.3, 0.8, 0.2]]), [[9]], 1)[0, 0]
    fit = best_fit(linear, _bank(linear), printed, 4, 1, lambda line: None)
    flown, misfit = (np.array(each) for each in zip(*fit.history, strict=True))
    assert (np.diff(flown) >= 0).all()
    assert (np.diff(misfit) <= 0).all()
    late = np.interp(0.75 * flown[-1], flown, misfit)
    assert late - misfit[-1] < 0.01 * (misfit[0] - misfit[-1]) + 0.5
    worse = continued(fit, linear, _bank(linear), printed, 1, 1, lambda line: None, [np.array([0.9, 0.1, 0.9])])
    assert worse.history[-1][1] <= fit.history[-1][1]


def test_steps_lead_to_the_least_misfit_of_all_settings_around(linear: Any) -> None:
    """To less than a standard deviation of both unknowns, 2 in -2 log likelihood; the least is found on a grid."""
    printed = linear.flown(np.array([[0.3, 0.8, 0.2]]), [[9]], 1)[0, 0]
    sought = Sought(linear, printed, 1)
    first = sought.at(np.array([0.6, 0.5, 0.2]))
    there = stepped(sought, stepped(sought, stepped(sought, first)))
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 1, 101), [0.2]), axis=-1).reshape(-1, 3)
    least = sought.flown(grid).misfit.sum(axis=1).min()
    assert there.total < least + 2
    assert first.total > least + 10


def test_every_kind_of_value_is_tried() -> None:
    named = Unknown("kind", "", "kind", choice((5, 1, 1)), choices=("a", "b", "c"))
    assert named.law(representatives(named)).tolist() == [0, 1, 2]
    mostly_none = Unknown("size", "m", "size", or_else(0.5, 0.0, log_uniform(1, 100)))
    values = mostly_none.law(representatives(mostly_none))
    assert values[0] == 0
    assert len(values) == 6
    assert values[-1] > 80


def test_honest_papers_are_one_scatter_from_their_own_setting(linear: Any) -> None:
    residuals = honest_residuals(linear, _bank(linear), linear.printed, 200, 1)
    assert abs(residuals.std() - 1) < 4 / np.sqrt(2 * residuals.size) + 0.03  # scatter of 40 runs is known to 11 %
    assert abs(residuals.mean()) < 4 / np.sqrt(residuals.size)

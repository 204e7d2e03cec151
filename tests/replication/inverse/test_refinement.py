from pathlib import Path
from typing import Any

import numpy as np

from replication.inverse.bank import Bank, settings
from replication.inverse.findings import add_findings, read_findings, table_rows
from replication.inverse.misfit import Sought
from replication.inverse.moves import common_moved, own_moved, representatives
from replication.inverse.prior import Unknown, choice, log_uniform, or_else, uniform
from replication.inverse.refinement import FLAT, best_fit, honest_residuals
from replication.inverse.scoring import inside, scored


def _bank(linear: Any) -> Bank:
    u = settings(linear, 2, 0, 300)
    return Bank(2, u, linear.flown(u, [[2, n, 1] for n in range(300)], 1)[:, 0], np.empty((300, 0)), 0.0)


def _silent(line: str) -> None:
    """Say nothing."""


def _least_on_a_grid(sought: Sought) -> float:
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 1, 101), [0.2, 0.8]), axis=-1).reshape(-1, 3)
    return float(sought.look(grid).misfit.sum(axis=1).min())


def test_the_search_finds_the_setting_that_made_the_numbers(linear: Any) -> None:
    known = np.array([[0.3, 0.8, 0.2]])
    printed = linear.flown(known, [[9]], 1)[0, 0]
    fit = best_fit(linear, _bank(linear), printed, 4, 1, _silent)
    # The 4 readings of a and 2 of b have noise of 0.1, and so do the 4 runs that a setting is judged by.
    assert abs(fit.u[0] - 0.3) < 4 * 0.1 / np.sqrt(4)
    assert abs(fit.u[1] - 0.8) < 4 * 0.1 / np.sqrt(2)
    assert fit.u[2] < 0.5
    assert np.abs(fit.residual).max() < 4.5
    np.testing.assert_allclose(fit.scatter, 0.1, rtol=0.5)


def test_a_number_that_no_setting_gives_is_told_and_leaves_the_others(linear: Any, tmp_path: Path) -> None:
    printed = np.array([0.3, 0.3, 9.0, 0.8, 0.8, 0.3])  # the third is forged
    linear.printed = printed
    fit = best_fit(linear, _bank(linear), printed, 4, 1, _silent)
    assert fit.residual[2] > 20
    assert np.abs(np.delete(fit.residual, 2)).max() < 4.5
    add_findings("linear", {"tables": table_rows(linear, {"all tables": fit})}, tmp_path / "findings.json")
    table = read_findings(tmp_path / "findings.json")["papers"]["linear"]["tables"]["table_1"]
    assert table["columns"] == ["one", "two"]
    assert [row["paper"] for row in table["rows"]] == [[0.3, 0.8], [0.3, 0.8], [9.0, 0.3]]


def test_a_search_comes_to_the_least_misfit_of_all_settings_and_ends_flat(linear: Any) -> None:
    """The least is found on a grid, whose cells cost less than 0.3 at the noise of these numbers."""
    printed = linear.flown(np.array([[0.3, 0.8, 0.2]]), [[9]], 1)[0, 0]
    fit = best_fit(linear, _bank(linear), printed, 4, 1, _silent)
    first, late, last = fit.misfit
    assert last < _least_on_a_grid(Sought(linear, printed, 1)) + 0.1
    assert last <= late <= first
    assert late - last < FLAT * (first - last) + 0.01


def test_a_search_ends_where_the_distance_is_reached(linear: Any) -> None:
    printed = linear.flown(np.array([[0.3, 0.8, 0.2]]), [[9]], 1)[0, 0]
    full = best_fit(linear, _bank(linear), printed, 4, 1, _silent)
    early = best_fit(linear, _bank(linear), printed, 4, 1, _silent, until=2 * full.distance)
    assert early.flown < full.flown
    assert early.distance <= 2 * full.distance


def test_steps_lead_to_the_least_misfit_of_all_settings_around(linear: Any) -> None:
    printed = linear.flown(np.array([[0.3, 0.8, 0.2]]), [[9]], 1)[0, 0]
    sought = Sought(linear, printed, 1)
    first = sought.places(np.array([[0.6, 0.5, 0.2]]))[0]
    there = scored(sought, first, 30, 1e-3)
    assert first.total > there.total + 10
    assert there.total < _least_on_a_grid(Sought(linear, printed, 1)) + 0.1
    assert there.total <= scored(sought, there, 5, 1e-3).total + 0.1


def test_moves_change_a_choice_and_what_acts_on_one_group_alone(linear: Any) -> None:
    printed = linear.flown(np.array([[0.3, 0.8, 0.2]]), [[9]], 1)[0, 0]
    sought = Sought(linear, printed, 1)
    start = sought.places(np.array([[0.3, 0.1, 0.9]]))[0]
    chosen = common_moved(sought, start)
    assert chosen.u[2] < 0.5
    assert chosen.u[:2].tolist() == start.u[:2].tolist()
    moved = own_moved(sought, chosen)
    assert abs(moved.u[1] - 0.8) < 4 * 0.1 / np.sqrt(2) + 1 / 16  # noise of two readings, and the grid's
    assert moved.u[0] == start.u[0]


def test_an_angle_goes_round_and_a_length_does_not() -> None:
    class Turned:
        unknowns = (
            Unknown("angle", "deg", "angle", uniform(0, 360), wraps=True),
            Unknown("length", "m", "length", uniform(0, 1)),
        )

    there = inside(Turned(), np.array([[1.25, 1.25], [-0.25, -0.25]]))  # type: ignore[arg-type]
    np.testing.assert_allclose(there, [[0.25, 1.0], [0.75, 0.0]], atol=1e-8)


def test_every_kind_of_value_is_tried() -> None:
    named = Unknown("kind", "", "kind", choice((5, 1, 1)), choices=("a", "b", "c"))
    assert named.law(representatives(named)).tolist() == [0, 1, 2]
    mostly_none = Unknown("size", "m", "size", or_else(0.5, 0.0, log_uniform(1, 100)))
    values = mostly_none.law(representatives(mostly_none))
    assert values[0] == 0
    assert len(values) == 4
    assert values[-1] > 80
    assert len(representatives(Unknown("size", "m", "size", uniform(0, 1)))) == 0


def test_honest_papers_are_one_scatter_from_their_own_setting(linear: Any) -> None:
    residuals = honest_residuals(linear, _bank(linear), linear.printed, 200, 1)
    assert abs(residuals.std() - 1) < 4 / np.sqrt(2 * residuals.size) + 0.03  # scatter of 40 runs is known to 11 %
    assert abs(residuals.mean()) < 4 / np.sqrt(residuals.size)

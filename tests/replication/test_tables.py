"""The papers' tables: their numbers as printed, our arithmetic, and what the numbers say of themselves."""

import math

import numpy as np
import pytest
from synthetic import Synthetic

from replication import operations
from replication.papers import papers
from replication.shi2025.tables import figures, place, published_table, table_four


@pytest.mark.parametrize("number", [2, 3])
def test_the_published_standard_deviations_are_of_one_time_series(number):
    """Per axis, mean^2 + std^2 is a mean square; over the axes they add up to that of the norm."""
    table = papers()["alpha_kf"].content[f"table_{number}"]
    for role in ("ekf", "ukf", "alpha_kf"):
        axes = sum(value**2 for axis in "xyz" for value in table[axis][role])
        norm = sum(value**2 for value in table["r"][role])
        # Six numbers rounded to 0.0005 each, of at most 2.6 m.
        assert math.isclose(axes, norm, rel_tol=4e-3)


def test_the_published_percentages_follow_from_the_published_tables():
    content = papers()["alpha_kf"].content

    def below(table, quantity, role):
        row = content[table][quantity]
        return round(100 * (1 - row["alpha_kf"][0] / row[role][0]), 1)

    assert (below("table_2", "r", "ekf"), below("table_2", "r", "ukf")) == (74.6, 56.7)
    assert (below("table_2", "v", "ekf"), below("table_2", "v", "ukf")) == (47.8, 40.0)
    assert (below("table_3", "r", "ekf"), below("table_3", "r", "ukf")) == (34.5, 36.0)
    assert below("table_3", "v", "ekf") == 4.3
    for claim, parts in {"A1": ("74.6", "56.7"), "A2": ("47.8", "40.0"), "A4": ("34.5", "36.0")}.items():
        assert all(part in papers()["alpha_kf"].claims[claim] for part in parts)


def column_value(campaign, case, filter, column):
    return {"settled_x_mean_m": 3.0, "settled_y_mean_m": 1.0, "settled_z_mean_m": 2.0, "settled_x_std_m": 0.3}.get(
        column, 5.0
    )


def test_figures_are_in_the_papers_axes():
    measured = Synthetic(column_value, runs=400)
    # x along-track = y, y = minus z, z nadir = minus x; a standard deviation has no sign.
    means = [figures(measured, "c", "f", axis, "mean").mean() for axis in "xyz"]
    np.testing.assert_allclose(means, [1.0, -2.0, -3.0], rtol=5e-3)
    np.testing.assert_allclose(figures(measured, "c", "f", "z", "std").mean(), 0.3, rtol=5e-3)


def test_a_published_number_has_a_place_among_our_runs():
    runs = np.array([1.0, 2.0, 3.0, 4.0, math.nan])
    assert place(0.5, runs) == "below all runs"
    assert place(9.0, runs) == "above all runs"
    assert place(2.5, runs) == "above 50 % of runs"


def test_tables_keep_the_papers_layout_and_numbers():
    measured = Synthetic(column_value)
    table = published_table(measured, 2, "alpha_kf_gaussian")
    by_label = {row.label: row for row in table.rows}
    assert [cell.value for cell in by_label["r, paper"].cells] == [2.623, 1.258, 1.541, 0.660, 0.667, 0.361]
    assert by_label["z, relnav, one process noise"].cells[0].value == pytest.approx(-3.0, rel=0.01)
    assert by_label["z, the paper's number is"].cells[0].text == "above all runs"
    assert [cell.value for cell in by_label["convergence, paper"].cells] == [18, 240, 21]
    four = table_four(measured)
    assert [row.cells[0].value for row in four.rows if row.label.endswith("paper")] == [
        7.680, 8.608, 7.077, 6.947, 6.950, 7.095, 7.231,
    ]  # fmt: skip


def test_operations_are_those_of_the_textbook():
    # Phi P Phi^T for n = 6: two products of 6 x 6 matrices of 2 * 6^3 operations.
    assert operations.kalman() > 4 * 6**3
    assert operations.kalman() < operations.ekf() < operations.ukf() < operations.alpha_kf(256)
    each = operations.alpha_kf(2) - operations.alpha_kf(1)
    assert operations.alpha_kf(10000) == operations.alpha_kf(0) + 10000 * each
    # A draw of six normal numbers, their rotation and the weighted outer product, at the least.
    assert each > 6 * operations.FUNCTION + 36 + 72
    few = operations.break_even_samples("ukf")
    assert operations.alpha_kf(few) <= operations.ukf() < operations.alpha_kf(few + 1)
    with pytest.raises(ValueError, match="no count"):
        operations.count("pf", 1)

import numpy as np
import pytest

from relnav_sim.arrays import Array
from replication.inverse.alpha_kf import AlphaKf
from replication.inverse.alpha_kf_claims import BEST_ALPHAS, holds
from replication.inverse.alpha_kf_more_claims import ABSOLUTE, absolute, holds_besides
from replication.inverse.alpha_kf_numbers import FILTERS, NUMBERS
from replication.inverse.alpha_kf_outcomes import OUTCOMES
from replication.inverse.bank import Bank, settings
from replication.inverse.prior import values
from replication.papers import papers

PRINTED = AlphaKf().printed
PLACE = {number.name: place for place, number in enumerate(NUMBERS)}


def test_every_printed_number_is_there_once() -> None:
    assert len(NUMBERS) == len(PLACE) == len(PRINTED) == 51 + 48 + 28


@pytest.mark.parametrize("table", [2, 3])
@pytest.mark.parametrize("name", FILTERS)
def test_printed_norms_go_with_printed_axes(table: int, name: str) -> None:
    """The mean square of r is that of x, y and z; to a unit of the last digits. It would not hold in another order."""
    square = {
        axis: sum(PRINTED[PLACE[f"table_{table} {name} {axis} {kind}"]] ** 2 for kind in ("mean", "std"))
        for axis in ("x", "y", "z", "r")
    }
    assert square["x"] + square["y"] + square["z"] == pytest.approx(square["r"], abs=0.01)


def test_rules_hold_on_the_papers_own_numbers() -> None:
    held = {claim: bool(mask[0]) for claim, mask in holds(PRINTED[None]).items()}
    assert held == {**dict.fromkeys(("A1", "A2", "A3", "A4", "A5", "A6"), True), "A7": False}
    without_numbers = {"A10", "A11", "A12"}  # of outliers, periods and covariances
    assert held.keys() == papers()["alpha_kf"].claims.keys() - without_numbers - ABSOLUTE.keys()


def _outcomes(**at: float) -> Array:
    """Return outcomes in which A10, A11 and A12 hold but for those given."""
    found = {name: 0.02 for name in OUTCOMES}
    found |= {name: 0.01 for name in OUTCOMES if name.startswith("share") and name.endswith("alpha=0.05")}
    found |= {name: 3400.0 for name in OUTCOMES if name.startswith("period")}
    return np.array([[at.get(name.split(",")[0].replace(" ", "_"), value) for name, value in found.items()]])


def test_claims_without_numbers_follow_their_rules() -> None:
    assert all(mask.all() for mask in holds_besides(_outcomes(), BEST_ALPHAS).values())
    assert not holds_besides(_outcomes(share_of_outliers_of_v=0.02), BEST_ALPHAS)["A10"].any()
    assert not holds_besides(_outcomes(period_of_the_wave=3000.0), BEST_ALPHAS)["A11"].any()
    assert not holds_besides(_outcomes(formal_sigma_after_100_s_over_the_first=0.51), BEST_ALPHAS)["A12"].any()


@pytest.mark.slow
def test_printed_errors_lie_among_single_runs_of_the_setting_that_made_them() -> None:
    """A9 from a run of the setting itself, and not from twice its errors, which the scatter of a run can't give."""
    paper = AlphaKf()
    u = settings(paper, 11, 0, 12)
    bank = Bank(11, u, paper.flown(u, [[11, n, 1] for n in range(12)], 1)[:, 0], np.empty((12, 0)), 0.0)
    row = int(np.argmin(np.abs(np.log(bank.numbers[:, PLACE["table_3 alpha_kf r mean"]]))))
    assert absolute(bank, bank.numbers[row])["A9"][row]
    assert not absolute(bank, 1.9 * bank.numbers[row])["A9"][row]


def test_a_table_is_a_paper_of_its_own() -> None:
    paper = AlphaKf()
    names = [number.name for table in paper.tables.values() for number in table.numbers]
    assert sorted(names) == sorted(PLACE)
    for table in paper.tables.values():
        np.testing.assert_array_equal(table.printed, PRINTED[[PLACE[number.name] for number in table.numbers]])
    u = settings(paper, 1, 0, 1)
    second = paper.tables["table_2"]
    alone = second.flown(u, [[1]], 2)
    assert alone.shape == (1, 2, 51)
    np.testing.assert_array_equal(alone, paper.flown(u, [[1]], 2)[:, :, [PLACE[each.name] for each in second.numbers]])


def test_rules_fail_on_equal_filters() -> None:
    equal = PRINTED.copy()
    for table in (2, 3):
        for name in FILTERS:
            for number in NUMBERS:
                if number.table == f"table_{table}" and number.column == name:
                    equal[PLACE[number.name]] = PRINTED[PLACE[f"table_{table} ekf {number.label}"]]
    held = holds(equal[None])
    assert not any(held[claim][0] for claim in ("A1", "A2", "A3", "A4", "A5"))


def test_shared_values_act_everywhere() -> None:
    paper = AlphaKf()
    u = np.random.default_rng(1).random((300, len(paper.unknowns)))
    sharing = values(paper.unknowns, u)["sharing"]
    acting = values(paper.unknowns, paper.effective(u))
    psd = np.stack([acting[f"acceleration_psd_{name}_{table}"] for name in FILTERS for table in (2, 3)], axis=1)
    assert (np.ptp(psd[sharing == 0], axis=1) == 0).all()
    assert (psd[sharing == 1][:, 0] == psd[sharing == 1][:, 1]).all()
    assert (psd[sharing == 2][:, 0] != psd[sharing == 2][:, 1]).all()


@pytest.mark.parametrize("table", [2, 3, 4])
def test_what_does_not_act_on_a_table_changes_none_of_its_numbers(table: int) -> None:
    paper = AlphaKf((table,))
    u = paper.apart(settings(paper, 4, 0, 1))
    still = np.setdiff1d(np.arange(len(paper.unknowns)), paper.acting)
    moved = np.repeat(u, 1 + len(still), axis=0)
    for row, place in enumerate(still, 1):
        moved[row, place] = 1 - moved[row, place]
    seen = paper.flown(paper.apart(moved), [[6]] * len(moved), 1)
    np.testing.assert_array_equal(seen, np.broadcast_to(seen[0], seen.shape))
    assert len(still) > 10

import numpy as np
import pytest

from replication.inverse.alpha_kf import AlphaKf
from replication.inverse.alpha_kf_claims import holds
from replication.inverse.alpha_kf_numbers import FILTERS, NUMBERS
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
    not_judged = {"A8", "A9", "A10", "A11", "A12"}  # of scatter over runs, outliers, periods and covariances
    assert held.keys() == papers()["alpha_kf"].claims.keys() - not_judged


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

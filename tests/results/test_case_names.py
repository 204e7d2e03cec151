"""Every name that relnav prints of a case leads back to it."""

import pytest

from relnav_sim.results.case_names import case_in_tables, case_in_words, place_of_case
from relnav_sim.wording import short_labels

LABELS = [f"sensors.radar.range_sigma_m={size}, truth.forces.zonals={zonals}" for size in (1, 4) for zonals in (0, 2)]
IDS = ["aa", "bb", "cc", "dd"]


@pytest.mark.parametrize("index", range(4))
def test_every_printed_name_is_taken(index: int) -> None:
    short = short_labels(LABELS)[index]
    assert short != LABELS[index]
    for name in (index, str(index), f"case_00{index}", IDS[index], LABELS[index], short, f"case {short}"):
        assert place_of_case(name, LABELS, IDS) == index
    for label in (LABELS[index], short):
        assert place_of_case(case_in_words(index, label), LABELS, IDS) == index
        assert place_of_case(case_in_tables(index, label), LABELS, IDS) == index
    assert place_of_case(case_in_tables((index + 1) % 4, short), LABELS, IDS) is None  # number and label disagree


def test_a_name_of_two_cases_or_none_is_not_guessed() -> None:
    labels = ["sensors.radar.sigma_m=1", "stress.radar.sigma_m=1", "base"]
    assert short_labels(labels[:1]) == short_labels(labels[1:2]) == ["radar.sigma_m=1"]
    ids = ["x", "y", "z"]
    assert place_of_case("radar.sigma_m=1", labels, ids) is None
    assert place_of_case(labels[1], labels, ids) == 1
    assert place_of_case("4", labels, ids) is None
    assert place_of_case("", labels, ids) is None

"""docs/filters.md against the registry: every filter of relnav has its row, and the row says what the filter says."""

import inspect
import re
from pathlib import Path

import pytest

from relnav_sim.cli.catalogue import stated_cost
from relnav_sim.filters.registry import filter_kinds

PAGE = Path(__file__).parents[2] / "docs" / "filters.md"
ROWS = {
    cells[0].strip("`"): cells
    for line in PAGE.read_text(encoding="utf-8").splitlines()
    if line.startswith("| `")
    for cells in [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]]
}
BUILT_IN = sorted(
    name for name, kind in filter_kinds().items() if inspect.getmodule(kind.factory).__name__.startswith("relnav_sim.")
)


def test_no_row_is_left_over():
    assert sorted(ROWS) == BUILT_IN


@pytest.mark.parametrize("name", BUILT_IN)
def test_row_is_fresh(name):
    kind = filter_kinds()[name]
    what = " ".join(kind.description.partition("\n\n")[0].split()).replace("|", "\\|")
    _, _, source, when, *_ = ROWS.get(name, ["", "", "SOURCE", "WHEN", "", ""])
    fresh = [f"`{name}`", what, source, when, kind.measurement, f"{kind.cost_us:g}", *stated_cost(kind)]
    assert ROWS.get(name) == fresh, f"the row in {PAGE.name} should be: | {' | '.join(fresh)} |"
    assert when
    # The source is one that the filter itself names: authors and year.
    assert re.search(r"\b(19|20)\d\d\b", source)
    for word in re.findall(r"\b\d{4}\b|\b[A-Z][a-z]{2,}\b", source):
        assert word in kind.description, f"{word} is not in the description of {name}"

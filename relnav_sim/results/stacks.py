"""Stacks: how a results file of many cases holds those alike, in the datasets of `layout` with a row for each."""

from __future__ import annotations

from dataclasses import replace

from relnav_sim.results.layout import DIMENSIONS, FIXED, OBSERVABILITY, Dataset

STACKED_CASES = 50
"""A file of more cases has those alike in one group, a stack, with a row for each case and run."""

CASES = "cases"
"""The group that says what the cases are, where they have no groups of their own."""
CASE_TABLE = tuple(
    Dataset(name, ("case",), FIXED, "", words)
    for name, words in (
        ("id", "hash of the case's content without its filters"),
        ("label", "its values in words"),
        ("variables", "its values by their paths, JSON"),
        ("filters", "its filters with a hash of the settings of each, JSON"),
        ("channels", "what a measurement of each sensor consists of, JSON"),
        ("stress", "the stress under which it was flown; empty: none"),
        ("nominal", "id of the same case without the stress; empty: it has none"),
    )
)
STACK = Dataset("stack", ("case",), "<i8", "1", "number of the stack that holds the case; -1: nothing is computed yet")

OBSERVED_FACTS = (
    Dataset("sensors", ("observed_case",), FIXED, "", "sensors whose measurements count, JSON"),
    Dataset("blind", ("observed_case",), "<i8", "1", "number of directions that are not observable"),
    Dataset("weakest", ("observed_case",), FIXED, "", "the weakest direction in words"),
    Dataset("course", ("observed_case",), FIXED, "", "from when on, s, which direction is the weakest, JSON"),
)
"""The same in a stack, where a group has no attributes of one case."""


def result_version(cases: int) -> int:
    """Return the version of the layout that a result of so many cases is written in: the first that can hold it."""
    return 2 if cases > STACKED_CASES else 1


def row_of_case(dim: str) -> Dataset:
    """Return the dataset that says in a stack whose case the rows along a dimension are."""
    return Dataset("case", (dim,), "<i8", "1", "number of the case that the row is of, from 0")


def rows_of(name: str) -> Dataset:
    """Return a coordinate as a stack has it: ascending within each case only."""
    dimension = DIMENSIONS[name]
    return Dataset(name, (name,), dimension.dtype, dimension.units, dimension.long_name)


def stacked(spec: Dataset) -> Dataset:
    """Return a bound or a part of the observability as a stack has it: with a row for each case that has one."""
    dim = "observed_case" if spec in OBSERVABILITY else f"{spec.name}_case"
    return replace(spec, dims=(dim, *spec.dims))


def stack_group(index: int) -> str:
    """Return the name of a stack's group."""
    return f"stack_{index:03d}"

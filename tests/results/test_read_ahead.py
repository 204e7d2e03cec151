"""Rows that are read ahead are those of the dataset, in whatever order they are asked for."""

import h5py
import numpy as np
import pytest

from relnav_sim.results import layout, read_ahead, store
from relnav_sim.results.read_ahead import ReadAhead

ROWS = 1000
SPEC = next(spec for spec in layout.SUMMARY if spec.name == "rms")


@pytest.fixture(scope="module")
def values():
    return np.random.default_rng(3).uniform(1, 2, (ROWS, 2, 8))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory, values):
    path = tmp_path_factory.mktemp("ahead") / "rows.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset(SPEC.name, data=values)
    with h5py.File(path, "r") as file:
        yield file[SPEC.name]


@pytest.fixture
def reads(monkeypatch):
    """Count what is read from the file."""
    found = []
    real = store.values_of

    def counted(*arguments):
        found.append(arguments[2])
        return real(*arguments)

    monkeypatch.setattr(store, "values_of", counted)
    return found


def test_rows_in_order_are_read_a_piece_at_a_time(dataset, values, reads):
    ahead = ReadAhead()
    for first in range(0, ROWS, 4):
        assert np.array_equal(ahead.rows(dataset, SPEC, slice(first, first + 4)), values[first : first + 4])
    assert len(reads) == -(-ROWS // (read_ahead.AHEAD_BYTES // (2 * 8 * 8) // 4 * 4))


def test_any_rows_in_any_order(dataset, values):
    ahead = ReadAhead()
    rng = np.random.default_rng(4)
    for _ in range(300):
        first, last = sorted(rng.integers(0, ROWS + 1, 2))
        assert np.array_equal(ahead.rows(dataset, SPEC, slice(int(first), int(last))), values[first:last])


def test_what_is_done_to_rows_is_not_done_to_the_next(dataset, values):
    ahead = ReadAhead()
    ahead.rows(dataset, SPEC, slice(0, 4))[...] = 0
    assert np.array_equal(ahead.rows(dataset, SPEC, slice(0, 4)), values[:4])


def test_what_is_kept_has_a_bound(dataset, values, monkeypatch):
    monkeypatch.setattr(read_ahead, "MOST_BYTES", 2 * read_ahead.AHEAD_BYTES)
    ahead = ReadAhead()
    file = dataset.file.filename
    with h5py.File(file.replace("rows", "many"), "w") as many:
        for name in "abcd":
            many.create_dataset(name, data=values)
        for name in "abcdabcd":
            assert np.array_equal(ahead.rows(many[name], SPEC, slice(8, 12)), values[8:12])
            assert len(ahead._kept) <= 2

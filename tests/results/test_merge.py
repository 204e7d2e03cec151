"""The merged file holds the same bits whatever the shards."""

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from relnav_sim.results.block import Failure, RefusedError, ResultsError
from relnav_sim.results.merge import merge_shards
from relnav_sim.results.missing_runs import MissingRuns, missing_in_words, run_ranges
from relnav_sim.results.read import open_results


def contents(path: Path) -> dict[str, bytes]:
    """Return every dataset's bytes and every attribute, by its path."""
    found: dict[str, bytes] = {}

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        for key in item.attrs:
            if key not in ("DIMENSION_LIST", "REFERENCE_LIST"):
                found[f"{name}@{key}"] = repr(item.attrs[key]).encode()
        if isinstance(item, h5py.Dataset):
            values = item[...]
            found[name] = repr(values.tolist()).encode() if values.dtype == object else values.tobytes()

    with h5py.File(path) as file:
        visit("", file)
        file.visititems(visit)
    return found


@pytest.fixture
def reference(tmp_path, make_block, make_header, write, facts) -> dict[str, bytes]:
    """The contents of one case of 5 runs that was computed as one block."""
    merge_shards(write(tmp_path / "one", [make_block(0, range(5))]), make_header(cases=1), facts, tmp_path / "one.h5")
    return contents(tmp_path / "one.h5")


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_split_into_blocks_and_filter_sets_gives_the_same_file(
    data, tmp_path_factory, make_block, make_header, write, facts, reference
) -> None:
    folder = tmp_path_factory.mktemp("split")
    blocks = []
    for filters in data.draw(st.sampled_from([[("ekf", "alpha_0.5")], [("ekf",), ("alpha_0.5",)]])):
        order = data.draw(st.permutations(range(5)))
        cuts = sorted(data.draw(st.sets(st.integers(1, 4))))
        for first, last in zip([0, *cuts], [*cuts, 5], strict=True):
            blocks.append(make_block(0, sorted(order[first:last]), filters))
    shards = write(folder / "shards", blocks)
    merge_shards(data.draw(st.permutations(shards)), make_header(cases=1), facts, folder / "out.h5")
    assert contents(folder / "out.h5") == reference


def test_single_runs_and_a_shared_truth(tmp_path, make_block, make_header, write, facts) -> None:
    header = make_header(cases=1)
    shards = write(tmp_path / "a", [make_block(0, [run], shared=True) for run in range(5)])
    merge_shards(shards, header, facts, tmp_path / "a.h5")
    shards = write(tmp_path / "b", [make_block(0, range(5), shared=True)])
    merge_shards(shards, header, facts, tmp_path / "b.h5")
    assert contents(tmp_path / "a.h5") == contents(tmp_path / "b.h5")
    with open_results(tmp_path / "a.h5") as results:
        assert results.truth(0).shape == (1, 7, 6)


def test_duplicates_count_once_and_contradictions_are_errors(tmp_path, make_block, make_header, write, facts) -> None:
    header, out = make_header(cases=1), tmp_path / "out.h5"
    shards = write(tmp_path / "shards", [make_block(0, [0, 1, 2]), make_block(0, [2, 3, 4]), make_block(0, [1, 2, 3])])
    merge_shards(shards, header, facts, out)
    with open_results(out) as results:
        assert results.case_runs(0, "ekf").tolist() == [0, 1, 2, 3, 4]
        assert [failure.run for _, failure in results.failures()] == [2]
    before = out.read_bytes()
    block = make_block(0, [2, 3])
    slower = {**block.filters["ekf"].summary, "cpu_per_step": np.ones(2)}
    same = dataclasses.replace(
        block, filters={**block.filters, "ekf": dataclasses.replace(block.filters["ekf"], summary=slower)}
    )
    merge_shards([*shards, *write(tmp_path / "more", [same])], header, facts, out)
    other = {**block.filters["ekf"].summary, "nis_mean": np.ones((2, 2))}
    bad = dataclasses.replace(
        block, filters={**block.filters, "ekf": dataclasses.replace(block.filters["ekf"], summary=other)}
    )
    with pytest.raises(ResultsError, match=r"case scale=1, filter ekf: two shards disagree about run 2 \(nis_mean\)"):
        merge_shards([*shards, *write(tmp_path / "bad", [bad])], header, facts, out)
    assert [p.name for p in tmp_path.iterdir() if p.suffix != ""] == ["out.h5"]
    assert len(out.read_bytes()) == len(before)


def test_missing_runs_are_named_or_left_out(tmp_path, make_block, make_header, write, facts) -> None:
    out, header = tmp_path / "out.h5", make_header()
    shards = write(tmp_path / "shards", [make_block(0, [0, 3]), make_block(0, [1], filters=("ekf",))])
    with pytest.raises(
        ResultsError, match=r"case scale=1, filter ekf: runs 2, 4; case scale=1, filter alpha_0.5: runs 1-2, 4;"
    ):
        merge_shards(shards, header, facts, out)
    assert not out.exists()
    merge_shards(shards, header, facts, out, complete=False)
    with open_results(out) as results:
        assert results.case_runs(0, "ekf").tolist() == [0, 1, 3]
        assert results.missing()["scale=1", "alpha_0.5"] == (1, 2, 4)
        assert results.missing()["scale=2", "ekf"] == (0, 1, 2, 3, 4)
        assert len(results.summary()["run"]) == 5
        assert results.failures() == ()
        with pytest.raises(ResultsError, match="no run yet"):
            results.error("scale=2", "ekf")
        with pytest.raises(ResultsError, match="no results yet"):
            results.time_s("scale=2")


def test_fewer_runs_asked_than_held(tmp_path, make_block, make_header, write, facts) -> None:
    shards = write(tmp_path / "shards", [make_block(0, range(5))])
    merge_shards(shards, make_header(runs=2, cases=1), facts, tmp_path / "two.h5")
    shards = write(tmp_path / "fresh", [make_block(0, range(2))])
    merge_shards(shards, make_header(runs=2, cases=1), facts, tmp_path / "fresh.h5")
    assert contents(tmp_path / "two.h5") == contents(tmp_path / "fresh.h5")


def test_foreign_and_unfitting_shards_are_refused(tmp_path, make_block, make_header, write, facts) -> None:
    (shard,) = write(tmp_path / "shards", [make_block(0, range(5))])
    header = make_header(cases=1)
    for changed, words in (
        (dataclasses.replace(header, seed=1), "has seed"),
        (make_header(cases=1, filters=("ekf", "kf")), "filter kf: runs"),
        (dataclasses.replace(header, cases=()), "no case id0"),
    ):
        with pytest.raises(ResultsError, match=words):
            merge_shards([shard], changed, facts, tmp_path / "out.h5")
    other_times = dataclasses.replace(make_block(0, [5]), time_s=np.arange(7.0))
    private = make_block(0, [5], shared=True)
    for block, words in ((other_times, "its epochs differ"), (private, "share one truth")):
        with pytest.raises(ResultsError, match=words):
            merge_shards(
                [shard, *write(tmp_path / "x", [block])], make_header(runs=6, cases=1), facts, tmp_path / "o.h5"
            )
    with pytest.raises(ResultsError, match="can't be named 'truth'"):
        merge_shards([], make_header(filters=("truth",)), facts, tmp_path / "out.h5")


def test_failures_come_in_run_and_filter_order(tmp_path, make_block, make_header, write, facts) -> None:
    whole = [Failure(4, "", -1, "worker killed"), Failure(3, "alpha_0.5", 7, "b"), Failure(3, "ekf", 9, "a")]
    blocks = [dataclasses.replace(make_block(0, [3, 4]), failures=tuple(whole)), make_block(0, [0, 1, 2])]
    merge_shards(write(tmp_path / "s", blocks), make_header(cases=1), facts, tmp_path / "out.h5")
    with open_results(tmp_path / "out.h5") as results:
        found = [(f.run, f.filter, f.epoch, f.reason) for _, f in results.failures("id0")]
    assert found == [
        (2, "ekf", 23, "covariance not positive definite"), (3, "ekf", 9, "a"), (3, "alpha_0.5", 7, "b"),
        (4, "", -1, "worker killed"),
    ]  # fmt: skip


def test_what_a_filter_has_said_can_not_keep_a_campaign_from_its_results(
    tmp_path, make_block, make_header, write, facts
) -> None:
    """Shards of earlier versions hold messages and names that HDF5 can't store, or that do something when shown."""
    spoken = [(0, "a\x00b"), (1, "caf\udce9.dat"), (2, "x" * 5_000_000), (3, "\x1b[31m\u202e")]
    failures = tuple(Failure(run, "ekf", 4, "") for run, _ in spoken)
    for failure, (_, words) in zip(failures, spoken, strict=True):
        object.__setattr__(failure, "reason", words)
    one = dataclasses.replace(make_block(0, range(5), ["ekf"]), failures=failures)
    named = dataclasses.replace(one.filters["ekf"], diagnostics={"n\x00\udcff": np.arange(5.0)})
    blocks = [dataclasses.replace(one, filters={"ekf": named})]
    merge_shards(write(tmp_path / "s", blocks), make_header(cases=1, filters=("ekf",)), facts, tmp_path / "out.h5")
    with open_results(tmp_path / "out.h5") as results:
        found = [failure.reason for _, failure in results.failures("id0")]
        assert results.diagnostics(0, "ekf")[r"n\x00\udcff"].tolist() == [0, 1, 2, 3, 4]
    assert [found[0], found[1], found[3]] == [r"a\x00b", r"caf\udce9.dat", r"\x1b[31m\u202e"]
    assert len(found[2]) <= 500 and found[2].startswith("xxx")


def test_a_run_that_failed_twice_need_not_say_it_in_the_same_words(
    tmp_path, make_block, make_header, write, facts
) -> None:
    """An exception may name an address or a moment; when and where it failed must agree."""
    said = [
        dataclasses.replace(make_block(0, runs), failures=(Failure(3, "ekf", epoch, f"<object at {runs[0]}>"),))
        for runs, epoch in ((range(3, 5), 9), (range(2, 5), 9), (range(1, 5), 8))
    ]
    first = dataclasses.replace(make_block(0, range(3)), failures=())
    shards = write(tmp_path / "s", [first, *said])
    merge_shards(shards[:3], make_header(cases=1), facts, tmp_path / "out.h5")
    with pytest.raises(RefusedError, match="disagrees with another shard about why run 3 failed"):
        merge_shards(shards, make_header(cases=1), facts, tmp_path / "out.h5")


def test_run_ranges() -> None:
    assert run_ranges([3]) == "run 3"
    assert run_ranges([9, 0, 1, 2, 7, 8]) == "runs 0-2, 7-9"
    assert run_ranges([9, 0, 1, 2, 7, 8, 11], 1) == "runs 0-2 and 4 more"


def test_of_very_many_missing_runs_the_first_are_named() -> None:
    runs = tuple(range(0, 20_000, 2))
    missing = [MissingRuns(f"a={n}", name, runs) for n in range(1000) for name in ("ekf", "ukf")]
    said = missing_in_words(missing)
    assert said.startswith("20000000 runs are missing: case a=0, filter ekf: runs 0, 2, 4, 6 and 9996 more; case a=0,")
    assert said.endswith("; and 1996 more filters and cases") and len(said) < 400

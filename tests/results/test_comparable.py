"""Whether two results may be set side by side."""

import dataclasses

import pytest

from relnav_sim.results.comparable import comparable
from relnav_sim.results.merge import merge_shards
from relnav_sim.results.read import open_results


@pytest.fixture
def reasons(tmp_path, make_block, make_header, write, facts):
    """Return the reasons for two results that differ in header and provenance as given."""
    clean = dataclasses.replace(facts, git_commit="a" * 40, git_dirty=0, versions={"relnav": "1", "numpy": "2.0"})

    def made(name, runs, changes, origin):
        header = dataclasses.replace(make_header(cases=1), **changes)
        shards = write(tmp_path / name, [make_block(0, runs)]) if runs else []
        merge_shards(shards, header, dataclasses.replace(clean, **origin), tmp_path / f"{name}.h5", complete=False)
        return tmp_path / f"{name}.h5"

    usual = made("usual", range(2), {}, {})

    def compare(runs=range(2), changes=None, origin=None, first_origin=None):
        first = usual if first_origin is None else made("first", range(2), {}, first_origin)
        with open_results(first) as a, open_results(made("second", runs, changes or {}, origin or {})) as b:
            return comparable(a, b)

    return compare


def test_the_same_campaign_is_comparable_whatever_the_machine_and_the_runs(reasons):
    assert reasons() == []
    assert reasons(range(1, 4), {"runs": 9}, {"machine": {"system": "other"}, "versions": {"relnav": "1"}}) == []


def test_reasons_are_named(reasons):
    assert "no run in common" in reasons(range(2, 4))[0]
    newer = reasons(origin={"versions": {"relnav": "2"}})[0]
    assert "settings" not in newer and "different versions of relnav (1 and 2)" in newer
    assert "different commits (aaaaaaaaaaaa and none)" in reasons(origin={"git_commit": "", "git_dirty": -1})[0]
    assert "changes that no commit holds" in reasons(first_origin={"git_dirty": 1})[0]
    assert "differ in clock.step_s" in reasons(changes={"content": {"clock": {"step_s": 9}}})[0]
    assert "seeds differ" in reasons((), {"seed": 1})[0]

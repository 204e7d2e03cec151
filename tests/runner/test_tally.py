"""What a terminal shows while a campaign runs: counts, the time left, means with intervals that shrink."""

import io
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from relnav_sim import open_results, run_campaign
from relnav_sim.results.shards import read_shard
from relnav_sim.runner.headline import headline_figures
from relnav_sim.runner.progress import Bar, Lines
from relnav_sim.runner.tally import Tally
from relnav_sim.runner.watch import Watch
from relnav_sim.runner.work import blocks_left


@pytest.fixture
def blocks(campaign):
    return list(blocks_left(campaign("block_runs=2"), {}, Path()))


def figures(block, offset=0.0):
    return {name: {run: 1.0 + run + offset for run in block.runs} for name in block.case.config.filters}


def test_counts_by_case(blocks):
    tally = Tally(blocks, {}, Watch())
    assert tally.total == 12 and not tally.cases_under_way()
    tally.count(blocks[0], figures(blocks[0]))
    ((label, count, means),) = tally.cases_under_way()
    assert label == blocks[0].case.label and count == "2/6"
    assert means.startswith("kf 1.5 ±") and ", ekf 1.5 ±" in means


def test_the_interval_is_students_over_all_runs_known_earlier_ones_too(blocks):
    case = blocks[0].case.id
    tally = Tally(blocks[1:], {(case, "kf"): {0: 1.0, 1: 2.0}}, Watch())
    tally.count(blocks[1], figures(blocks[1]))
    sample = np.array([1.0, 2.0, 3.0, 4.0])
    wide = stats.t.ppf(0.975, 3) * stats.sem(sample)
    assert tally.row(case)[2].startswith(f"kf {sample.mean():.3g} ±{wide:.2g} m")


def test_lines(blocks, capsys):
    lines = Lines(Tally(blocks[:2], {}, Watch()), every_s=1e9)
    lines.advance(blocks[0], figures(blocks[0]))
    assert capsys.readouterr().err == ""
    lines.advance(blocks[1], figures(blocks[1]))
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith("4 of 4 runs done, in ")
    assert second.startswith(f"  {blocks[0].case.label}: position error kf 2.5 ±")


def test_the_last_lines_are_of_all_cases(blocks, capsys):
    lines = Lines(Tally(blocks, {}, Watch()), every_s=1e9)
    for block in blocks:
        lines.advance(block, figures(block))
    labels = list(dict.fromkeys(block.case.label for block in blocks))
    first, *rest = capsys.readouterr().err.splitlines()
    assert first.startswith("12 of 12 runs done") and len(labels) == 2
    assert [line.split(":")[0].strip() for line in rest] == labels


def test_the_bar_shows_cases_under_way(blocks):
    from rich.console import Console

    tally = Tally(blocks, {}, Watch())
    bar = Bar(tally)
    for block in (blocks[0], blocks[-1]):
        bar.advance(block, figures(block))
    console = Console(width=150, file=io.StringIO())
    console.print(bar)
    text = console.file.getvalue()
    assert "4/12 runs" in text and text.count("2/6") == 2 and "left" in text


def test_the_headline_is_the_settled_rms_of_the_runs_that_did_not_fail(campaign, tmp_path):
    out = run_campaign(campaign(), tmp_path / "out.h5", backend="sequential")
    with open_results(out) as results:
        summary = results.summary()
        ids = [case.id for case in results.headers]
    for shard in (tmp_path / "out.h5.shards").glob("*.h5"):
        info, block = read_shard(shard)
        for name, of_runs in headline_figures(block).items():
            rows = (summary["case"] == ids.index(info.case_id)) & (summary["filter"] == name)
            expected = dict(zip(summary["run"][rows], summary["settled_r_rms_m"][rows], strict=True))
            assert of_runs == {run: expected[run] for run in info.runs}

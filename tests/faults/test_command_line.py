"""`relnav run` with its options for failures, parts and single runs, and `relnav merge`, as a user types them."""

import pytest
from small_campaign import assert_same_bits
from typer.testing import CliRunner

from relnav_sim import open_results
from relnav_sim.cli.app import app

SEQUENTIAL = ("--backend", "sequential")


@pytest.fixture
def here(relnav, monkeypatch):
    made = relnav(("block_runs: 4", "block_runs: 4\nbound: false"))
    monkeypatch.chdir(made.folder)
    return made


def invoke(code, *arguments):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result


def test_parts_and_merge(here):
    invoke(0, "run", "small.yaml", *SEQUENTIAL)
    for part in (1, 2):
        result = invoke(0, "run", "small.yaml", "--shard", f"{part}/2", "--set", "block_runs=1", *SEQUENTIAL)
        assert (
            f"wrote results/small.part_{part}_of_2.h5; next: relnav merge results/small.h5 results/small.part_*_of_2.h5"
            in (result.stdout)
        )
    result = invoke(2, "merge", "merged.h5", "results/small.part_1_of_2.h5")
    assert "runs are missing: case" in result.stderr
    assert result.stderr.endswith(
        ". Name every part, its result file or its .shards folder; a part that nobody has computed is: "
        "relnav run FILE --shard I/N --out PATH\n"
    )
    invoke(0, "merge", "merged.h5", "results/small.part_1_of_2.h5", "results/small.part_2_of_2.h5.shards")
    assert_same_bits(here.out, here.folder / "merged.h5")
    assert "exists" in invoke(2, "merge", "merged.h5", "results/small.h5").stderr
    missing = invoke(3, "merge", "other.h5", "results/none.h5").stderr
    there = "results/small.h5, results/small.part_1_of_2.h5, results/small.part_2_of_2.h5, merged.h5"
    assert missing == f"relnav: results/none.h5: No such file or directory; there are {there}\n"


def test_parts_with_one_out_have_a_file_each(here):
    for _ in range(2):  # the second time each goes on with its own, which is finished
        for part in (1, 2):
            result = invoke(0, "run", "small.yaml", "--shard", f"{part}/2", "--out", "my parts/all.h5", *SEQUENTIAL)
            merge = "relnav merge 'my parts/all.h5' 'my parts/all.part_'*_of_2.h5 when all 2 parts are there"
            assert result.stdout == f"wrote my parts/all.part_{part}_of_2.h5; next: {merge}\n"
    assert "every run was finished already" in result.stderr
    parts = [f"my parts/all.part_{part}_of_2.h5" for part in (1, 2)]
    same = invoke(0, "run", "small.yaml", "--shard", "2/2", "--out", parts[1], *SEQUENTIAL)
    assert same.stdout.startswith(f"wrote {parts[1]};")
    invoke(0, "merge", "my parts/all.h5", *parts)
    invoke(0, "run", "small.yaml", *SEQUENTIAL)
    assert_same_bits(here.out, here.folder / "my parts" / "all.h5")


@pytest.mark.slow
def test_one_run(here):
    result = invoke(0, "run", "small.yaml", "--only", "1:4", "--trace", *SEQUENTIAL)
    assert "wrote results/small.case_001.run_4.h5" in result.stdout
    assert "run 4 only" in invoke(0, "inspect", "results/small.case_001.run_4.h5").stdout
    assert not here.shards.exists()
    invoke(0, "run", "small.yaml", *SEQUENTIAL)
    with open_results("results/small.case_001.run_4.h5") as one, open_results(here.out) as many:
        theirs = many.series(1, "ekf", 4)
        assert one.series(0, "ekf", 4).error[::4].tobytes() == theirs.error.tobytes()
    assert "holds a campaign" in invoke(2, "run", "small.yaml", "--only", "0:0", "--out", "results/small.h5").stderr


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("--shard", "0/2"), "--shard takes I/N"),
        (("--shard", "3/2"), "--shard takes I/N"),
        (("--shard", "half"), "--shard takes I/N"),
        (("--only", "3"), "--only takes CASE:RUN"),
        (("--only", "0:x"), "--only takes CASE:RUN"),
        (("--only", "0:99"), "no run 99"),
        (("--only", "7:0"), "no case '7'"),
        (("--trace",), "--trace needs --only"),
        (("--only", "0:1", "--shard", "1/2"), "neither"),
        (("--fail-fast", "--max-failures", "3"), "one of them"),
    ],
)
def test_options_that_make_no_sense(here, arguments, words):
    result = invoke(2, "run", "small.yaml", *arguments)
    assert words in result.stderr and result.stderr.count("\n") == 1
    assert not here.out.parent.exists()


def test_a_finished_campaign_says_so_and_keeps_its_provenance(here):
    result = invoke(0, "run", "small.yaml", *SEQUENTIAL)
    assert "the shards stay in results/small.h5.shards" in result.stderr
    with open_results(here.out) as results:
        before = results.provenance
    result = invoke(0, "run", "small.yaml", "--workers", "1", *SEQUENTIAL)
    assert "every run was finished already" in result.stderr
    with open_results(here.out) as results:
        assert results.provenance == before


@pytest.mark.slow
def test_inspect_shows_the_campaign_and_compares(here):
    invoke(0, "run", "small.yaml", *SEQUENTIAL)
    invoke(0, "run", "small.yaml", "--out", "b.h5", "--set", "seed=6", *SEQUENTIAL)
    text = (here.folder / "small.yaml").read_text(encoding="utf-8")
    assert invoke(0, "inspect", "b.h5", "--campaign").stdout.strip() == text.strip()
    shown = invoke(0, "inspect", here.out, "b.h5").stdout
    assert "not comparable:\n  the seeds differ (5 and 6)" in shown
    for word in ("hash", "command", "source", "versions", "machine", "began", "ended"):
        assert f"\n{word} " in shown

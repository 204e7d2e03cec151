"""What the commands say to a slip: the nearest name, a command that a shell takes, where a file goes."""

import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relnav_sim.cli.app import app
from relnav_sim.cli.listing import LISTS
from relnav_sim.plots import FIGURE_KINDS

ROOT = Path(__file__).parents[2]
SHORT = [
    *["--set", "clock.duration_s=20", "--set", "clock.store_every_s=5", "--set", "statistics.settle_s=10"],
    *["--set", "grid.sensors.radar.noise.kind=[gaussian]", "--runs", "1", "--backend", "sequential"],
]


def invoke(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "campaigns" / "demo.yaml").read_text(encoding="utf-8")
    (tmp_path / "demo.yaml").write_text(text.partition("grid:")[0], encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["filters"], "did you mean relnav list filters?"),
        (["sensor"], "did you mean relnav list sensors?"),
        (["ukf"], "did you mean relnav show filter ukf?"),
        (["rnu", "demo.yaml"], "did you mean relnav run?"),
        (["simulate"], "did you mean relnav run?"),
        (["demo.yaml"], "did you mean relnav run demo.yaml?"),
        (["xyzzy"], "relnav --help lists the commands"),
        (["list", "filtres"], "did you mean 'filters'?"),
        (["show", "UKF"], "did you mean 'ukf'?"),
        (["show", "filter", "UKF"], "did you mean 'ukf'?"),
        (["show", "filters"], "give a name too, as relnav show filter"),
    ],
)
def test_what_was_probably_meant(here, words, said):
    result = invoke(*words)
    assert result.exit_code == 2
    assert said in result.stderr


@pytest.mark.parametrize("words", [["ukf"], ["filter", "ukf"], ["filters", "ukf"], ["dynamics", "cw"], ["cw"]])
def test_show_finds_what_has_the_name(words):
    result = invoke("show", *words)
    assert result.exit_code == 0
    assert result.stdout.startswith(f"{words[-1]}: ")


def test_choices_may_be_in_capitals(here):
    assert invoke("list", "filter").stdout == invoke("list", "filters").stdout
    assert "no such file" in invoke("figure", "a.h5", "rms", "--axes", "RTN").stderr.lower()


def test_list_alone_lists_what_can_be_listed_and_each_can_be(here):
    lines = invoke("list").stdout.splitlines()
    assert [line.split()[:2] for line in lines] == [["relnav", "list"]] * len(lines)
    names = [line.split()[2] for line in lines]
    assert names == list(LISTS)
    for name in names:
        assert invoke("list", name).exit_code == 0
    assert {line.split()[0] for line in invoke("list", "figures").stdout.splitlines()} == set(FIGURE_KINDS)


@pytest.mark.parametrize("words", [["report"], ["inspect"], ["export"], ["figure"], ["merge", "all.h5"]])
def test_a_campaign_in_place_of_a_result_is_to_be_run_first(here, words):
    words = [*words, "demo.yaml", *(["rms"] if words == ["figure"] else [])]
    result = invoke(*words)
    assert result.exit_code == 2
    assert result.stderr == "relnav: demo.yaml is a campaign, no result; first: relnav run demo.yaml\n"


@pytest.mark.parametrize("words", [["run", "demo.yaml", "--out", "x.csv"], ["merge", "x.csv", "a.h5"]])
def test_a_result_has_no_name_of_another_format(here, words):
    (here / "a.h5").touch()
    result = invoke(*words)
    assert result.exit_code == 2 and "x.csv: a result is an HDF5 file; give a name that ends in .h5" in result.stderr
    assert not list(here.glob("x.csv*"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["validate", "deno.yaml"], "relnav: deno.yaml: No such file or directory; did you mean demo.yaml?\n"),
        (["run", "xyzzy.yaml"], "relnav: xyzzy.yaml: No such file or directory; there is demo.yaml\n"),
        (["tune", "elsewhere/Demo.yaml"], "; did you mean demo.yaml?\n"),
        (["report", "old.h5"], "; did you mean results/old_one.h5?\n"),
        (["export", "results/old.h5"], "; did you mean results/old_one.h5?\n"),
    ],
)
def test_a_missing_file_has_a_near_name(here, words, said):
    (here / "results").mkdir()
    (here / "results" / "old_one.h5").touch()
    result = invoke(*words)
    assert result.exit_code == 3
    assert result.stderr.endswith(said)


def test_out_may_be_a_folder_and_hints_are_quoted(here):
    folder = here / "my results"
    folder.mkdir()
    done = invoke("run", "demo.yaml", "--out", "my results", *SHORT[:6], *SHORT[8:])
    assert done.exit_code == 0, done.output
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("wrote")]
    assert shlex.split(line.partition("next: ")[2]) == ["relnav", "report", "my results/demo.h5"]
    one = invoke("run", "demo.yaml", "--out", "my results/", "--only", "0:0", *SHORT[:6], *SHORT[8:])
    assert "wrote my results/demo.case_000.run_0.h5;" in one.stdout
    made = invoke("figure", "my results/demo.h5", "rms", "--out", "new figures/")
    assert made.exit_code == 0, made.output
    assert (here / "new figures" / "rms.pdf").is_file()
    assert invoke("export", "my results/demo.h5", "--out", "new figures").exit_code == 0
    assert (here / "new figures" / "demo_summary.csv").is_file()
    for words in (["export", "my results/demo.h5"], ["figure", "my results/demo.h5", "rms"]):
        assert "no regular file" in invoke(*words, "--out", "/dev/null").stderr
    assert "is a file" in invoke("report", "my results/demo.h5", "--out", "demo.yaml").stderr


@pytest.mark.parametrize("out", ["/dev/null", "a pipe"])
def test_a_special_file_is_no_result(here, out):
    import os

    os.mkfifo(here / "a pipe")
    result = invoke("run", "demo.yaml", "--out", out)
    assert (result.exit_code, result.stderr) == (2, f"relnav: {out} is no regular file; give another name\n")
    assert not list(here.glob("*.shards"))
    assert invoke("report", out).exit_code == 2


def test_a_new_campaign_names_its_commands_in_quotes(here):
    words = invoke("new", "my first.yaml").stdout.strip().partition("next: ")[2]
    assert [shlex.split(part.strip()) for part in words.split(", then:")] == [
        ["relnav", "validate", "my first.yaml"],
        ["relnav", "run", "my first.yaml"],
    ]

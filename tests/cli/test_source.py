"""Commands that read results also read what is finished of a campaign that is not."""

import os
import shutil

import numpy as np
import pytest
from small_campaign import TEXT, assert_same_bits
from typer.testing import CliRunner

from relnav_sim import open_results, run_campaign
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.cli.app import app
from relnav_sim.cli.failures import UserError
from relnav_sim.cli.source import contents_by_now, newest_result, readable
from relnav_sim.results.contents import contents_of
from relnav_sim.runner.shard_folder import shard_folder


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A folder with the whole campaign, shards and all."""
    folder = tmp_path_factory.mktemp("finished")
    run_campaign(parse_campaign(TEXT), folder / "small.h5", backend="sequential")
    return folder


@pytest.fixture
def interrupted(finished, tmp_path):
    """A campaign of which one shard of four is missing, and the results file too."""
    out = tmp_path / "results" / "small.h5"
    shutil.copytree(finished, out.parent)
    whole = out.rename(tmp_path / "whole.h5")
    sorted(shard_folder(out).glob("*.h5"))[0].unlink()
    return out, whole


def test_the_runs_so_far(interrupted, capsys):
    out, _ = interrupted
    with readable(out) as file, open_results(file) as results:
        assert len(results.missing()) == 2, "both filters of one case"
        assert file.name == out.name and results.planned_runs == 6
        assert contents_by_now(out) == contents_of(results)
    assert not file.exists() and not out.exists()
    assert "not finished" in capsys.readouterr().err


def test_a_damaged_shard_is_left_out(interrupted):
    out, _ = interrupted
    shard = sorted(shard_folder(out).glob("*.h5"))[0]
    shard.write_bytes(shard.read_bytes()[:4000])
    with readable(out) as file, open_results(file) as results:
        assert sum(map(len, results.missing().values())) > 6
        assert contents_by_now(out) == contents_of(results)


FUTURE = 2**32


def test_a_finished_result_is_taken_as_it_is_whatever_the_times_say(interrupted, capsys):
    """A result that is copied, or whose shards are touched, or some are gone, holds what it holds."""
    out, whole = interrupted
    whole.rename(out)
    for shards, result in ((1, 2), (2, 1), (FUTURE, 1), (1, FUTURE)):
        for path in shard_folder(out).glob("*.h5"):
            os.utime(path, (shards, shards))
        os.utime(out, (result, result))
        with readable(shard_folder(out)) as file:
            assert file == out
    assert capsys.readouterr().err == ""


def test_a_campaign_that_grows_is_not_finished_until_the_result_has_grown(interrupted):
    """What either of result and shards holds counts; the file alone where they hold no more than it."""
    out, whole = interrupted
    run_campaign(parse_campaign(TEXT, ["runs=10", "bound=false"]), out, backend="sequential")
    grown = out.rename(whole.with_name("grown.h5"))
    out.write_bytes(whole.read_bytes())
    for path in (out, *shard_folder(out).glob("*.h5")):
        os.utime(path, (1, 1))
    oldest = sorted(shard_folder(out).glob("*.h5"))[0]
    oldest.unlink()
    with readable(out) as file, open_results(file) as results:
        assert file != out and results.planned_runs == 10 and results.missing() == {}
        np.testing.assert_array_equal(results.runs, range(10))
        assert contents_by_now(out) == contents_of(results)
    grown.rename(out)
    with readable(out) as file:
        assert file == out


def test_a_result_that_its_rule_has_stopped_is_finished(tmp_path):
    """The shards hold more runs, of a campaign without the rule; the file holds all that the rule asks for."""
    out = tmp_path / "small.h5"
    run_campaign(parse_campaign(TEXT, ["bound=false"]), out, backend="sequential")
    rule = "stop={metric: r_rms_m, half_width: 1000, at: [3]}"
    run_campaign(parse_campaign(TEXT, ["bound=false", rule]), out, backend="sequential")
    os.utime(out, (1, 1))
    with readable(out) as file, open_results(file) as results:
        assert file == out and results.planned_runs == 3


def test_a_bound_that_the_result_lacks_is_not_forgotten(interrupted):
    out, whole = interrupted
    with open_results(whole) as results:
        expected = results.bound(0, "ekf")
    run_campaign(parse_campaign(TEXT, ["bound=false"]), out, backend="sequential")
    without = out.read_bytes()
    with readable(out) as file:
        assert file == out
    run_campaign(parse_campaign(TEXT), out, backend="sequential")
    out.write_bytes(without)
    with readable(out) as file, open_results(file) as results:
        np.testing.assert_array_equal(results.bound(0, "ekf"), expected)


def test_shards_of_another_campaign_say_nothing_about_a_result(interrupted):
    out, whole = interrupted
    run_campaign(parse_campaign(TEXT, ["seed=6", "bound=false"]), out.with_name("b.h5"), backend="sequential")
    shutil.rmtree(shard_folder(out))
    shard_folder(out.with_name("b.h5")).rename(shard_folder(out))
    whole.rename(out)
    with readable(out) as file:
        assert file == out


def test_all_shards_give_the_finished_file(interrupted, tmp_path):
    out, whole = interrupted
    run_campaign(parse_campaign(TEXT), out, backend="sequential")
    out.unlink()
    with readable(out) as file:
        assert_same_bits(whole, file)


def test_the_newest_may_be_unfinished(interrupted, tmp_path):
    out, _ = interrupted
    other = out.with_name("other.h5")
    other.write_bytes(b"")
    os.utime(other, (1, 1))
    assert newest_result(out.parent) == out
    with pytest.raises(UserError, match="no result"):
        newest_result(tmp_path / "nowhere")


@pytest.mark.usefixtures("undrawn", "unrendered")
def test_report_and_inspect(interrupted, monkeypatch):
    out, _ = interrupted
    monkeypatch.chdir(out.parents[1])
    told = CliRunner().invoke(app, ["inspect", "results/small.h5"])
    assert told.exit_code == 0 and "not finished" in told.stdout
    told = CliRunner().invoke(app, ["report", "--format", "md"])
    assert told.exit_code == 0, told.output
    assert "The campaign is not finished" in (out.parent / "small" / "report.md").read_text()
    told = CliRunner().invoke(app, ["inspect", "results"])
    assert told.exit_code == 2 and "is a directory" in told.stderr

"""Commands that read results also read what is finished of a campaign that is not."""

import os

import pytest
from small_campaign import TEXT, assert_same_bits
from typer.testing import CliRunner

from relnav_sim import open_results, run_campaign
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.cli.app import app
from relnav_sim.cli.failures import UserError
from relnav_sim.cli.source import newest_result, readable
from relnav_sim.runner.folder import shard_folder


@pytest.fixture
def interrupted(tmp_path):
    """A campaign of which one shard of four is missing, and the results file too."""
    out = tmp_path / "results" / "small.h5"
    run_campaign(parse_campaign(TEXT), out, backend="sequential")
    whole = out.rename(tmp_path / "whole.h5")
    sorted(shard_folder(out).glob("*.h5"))[0].unlink()
    return out, whole


def test_the_runs_so_far(interrupted, capsys):
    out, _ = interrupted
    with readable(out) as file, open_results(file) as results:
        assert len(results.missing()) == 2, "both filters of one case"
        assert file.name == out.name and results.planned_runs == 6
    assert not file.exists() and not out.exists()
    assert "not finished" in capsys.readouterr().err


def test_a_damaged_shard_is_left_out(interrupted):
    out, _ = interrupted
    shard = sorted(shard_folder(out).glob("*.h5"))[0]
    shard.write_bytes(shard.read_bytes()[:4000])
    with readable(out) as file, open_results(file) as results:
        assert sum(map(len, results.missing().values())) > 6


def test_a_finished_result_is_taken_as_it_is(interrupted):
    out, whole = interrupted
    whole.rename(out)
    newest = max(path.stat().st_mtime for path in shard_folder(out).glob("*.h5"))
    os.utime(out, (newest + 1, newest + 1))
    with readable(shard_folder(out)) as file:
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

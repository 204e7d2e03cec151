"""Every command that computed a part of a result stands in its provenance, also one that was killed."""

import json
import os
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from relnav_sim import open_results, run_campaign
from relnav_sim.results.block import RefusedError, ResultsError
from relnav_sim.runner.merging import merge_results
from relnav_sim.runner.sessions import SESSIONS, end_session, past_sessions, provenance_of
from relnav_sim.runner.shard_folder import HEADER, shard_folder
from relnav_sim.runner.unfinished import results_so_far


def test_a_grown_result_lists_its_sessions_and_sums_their_time(campaign, tmp_path):
    out = tmp_path / "out.h5"
    for runs in (2, 4, 4):
        run_campaign(campaign(f"runs={runs}", "bound=false"), out, backend="sequential")
    with open_results(out) as results:
        provenance = results.provenance
    assert len(provenance.sessions) == 2, "the third call had nothing to compute"
    first, second = provenance.sessions
    assert provenance.wall_time_s == pytest.approx(first.wall_time_s + second.wall_time_s)
    assert datetime.fromisoformat(provenance.started) <= datetime.fromisoformat(first.started)
    assert first.started < first.finished <= second.started < second.finished


def test_a_killed_session_ends_with_its_last_shard(campaign, tmp_path):
    out = tmp_path / "out.h5"
    run_campaign(campaign("bound=false"), out, backend="sequential")
    file = shard_folder(out) / SESSIONS
    (session,) = json.loads(file.read_text())
    file.write_text(json.dumps([{**session, "finished": "", "wall_time_s": 0.0}]))
    (ended,) = past_sessions(shard_folder(out))
    newest = max(path.stat().st_mtime for path in shard_folder(out).glob("*.h5"))
    assert datetime.fromisoformat(ended.finished).timestamp() == pytest.approx(newest, abs=1e-3)
    assert 0 < ended.wall_time_s <= session["wall_time_s"] + 1e-3


def test_going_on_with_runs_of_another_version_is_said(campaign, tmp_path):
    out, said = tmp_path / "out.h5", []
    run_campaign(campaign("runs=2", "bound=false"), out, backend="sequential", say=said.append)
    run_campaign(campaign("runs=4", "bound=false"), out, backend="sequential", say=said.append)
    assert not any("of relnav" in sentence for sentence in said)
    file = shard_folder(out) / SESSIONS
    first, second = json.loads(file.read_text())
    file.write_text(json.dumps([{**first, "relnav": "0.1.0 4bd0d51"}, second]))
    run_campaign(campaign("bound=false"), out, backend="sequential", say=said.append)
    (sentence,) = (sentence for sentence in said if "of relnav" in sentence)
    assert sentence.startswith("warning: some of the finished runs are of relnav 0.1.0, and")


SOUND = {
    "command_line": "relnav",
    "started": "2026-01-02T03:04:05+00:00",
    "finished": "",
    "wall_time_s": 1,
    "relnav": "",
}
NO_HISTORY = {
    "missing": None,
    "empty": "",
    "cut": "[{",
    "binary": "\x00\x01",
    "no list": '{"a": 1}',
    "nothing": "null",
    "numbers": "[1, null]",
    "deep": "[" * 100_000,
    "no key": "[{}]",
    "another key": json.dumps([{**SOUND, "more": 1}]),
    "no moment": json.dumps([{**SOUND, "started": "yesterday"}]),
    "no text": json.dumps([{**SOUND, "command_line": ["relnav"]}]),
    "no zone": json.dumps([{**SOUND, "started": "2026-01-02T03:04:05"}]),
    "no duration": json.dumps([{**SOUND, "wall_time_s": float("nan")}]),
}


@pytest.fixture(scope="module")
def two_runs(make_campaign, tmp_path_factory):
    return run_campaign(
        make_campaign("runs=2", "bound=false"), tmp_path_factory.mktemp("two") / "o.h5", backend="sequential"
    )


def with_history(folder, text):
    (folder / SESSIONS).unlink(missing_ok=True)
    if text is not None:
        (folder / SESSIONS).write_text(text)


@pytest.mark.parametrize("text", NO_HISTORY.values(), ids=NO_HISTORY)
def test_a_damaged_history_is_none(tmp_path, text):
    with_history(tmp_path, text)
    assert past_sessions(tmp_path) == []
    end_session(tmp_path)
    assert past_sessions(tmp_path) == []


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(text, id=name, marks=() if name in ("missing", "no moment") else pytest.mark.slow)
        for name, text in NO_HISTORY.items()
    ],
)
def test_a_damaged_history_does_not_keep_a_campaign_from_going_on(two_runs, campaign, tmp_path, text):
    """Nor from being looked at, merged, or ended by a command whose own entry is gone."""
    out = tmp_path / "o.h5"
    folder = Path(shutil.copytree(shard_folder(two_runs), shard_folder(out)))
    with_history(folder, text)
    end_session(folder)
    with results_so_far(out) as so_far, open_results(so_far) as results:
        assert results.runs == (0, 1)
    merge_results(tmp_path / "merged.h5", [folder])
    run_campaign(campaign("runs=3", "bound=false"), out, backend="sequential")
    assert len(past_sessions(folder)) == 1
    with open_results(out) as results:
        assert results.runs == (0, 1, 2) and results.provenance.wall_time_s < 100


@pytest.mark.parametrize("finished", ["", "2096-01-02T03:04:05+00:00", "2026-01-02T03:04:05+00:00"])
def test_a_session_in_the_future_took_no_lifetime(two_runs, tmp_path, finished):
    """Nor one that was killed, whose shards have a time in the future."""
    folder = Path(shutil.copytree(shard_folder(two_runs), tmp_path / "s"))
    future = {**SOUND, "started": "2095-01-02T03:04:05+00:00", "finished": finished, "wall_time_s": 2e9}
    now = datetime.now(UTC)
    killed = {**SOUND, "started": (now - timedelta(seconds=60)).isoformat(), "wall_time_s": 0.0}
    for shard in folder.glob("*.h5"):
        os.utime(shard, (2**32, 2**32))
    (folder / SESSIONS).write_text(json.dumps([future, killed]))
    provenance = provenance_of(past_sessions(folder))
    assert 60 <= provenance.wall_time_s < 120
    assert datetime.fromisoformat(provenance.finished) <= datetime.now(UTC)


@pytest.mark.parametrize(
    "text",
    [
        "{",
        '{"cases": 3, "runs": "many"}',
        *(pytest.param(text, marks=pytest.mark.slow) for text in ("", "null", "[]", '{"cases": [{}]}')),
    ],
)
def test_a_campaign_goes_on_where_the_folder_does_not_say_whose_it_is(two_runs, campaign, tmp_path, text):
    out = tmp_path / "o.h5"
    folder = Path(shutil.copytree(shard_folder(two_runs), shard_folder(out)))
    (folder / HEADER).write_text(text)
    with pytest.raises(ResultsError, match="keeps the shards"), results_so_far(out):
        pass
    said = []
    run_campaign(campaign("runs=3", "bound=false"), out, backend="sequential", say=said.append)
    assert any("finished blocks found" in sentence for sentence in said)
    with open_results(out) as results, open_results(two_runs) as before:
        assert results.runs == (0, 1, 2)
        np.testing.assert_array_equal(results.statistic(0, "ekf", "rms")[:2], before.statistic(0, "ekf", "rms"))


def test_a_smaller_result_is_said_and_keeps_the_shards(campaign, tmp_path):
    out = tmp_path / "out.h5"
    run_campaign(campaign("filters.wide={kind: kf, r_scale: 4}", "bound=false"), out, backend="sequential")
    shards = sorted(shard_folder(out).glob("*.h5"))
    said = []
    run_campaign(campaign("runs=3", "bound=false"), out, backend="sequential", say=said.append)
    (sentence,) = [s for s in said if "does not ask for" in s]
    assert "runs from 3 on" in sentence and "filter wide of case" in sentence
    assert sorted(shard_folder(out).glob("*.h5")) == shards


def test_a_refused_campaign_leaves_no_folder(campaign, tmp_path):
    out = tmp_path / "out.h5"
    run_campaign(campaign("bound=false"), out, backend="sequential")
    for path in shard_folder(out).iterdir():
        path.unlink()
    shard_folder(out).rmdir()
    with pytest.raises(RefusedError, match="shards are gone"):
        run_campaign(campaign("runs=8"), out, backend="sequential")
    assert not shard_folder(out).exists()

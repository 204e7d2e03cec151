"""Every command that computed a part of a result stands in its provenance, also one that was killed."""

import json
from datetime import datetime

import pytest

from relnav_sim import open_results, run_campaign
from relnav_sim.results.block import RefusedError
from relnav_sim.runner.folder import shard_folder
from relnav_sim.runner.sessions import SESSIONS, past_sessions


def test_a_grown_result_lists_its_sessions_and_sums_their_time(campaign, tmp_path):
    out = tmp_path / "out.h5"
    for runs in (2, 4, 4):
        run_campaign(campaign(f"runs={runs}"), out, backend="sequential")
    with open_results(out) as results:
        provenance = results.provenance
    assert len(provenance.sessions) == 2, "the third call had nothing to compute"
    first, second = provenance.sessions
    assert provenance.wall_time_s == pytest.approx(first.wall_time_s + second.wall_time_s)
    assert datetime.fromisoformat(provenance.started) <= datetime.fromisoformat(first.started)
    assert first.started < first.finished <= second.started < second.finished


def test_a_killed_session_ends_with_its_last_shard(campaign, tmp_path):
    out = tmp_path / "out.h5"
    run_campaign(campaign(), out, backend="sequential")
    file = shard_folder(out) / SESSIONS
    (session,) = json.loads(file.read_text())
    file.write_text(json.dumps([{**session, "finished": "", "wall_time_s": 0.0}]))
    (ended,) = past_sessions(shard_folder(out))
    newest = max(path.stat().st_mtime for path in shard_folder(out).glob("*.h5"))
    assert datetime.fromisoformat(ended.finished).timestamp() == pytest.approx(newest, abs=1e-3)
    assert 0 < ended.wall_time_s <= session["wall_time_s"] + 1e-3


def test_a_damaged_history_does_not_keep_a_campaign_from_going_on(campaign, tmp_path):
    out = tmp_path / "out.h5"
    run_campaign(campaign("runs=2"), out, backend="sequential")
    (shard_folder(out) / SESSIONS).write_text("[{")
    run_campaign(campaign("runs=3"), out, backend="sequential")
    assert len(past_sessions(shard_folder(out))) == 1


def test_a_smaller_result_is_said_and_keeps_the_shards(campaign, tmp_path):
    out = tmp_path / "out.h5"
    run_campaign(campaign("filters.wide={kind: kf, r_scale: 4}"), out, backend="sequential")
    shards = sorted(shard_folder(out).glob("*.h5"))
    said = []
    run_campaign(campaign("runs=3"), out, backend="sequential", say=said.append)
    (sentence,) = [s for s in said if "does not ask for" in s]
    assert "runs from 3 on" in sentence and "filter wide of case" in sentence
    assert sorted(shard_folder(out).glob("*.h5")) == shards


def test_a_refused_campaign_leaves_no_folder(campaign, tmp_path):
    out = tmp_path / "out.h5"
    run_campaign(campaign(), out, backend="sequential")
    for path in shard_folder(out).iterdir():
        path.unlink()
    shard_folder(out).rmdir()
    with pytest.raises(RefusedError, match="shards are gone"):
        run_campaign(campaign("runs=8"), out, backend="sequential")
    assert not shard_folder(out).exists()

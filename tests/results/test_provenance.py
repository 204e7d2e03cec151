"""Where a result came from is told, and never guessed."""

import os
import subprocess
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import pytest

import relnav_sim
from relnav_sim.results import provenance
from relnav_sim.results.provenance import collect_provenance, source_revision


def _git(folder: Path, *words: str) -> None:
    identity = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
    subprocess.run(["git", "-C", str(folder), *identity, *words], check=True, capture_output=True)


def test_revision_of_a_work_tree(tmp_path: Path) -> None:
    package = tmp_path / "package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    assert source_revision(package) == ("", -1)
    _git(tmp_path, "init")
    assert source_revision(package) == ("", -1), "a package inside a work tree that does not track it"
    _git(tmp_path, "add", ".")
    assert source_revision(package) == ("", -1), "no commit yet"
    _git(tmp_path, "commit", "-m", "one")
    commit, dirty = source_revision(package)
    assert len(commit) == 40 and dirty == 0
    # Git would write its index anew, and leave a lock where the disk is full.
    index = tmp_path / ".git" / "index"
    before = index.read_bytes()
    os.utime(package / "__init__.py", (1e9, 1e9))
    assert source_revision(package) == (commit, 0) and index.read_bytes() == before
    (tmp_path / "notes.txt").write_text("outside the package")
    assert source_revision(package) == (commit, 0)
    (package / "__init__.py").write_text("x = 1\n")
    assert source_revision(package) == (commit, 1)


def test_a_process_asks_once_for_its_own_revision(monkeypatch: pytest.MonkeyPatch) -> None:
    when = datetime(2026, 5, 1, tzinfo=UTC)
    provenance._own_revision.cache_clear()
    commit, dirty = source_revision(Path(relnav_sim.__file__).parent)
    first = collect_provenance(when, when, 0.0)
    monkeypatch.setattr(provenance, "source_revision", None)
    again = collect_provenance(when, when, 0.0)
    assert (again.git_commit, again.git_dirty, again.versions) == (first.git_commit, first.git_dirty, first.versions)
    assert (first.git_commit, first.git_dirty) == (commit, dirty)


def test_times_are_utc() -> None:
    start = datetime(2026, 5, 1, 1, 0, tzinfo=timezone(timedelta(hours=2)))
    facts = collect_provenance(start, datetime(2026, 5, 1, 0, 0, tzinfo=UTC), 3600.0, ["relnav", "run", "a.yaml"])
    assert facts.started == "2026-04-30T23:00:00+00:00" and facts.finished == "2026-05-01T00:00:00+00:00"
    assert facts.machine["processor"] and int(facts.machine["cores"]) >= 1

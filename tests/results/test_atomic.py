"""Files that are whole or absent: through links, beside what killed writers left, never in place of a device."""

import fcntl
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from relnav_sim.results.atomic import remove_temporaries, written_whole
from relnav_sim.results.block import RefusedError
from relnav_sim.runner.shard_folder import shard_folder, working_folder


@pytest.mark.parametrize("exists", [True, False])
def test_a_link_is_written_through(tmp_path: Path, exists: bool) -> None:
    (tmp_path / "far").mkdir()
    goal, link, chain = tmp_path / "far" / "goal.h5", tmp_path / "link.h5", tmp_path / "chain.h5"
    link.symlink_to("far/goal.h5")
    chain.symlink_to("link.h5")
    if exists:
        goal.write_text("old")
    with written_whole(chain) as temporary:
        temporary.write_text("new")
    assert goal.read_text() == "new" and chain.is_symlink() and link.is_symlink()
    assert [path.name for path in goal.parent.iterdir()] == ["goal.h5"]


def test_a_link_to_itself_or_into_nowhere_is_an_error_and_stays(tmp_path: Path) -> None:
    (tmp_path / "loop.h5").symlink_to("loop.h5")
    (tmp_path / "lost.h5").symlink_to("nowhere/goal.h5")
    for name in ("loop.h5", "lost.h5"):
        with pytest.raises(OSError, match=r"symbolic links|No such file"), written_whole(tmp_path / name) as temporary:
            temporary.write_text("new")
        assert (tmp_path / name).is_symlink()


@pytest.mark.parametrize("place", ["directory", "device", "lost"])
def test_a_result_has_a_place_before_it_is_computed(tmp_path: Path, place: str) -> None:
    (tmp_path / "directory").mkdir()
    (tmp_path / "lost").symlink_to("nowhere/goal.h5")
    os.mkfifo(tmp_path / "device")
    with (
        pytest.raises(RefusedError, match=r"is a directory|no regular file|does not exist"),
        working_folder(tmp_path / place),
    ):
        pass
    assert not shard_folder(tmp_path / place).exists()


def test_what_a_killed_writer_left_goes_and_what_one_at_work_writes_stays(tmp_path: Path) -> None:
    path = tmp_path / "out[1].h5"
    writer = (
        "import sys, time\nfrom pathlib import Path\nfrom relnav_sim.results.atomic import written_whole\n"
        "with written_whole(Path(sys.argv[1])) as temporary:\n"
        "    temporary.write_text('half')\n    print(flush=True)\n    time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", writer, path], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        remove_temporaries(tmp_path, path.name)
        assert len(list(tmp_path.iterdir())) == 1
        other.send_signal(signal.SIGKILL)
    remove_temporaries(tmp_path, "other.h5")
    assert len(list(tmp_path.iterdir())) == 1
    remove_temporaries(tmp_path, path.name)
    assert not list(tmp_path.iterdir())


def test_the_whole_file_is_not_locked(tmp_path: Path) -> None:
    with written_whole(tmp_path / "out") as temporary:
        temporary.write_text("new")
    with open(tmp_path / "out", "rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)

"""Shards in a journal: whoever is killed while they are packed loses none, and damage costs one shard alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from relnav_sim.results import journal
from relnav_sim.results.block import ResultsError
from relnav_sim.results.pieces import bundle_piece
from relnav_sim.results.shard_files import held_shards, holds_shards, pack, remove
from relnav_sim.results.shards import read_shard

RUNS = 12


@pytest.fixture
def folder(tmp_path, make_block, write):
    write(tmp_path, [make_block(0, [run]) for run in range(RUNS)])
    return tmp_path


def errors(folder: Path) -> dict[int, bytes]:
    """Return the errors of every run that a folder holds, each verified."""
    held, damaged = held_shards(folder)
    assert not damaged
    blocks = [bundle_piece(bundle).load() for bundle in held.values()]
    return {block.runs[0]: block.filters["ekf"].error.tobytes() for block in blocks}


def test_packed_shards_are_the_same_and_leave_one_file(folder: Path) -> None:
    before = errors(folder)
    assert not pack(folder, most_loose=RUNS) and pack(folder, most_loose=3)
    assert [path.name for path in folder.iterdir()] == [journal.JOURNAL]
    assert errors(folder) == before and len(before) == RUNS and holds_shards(folder)


def test_a_torn_end_is_cut_off_by_the_next_to_pack(folder: Path, make_block, write) -> None:
    kept = {path.name: path.read_bytes() for path in folder.glob("*.h5")}
    pack(folder, 0)
    path = folder / journal.JOURNAL
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    for cut in [1, 7, *rng.integers(8, len(whole) // 2, 6).tolist()]:
        path.write_bytes(whole[:-cut])
        left = errors(folder)
        assert len(left) < RUNS and left.items() <= {**left}.items()
        for name, content in kept.items():
            (folder / name).write_bytes(content)
        pack(folder, 0)
        assert len(errors(folder)) == RUNS, "what was torn is packed again from its file"


def test_a_damaged_frame_costs_itself_alone(folder: Path) -> None:
    pack(folder, 0)
    path = folder / journal.JOURNAL
    whole = path.read_bytes()
    for place in np.linspace(0, len(whole) - 9, 40).astype(int).tolist():
        damaged = bytearray(whole)
        damaged[place] ^= 0x40
        path.write_bytes(damaged)
        held, _ = held_shards(folder)
        sound = 0
        for bundle in held.values():
            try:
                bundle_piece(bundle).load()
                sound += 1
            except ResultsError as error:
                assert "checksum" in str(error)
        assert sound >= RUNS - 1


def test_removing_a_shard_leaves_the_others(folder: Path) -> None:
    loose = sorted(folder.glob("*.h5"))
    pack(folder, 0)
    remove(folder, [loose[3].name])
    assert set(errors(folder)) == set(range(RUNS)) - {3}
    with pytest.raises(ResultsError, match="no such file"):
        read_shard(loose[3])


def test_only_what_is_asked_for_is_read(folder: Path, monkeypatch) -> None:
    pack(folder, 0)
    monkeypatch.setattr(journal, "_load", lambda *arguments: pytest.fail("a look at the heads reads no numbers"))
    assert len(held_shards(folder)[0]) == RUNS


@pytest.mark.slow
def test_killed_at_any_moment_while_packing(folder: Path) -> None:
    before = errors(folder)
    kept = {path.name: path.read_bytes() for path in folder.glob("*.h5")}
    code = "import sys, pathlib; from relnav_sim.results.shard_files import pack; print('go', flush=True)\n"
    code += "pack(pathlib.Path(sys.argv[1]), 0)"
    rng = np.random.default_rng(3)
    for _ in range(15):
        with subprocess.Popen([sys.executable, "-c", code, str(folder)], stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None and process.stdout.readline() == "go\n"
            time.sleep(rng.uniform(0, 0.05))
            os.kill(process.pid, signal.SIGKILL)
        assert errors(folder) == before
        for name, content in kept.items():
            (folder / name).write_bytes(content)

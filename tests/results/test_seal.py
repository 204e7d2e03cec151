"""Damage of a results file is noticed wherever it is; a file that is only in use is not called damaged."""

from __future__ import annotations

import fcntl
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from typer.testing import CliRunner
from whole_result import everything

from relnav_sim.cli.app import app
from relnav_sim.results import seal
from relnav_sim.results.block import ResultsError, UnavailableError
from relnav_sim.results.read import open_results
from relnav_sim.runner.merging import merge_results

FLIPS, CUTS = 120, 40


def test_flipped_bytes_and_cuts_are_detected_anywhere(result: Path, tmp_path: Path) -> None:
    """One changed byte, anywhere or in the seal itself, or a cut: an error, or else the very same values."""
    data, whole = result.read_bytes(), everything(result)
    rng = np.random.default_rng(20261128)
    path = tmp_path / "damaged.h5"
    places = np.concatenate([rng.integers(len(data), size=FLIPS), len(data) - rng.integers(1, 90, size=FLIPS // 4)])
    changes = [(int(place), int(rng.integers(1, 256))) for place in places]
    lengths = [*map(int, rng.integers(1, len(data), size=CUTS)), *(len(data) - n for n in (1, 30, 79, 80, 81))]
    spoilt = [data[:i] + bytes([data[i] ^ bits]) + data[i + 1 :] for i, bits in changes]
    detected = 0
    for content in [*spoilt, *(data[:length] for length in lengths), data + b"\n"]:
        path.write_bytes(content)
        try:
            assert everything(path) == whole
        except ResultsError:
            detected += 1
    assert detected == len(spoilt) + len(lengths) + 1


def test_every_command_refuses_a_damaged_file(result: Path, tmp_path: Path) -> None:
    data = bytearray(result.read_bytes())
    with h5py.File(result, "r") as file:
        data[file["case_000/ekf/rms"].id.get_offset() + 6] ^= 0x10
    path = tmp_path / "damaged.h5"
    path.write_bytes(data)
    for command in (
        ["inspect", path],
        ["inspect", result, path],
        ["report", path],
        ["compare", path, result],
        ["export", path],
        ["merge", tmp_path / "merged.h5", path],
    ):
        done = CliRunner().invoke(app, [str(word) for word in command])
        assert done.exit_code == 3, command
        assert "checksum does not match" in done.output and "Traceback" not in done.output
    assert not (tmp_path / "merged.h5").exists()


def test_other_readers_see_no_seal(result: Path) -> None:
    for engine in ("h5netcdf", "netcdf4"):
        with open_results(result) as ours, xarray.open_dataset(result, group="case_000/ekf", engine=engine) as theirs:
            np.testing.assert_array_equal(theirs["rms"], ours.statistic(0, "ekf", "rms"))


def test_an_old_result_is_read_with_a_note(old_result: Path, result: Path, tmp_path: Path) -> None:
    assert everything(old_result) == everything(result)
    with open_results(old_result) as old, open_results(result) as new:
        assert not old.sealed and new.sealed
    assert "written before 0.1.1" in CliRunner().invoke(app, ["inspect", str(old_result)]).output
    assert "agrees with every byte" in CliRunner().invoke(app, ["inspect", str(result)]).output
    assert everything(merge_results(tmp_path / "merged.h5", [old_result]))[0] == everything(result)[0]


def test_a_change_by_another_program_is_noticed(result: Path, tmp_path: Path) -> None:
    path = tmp_path / "changed.h5"
    path.write_bytes(result.read_bytes())
    with h5py.File(path, "r+") as file:
        file["case_000/ekf/rms"][0] = 0.0
    with pytest.raises(ResultsError, match="another program has changed it"):
        open_results(path)


def test_a_file_in_use_is_not_called_damaged(result: Path, tmp_path: Path) -> None:
    path = tmp_path / "used.h5"
    path.write_bytes(result.read_bytes())
    holder = "import sys, h5py\nfile = h5py.File(sys.argv[1], 'r+')\nprint(flush=True)\nsys.stdin.read()"
    with subprocess.Popen([sys.executable, "-c", holder, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        with pytest.raises(UnavailableError, match="is in use"):
            open_results(path)
        other.communicate()
    path.write_bytes(result.read_bytes())
    with open(path, "rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH)
        open_results(path).close()
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = CliRunner().invoke(app, ["inspect", str(path)])
    assert done.exit_code == 3 and "is in use" in done.output and "damaged" not in done.output


def test_what_is_no_file_has_its_own_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "empty.h5").touch()
    (tmp_path / "text.h5").write_text("no HDF5")
    (tmp_path / "folder.h5").mkdir()
    (tmp_path / "loop.h5").symlink_to("loop.h5")
    words = {
        "empty": "is empty",
        "text": "no HDF5 file, or a damaged one$",
        "folder": "is a directory",
        "none": "no such file",
    }
    for name, sentence in words.items():
        with pytest.raises(ResultsError, match=sentence):
            open_results(tmp_path / f"{name}.h5")
    with pytest.raises(ResultsError, match="no such file"):
        open_results(tmp_path / "loop.h5")

    def refused(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("builtins.open", refused)
    with pytest.raises(UnavailableError, match="can't be opened: Permission denied"):
        open_results(tmp_path / "text.h5")


def test_a_seal_is_the_digest_of_what_is_before_it(result: Path, tmp_path: Path) -> None:
    """As ``head -c -80 FILE | sha256sum`` computes it."""
    data = result.read_bytes()
    (tmp_path / "before").write_bytes(data[:-80])
    done = subprocess.run(["sha256sum", tmp_path / "before"], capture_output=True, check=True)
    assert data[-80:] == b"\nrelnav sha256 " + done.stdout[:64] + b"\n"
    with h5py.File(result, "r") as file:
        assert file.attrs[seal.ATTRIBUTE] == seal.NOTICE

"""Kernels shared out between two processes."""

import fcntl
import subprocess
import sys

import pytest

from relnav_sim.kernels import code_folder, shares


def with_sizes(monkeypatch, sizes):
    monkeypatch.setattr(shares, "_with_its_parts", lambda name: sizes[name])


def test_what_has_much_in_common_goes_together(monkeypatch):
    sizes = {
        "a.large": {"a": 50, "common": 40},
        "b.large": {"b": 45, "shared": 40},
        "b.other": {"b2": 10, "shared": 40},
        "a.other": {"a2": 10, "common": 40},
    }
    with_sizes(monkeypatch, sizes)
    assert shares.shares(list(sizes)) == (["a.large", "a.other"], ["b.large", "b.other"])


@pytest.mark.parametrize("sizes", [[], [5], [5, 5], [9, *[1] * 9], list(range(1, 30))])
def test_all_are_shared_out_in_halves(monkeypatch, sizes):
    with_sizes(monkeypatch, {f"theme.{n}": {n: size} for n, size in enumerate(sizes)})
    names = [f"theme.{n}" for n in range(len(sizes))]
    first, rest = shares.shares(names)
    assert sorted([*first, *rest]) == sorted(names)
    first_size, rest_size = (sum(sizes[names.index(name)] for name in half) for half in (first, rest))
    assert abs(first_size - rest_size) <= max(sizes, default=0)  # the last that was given away makes the difference


PARTS = """
import sys
from relnav_sim.kernels import linearised_step, point_step, shares
from relnav_sim.kernels.code_folder import kernel_names
found = {name: shares._with_its_parts(name) for name in kernel_names()}
assert all(sum(sizes.values()) > 0 for sizes in found.values())
print(*(step.update in found[f"epochs.{name}"] for name in ("filtered", "filtered_by_points")
        for step in (linearised_step, point_step)), "numba" in sys.modules)
"""


def test_parts_are_those_that_a_kernel_calls_by_its_own_names():
    told = subprocess.run([sys.executable, "-c", PARTS], capture_output=True, text=True, check=True).stdout
    assert told.split() == ["True", "False", "False", "True", "False"]


def test_who_is_compiling_is_told_by_a_lock(tmp_path, monkeypatch):
    monkeypatch.setattr(code_folder, "code_folder", lambda: tmp_path)
    assert not code_folder.is_being_compiled("kalman.update")
    with (tmp_path / "kalman.update.lock").open("ab") as lock:
        assert not code_folder.is_being_compiled("kalman.update")
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert code_folder.is_being_compiled("kalman.update")
    assert not code_folder.is_being_compiled("kalman.update")

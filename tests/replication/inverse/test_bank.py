from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relnav_sim.cli.failures import UserError
from replication.inverse import bank

QUIET: Callable[[str], None] = lambda line: None  # noqa: E731


def test_an_interrupted_bank_has_the_same_numbers(linear: Any, tmp_path: Path) -> None:
    whole = bank.fill(linear, tmp_path / "whole", 500, 3, 1, QUIET)
    bank.fill(linear, tmp_path / "halved", 200, 3, 1, QUIET)
    (tmp_path / "halved" / "block_0000000.npz").unlink()
    (tmp_path / "halved" / "0000300.77.npz").write_bytes(b"half a block")  # of a process that was killed
    again = bank.fill(linear, tmp_path / "halved", 500, 3, 1, QUIET)
    np.testing.assert_array_equal(whole.numbers, again.numbers)
    np.testing.assert_array_equal(whole.u, again.u)
    assert whole.digest == again.digest


def test_a_settings_number_depends_on_nothing_else(linear: Any) -> None:
    np.testing.assert_array_equal(bank.settings(linear, 3, 40, 5), bank.settings(linear, 3, 0, 100)[40:45])
    assert not np.array_equal(bank.settings(linear, 3, 0, 5), bank.settings(linear, 4, 0, 5))


def test_a_bank_of_another_seed_is_left_alone(linear: Any, tmp_path: Path) -> None:
    bank.fill(linear, tmp_path, 100, 3, 1, QUIET)
    with pytest.raises(UserError, match="another seed"):
        bank.fill(linear, tmp_path, 100, 4, 1, QUIET)


def test_no_bank_says_how_to_make_one(linear: Any, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"replication\.inverse bank linear"):
        bank.read(linear, tmp_path)


@pytest.mark.slow
def test_workers_make_the_same_bank(tmp_path: Path) -> None:
    from replication.inverse.alpha_kf import AlphaKf

    one = bank.fill(AlphaKf(), tmp_path / "one", 300, 3, 1, QUIET)
    two = bank.fill(AlphaKf(), tmp_path / "two", 300, 3, 2, QUIET)
    assert one.digest == two.digest

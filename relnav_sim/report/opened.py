"""An opened result on its way to other processes, each of which opens the file once for all that it makes of it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


class Opened:
    """An opened result; pickled it is a path, and what that holds in the other process stays open until it ends.

    Opening a file compares all of its bytes with its checksum.
    """

    def __init__(self, results: Results) -> None:
        self.results = results

    def __reduce__(self) -> tuple[Callable[[Path], Opened], tuple[Any, ...]]:
        return _opened_once, (self.results.path,)


@functools.cache
def _opened_once(path: Path) -> Opened:
    from relnav_sim.results.read import open_results

    return Opened(open_results(path))

"""What a folder of shards holds: shards and bounds, each in a file of its own or in the folder's journal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from relnav_sim.results import journal, layout
from relnav_sim.results.block import ResultsError
from relnav_sim.results.bound import SUFFIX as BOUND
from relnav_sim.results.bound import open_bound
from relnav_sim.results.bundle import Arrays, Bundle, stored_texts
from relnav_sim.results.shards import SUFFIX as SHARD
from relnav_sim.results.shards import open_shard

MOST_LOOSE = 256
"""Files of their own that a folder may hold; where there are more, the small ones go into the journal."""
LARGEST_PACKED = 4 << 20
"""Bytes of the largest shard that a journal takes; of larger ones there are never too many for a folder."""


def holds_shards(folder: Path) -> bool:
    """Return whether a folder holds any shard, sound or not."""
    return any(folder.glob(f"*{SHARD}")) or any(name.endswith(SHARD) for name in journal.names(folder))


def is_packed(folder: Path) -> bool:
    """Return whether a folder has a journal, as it has once there were very many files."""
    return (folder / journal.JOURNAL).exists()


def newest_shard_s(folder: Path) -> float:
    """Return when the newest shard of a folder was written, seconds since 1970; 0: there is none."""
    files = [*folder.glob(f"*{SHARD}"), *folder.glob(journal.JOURNAL)]
    return max((path.stat().st_mtime for path in files), default=0.0)


def names_of(folder: Path) -> set[str]:
    """Return the names of the shards and bounds of a folder, sound or not."""
    loose = {path.name for suffix in (SHARD, BOUND) for path in folder.glob(f"*{suffix}")}
    return loose | journal.names(folder)


def held_shards(folder: Path) -> tuple[dict[str, Bundle], dict[str, ResultsError]]:
    """Return the shards of a folder by name, and of those that can't be opened why."""
    return _held(folder, SHARD)


def held_bounds(folder: Path) -> tuple[dict[str, Bundle], dict[str, ResultsError]]:
    """Return the bounds of a folder by name, and of those that can't be opened why."""
    return _held(folder, BOUND)


def _held(folder: Path, suffix: str) -> tuple[dict[str, Bundle], dict[str, ResultsError]]:
    found = journal.bundles(folder, suffix)
    damaged: dict[str, ResultsError] = {}
    opened = open_shard if suffix == SHARD else open_bound
    for path in folder.glob(f"*{suffix}"):
        try:
            found[path.name] = _wherever(folder, opened(path))
        except ResultsError as error:
            if not path.exists():  # taken over by the journal meanwhile
                found |= journal.bundles(folder, path.name)
            elif path.name not in found:
                damaged[path.name] = error
    return dict(sorted(found.items())), damaged


def _wherever(folder: Path, bundle: Bundle) -> Bundle:
    """Return a bundle of a file of its own that is read from the journal if that has taken it over meanwhile."""

    def load() -> Arrays:
        try:
            return bundle.load()
        except ResultsError:
            if bundle.path.exists() or (packed := journal.bundles(folder, bundle.name).get(bundle.name)) is None:
                raise
            return packed.load()

    return replace(bundle, load=load)


def remove(folder: Path, names: Iterable[str]) -> None:
    """Remove shards or bounds, wherever they lie.

    Raises:
        OSError: A file can't be removed or written.
    """
    names = list(names)
    for name in names:
        (folder / name).unlink(missing_ok=True)
    if not set(names).isdisjoint(journal.names(folder)):
        journal.drop(folder, names)


def pack(folder: Path, most_loose: int = MOST_LOOSE) -> bool:
    """Move small shards and bounds into the journal where there are more than so many files; return whether it did.

    Raises:
        OSError: The journal can't be written.
    """
    small = [
        path for suffix in (SHARD, BOUND) for path in folder.glob(f"*{suffix}") if path.stat().st_size <= LARGEST_PACKED
    ]
    if len(small) <= most_loose:
        return False
    journal.take_over(folder, sorted(small), _taken)
    return True


def _taken(path: Path) -> tuple[dict[str, str], bytes] | None:
    return stored_texts(path, layout.SHARD_FORMAT if path.suffix == SHARD else layout.BOUND_FORMAT)

"""A list of things that are too large for memory: in memory while they are few, else in a temporary file."""

from __future__ import annotations

import pickle
import tempfile
import weakref
from typing import Generic, TypeVar

T = TypeVar("T")

IN_MEMORY_BYTES = 64 << 20


class Spill(Generic[T]):
    """A list that can be added to and read in any order.

    The file has no name and goes with the process, however that ends. It lies where `tempfile` puts it: TMPDIR says.
    """

    def __init__(self) -> None:
        self._file = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY_BYTES)  # noqa: SIM115  # closed below
        weakref.finalize(self, self._file.close)
        self._places: list[tuple[int, int]] = []

    def append(self, thing: T) -> None:
        """Add a thing.

        Raises:
            MemoryError: There is no room for the file. As with memory, the machine is to blame and no filter.
        """
        data = pickle.dumps(thing, protocol=pickle.HIGHEST_PROTOCOL)
        begin = sum(self._places[-1]) if self._places else 0
        try:
            self._file.seek(begin)
            self._file.write(data)
            self._file.flush()
        except OSError as error:
            raise MemoryError(f"no room for temporary files in {tempfile.gettempdir()}: {error}") from error
        self._places.append((begin, len(data)))

    def __len__(self) -> int:
        """Return how many things there are."""
        return len(self._places)

    def __getitem__(self, place: int) -> T:
        """Return a thing."""
        begin, length = self._places[place]
        self._file.seek(begin)
        thing: T = pickle.loads(self._file.read(length))  # what `append` has written
        return thing


class Reversed(Generic[T]):
    """A spilled list from its end: what was added last comes first."""

    def __init__(self, spill: Spill[T]) -> None:
        self._spill = spill

    def __getitem__(self, place: int) -> T:
        """Return a thing, counted from the end."""
        return self._spill[len(self._spill) - 1 - place]

"""A file to write HDF5 into that keeps errors to itself until HDF5 is done.

HDF5 (1.14, 2.0) crashes the process when it closes a file whose last writes have failed, on a full disk say. Here it
never learns of a failure; the one who opened the file does.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer


class PatientFile(io.RawIOBase):
    """The methods that h5py's driver for Python files calls, over an unbuffered file."""

    def __init__(self, raw: io.FileIO) -> None:
        super().__init__()
        self._raw = raw
        self._error: BaseException | None = None

    def raise_error(self) -> None:
        """Raise the first error that was kept, if there was one."""
        if self._error is not None:
            raise self._error

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to a position."""
        return self._raw.seek(offset, whence)

    def tell(self) -> int:
        """Return the position."""
        return self._raw.tell()

    def readinto(self, buffer: WriteableBuffer) -> int:
        """Read into the buffer."""
        return self._raw.readinto(buffer) or 0

    def write(self, data: ReadableBuffer) -> int:
        """Write all of the data, unless something has gone wrong before."""
        rest = memoryview(data).cast("B")
        try:
            while self._error is None and len(rest):
                rest = rest[self._raw.write(rest) :]
        except BaseException as error:  # an interruption in here would be a failed write to HDF5 as well
            self._error = error
        return memoryview(data).nbytes

    def truncate(self, size: int | None = None) -> int:
        """Set the length."""
        try:
            if self._error is None:
                self._raw.truncate(size)
        except BaseException as error:
            self._error = error
        return size if size is not None else self.tell()

    def flush(self) -> None:
        """Do nothing: the file is not buffered."""

"""A digest behind the last byte of a results file, over every byte before it: damage is noticed wherever it is.

Checksums inside HDF5 leave out attributes, contiguous data and much of the metadata. Readers of HDF5 stop at the end
that the file's own header states, so that nothing they see changes.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

from relnav_sim.results.block import ResultsError

ATTRIBUTE = "file_checksum"
NOTICE = "SHA-256 of all bytes before it, at the end of the file"
"""What a sealed file says of itself in the attribute of the above name: without it a cut seal would not be missed."""

NO_SEAL = "no checksums: written before 0.1.1, so that damage can't be seen"
"""What is said of a results file without one."""

_MARK = b"\nrelnav sha256 "
_LENGTH = len(_MARK) + 2 * hashlib.sha256().digest_size + 1
_PIECE = 1 << 20


def seal(path: Path) -> None:
    """Write the digest of a finished file behind its end.

    Raises:
        OSError: The file can't be read or written.
    """
    with open(path, "r+b") as file:
        digest = _digest(file, file.seek(0, os.SEEK_END))
        file.seek(0, os.SEEK_END)
        file.write(_MARK + digest + b"\n")


def verify(file: BinaryIO, path: Path) -> bool:
    """Compare a file with the digest at its end; return whether it has one.

    Raises:
        ResultsError: They differ.
        OSError: The file can't be read.
    """
    length = file.seek(0, os.SEEK_END) - _LENGTH
    file.seek(max(length, 0))
    found = file.read()
    if length < 0 or not found.startswith(_MARK):
        return False
    if found != _MARK + _digest(file, length) + b"\n":
        raise damaged(path)
    return True


def damaged(path: Path) -> ResultsError:
    """Return the error of a file that differs from what was written."""
    return ResultsError(
        f"{path}: its checksum does not match: the file is damaged, or another program has changed it; the relnav run "
        "that wrote it writes it again from its shards"
    )


def _digest(file: BinaryIO, length: int) -> bytes:
    """Return the digest of the first bytes in hexadecimal digits."""
    digest = hashlib.sha256()
    file.seek(0)
    while length > 0 and (piece := file.read(min(_PIECE, length))):
        digest.update(piece)
        length -= len(piece)
    return digest.hexdigest().encode()

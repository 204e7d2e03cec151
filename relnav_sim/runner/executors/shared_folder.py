"""Whether a worker sees the folder of shards: a token that the campaign's process has left there tells it."""

from __future__ import annotations

import secrets
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from relnav_sim.results.atomic import written_whole


@dataclass(frozen=True)
class Token:
    """A file that only the campaign's process can have written.

    Attributes:
        folder: Its folder.
        name: Its name; left behind, it is removed as other temporary files are.
        secret: What it says.
    """

    folder: str
    name: str
    secret: str

    @property
    def path(self) -> Path:
        """The file."""
        return Path(self.folder) / self.name


def leave_token(folder: Path) -> Token:
    """Write a token into a folder.

    Raises:
        OSError: It can't be written.
    """
    token = Token(str(folder), f".shared.{secrets.token_hex(8)}.tmp", secrets.token_hex(16))
    token.path.write_text(token.secret, encoding="ascii")
    return token


def put(file: Path, token: Token) -> bool:
    """Copy a file into the folder of a token, if the token is there; return whether it was done."""
    with suppress(OSError, ValueError):
        if token.path.read_text(encoding="ascii") == token.secret:
            with written_whole(Path(token.folder) / file.name) as temporary:
                shutil.copyfile(file, temporary)
            return True
    return False

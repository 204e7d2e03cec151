"""Files that a campaign names: where they are, and that they are still what they were."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from pydantic import ValidationInfo


def in_campaign(info: ValidationInfo) -> bool:
    """Return whether a campaign's file is being read, and not what was validated before."""
    return isinstance(info.context, dict) and "folder" in info.context


def file_to_read(content_key: str, content: object, info: ValidationInfo) -> str | None:
    """Return the file that the content is in; None where the content itself stands there.

    A campaign gives one of the two. What was validated before has both: the content then counts.

    Args:
        content_key: Name of the key that holds the content; the file's is `file`.
        content: The content, None where it is in the file.
        info: Of the content's validator.

    Raises:
        ValueError: Both are given, or neither.
    """
    file: str | None = info.data.get("file")
    validated_before = not in_campaign(info) and file is not None
    if (file is None) == (content is None) and not validated_before:
        raise ValueError(f"give exactly one of file and {content_key}")
    return file if content is None else None


def located(name: str, info: ValidationInfo) -> Path:
    """Return the path of a file that a campaign names: relative to the campaign's own file."""
    context: dict[str, Any] = info.context or {}
    return (Path(context.get("folder", "")) / name).absolute()


def text_of(name: str, info: ValidationInfo) -> str:
    """Return the text of a file that a campaign names.

    Raises:
        ValueError: It can't be read.
    """
    return content_of(located(name, info)).decode("utf-8", errors="replace")


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file's content, 64 hexadecimal digits.

    Raises:
        ValueError: It can't be read.
    """
    return hashlib.sha256(content_of(path)).hexdigest()


def content_of(path: Path) -> bytes:
    """Return a file's content.

    Raises:
        ValueError: It can't be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from None

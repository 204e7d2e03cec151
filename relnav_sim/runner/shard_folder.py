"""The folder of shards beside a results file: whose it is, and that one campaign at a time works in it."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from relnav_sim.results.atomic import remove_temporaries, target, written_whole
from relnav_sim.results.block import RefusedError, ResultsError
from relnav_sim.results.campaign_header import CaseHeader, ResultHeader
from relnav_sim.results.changes import changed_keys
from relnav_sim.results.header import read_channels
from relnav_sim.results.read import open_results
from relnav_sim.results.shard_files import holds_shards
from relnav_sim.results.sound import odd_header
from relnav_sim.wording import first_of

HEADER = "campaign.json"
START_OVER = "give another --out, or --fresh to move it aside and start over"
"""What `relnav run` offers where it refuses."""


def shard_folder(out: Path) -> Path:
    """Return where the shards of a results file are kept."""
    return out.with_name(f"{out.name}.shards")


@contextmanager
def working_folder(out: Path) -> Iterator[Path]:
    """Give the folder of shards for this process alone; leftovers of killed processes in it are removed.

    Raises:
        RefusedError: Another process is at work on the same result, or what stands at its place is no file.
        OSError: The folder can't be made or written.
    """
    folder = shard_folder(out).absolute()  # filters may go to another folder
    _check_place(out)
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RefusedError(f"another relnav is at work on {out}; wait for its end, or give another --out") from None
        except OSError:
            pass  # Some network file systems can't lock; the user then sees to it.
        _tidy(out, folder)
        try:
            yield folder
        finally:
            _tidy(out, folder)
            _remove_empty(folder)
    finally:
        with suppress(OSError):  # a filter in this process may have closed whatever was open
            os.close(handle)


def _check_place(out: Path) -> None:
    """Refuse a place where the result could not be written in the end."""
    if out.exists() and not out.is_file():
        raise RefusedError(f"{out} is {'a directory' if out.is_dir() else 'no regular file'}; give --out a file's name")
    if out.is_symlink() and not target(out).parent.is_dir():
        raise RefusedError(f"{out} is a link to {target(out)}, in a folder that does not exist; make it, or give --out")


def _tidy(out: Path, folder: Path) -> None:
    """Remove what processes that were stopped in the middle of a block have left; none is at work any more."""
    remove_temporaries(folder)
    remove_temporaries(target(out).parent, target(out).name)
    for marker in folder.glob("*.busy"):
        marker.unlink(missing_ok=True)


def _remove_empty(folder: Path) -> None:
    """Remove the folder if nothing came of it, as when a campaign was refused."""
    with suppress(OSError):  # it holds something
        folder.rmdir()


def move_aside(out: Path, say: Callable[[str], None]) -> None:
    """Rename a results file and its shards, so that the campaign starts over and nothing is lost."""
    folder = shard_folder(out)
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")
    if folder.exists():
        with working_folder(out):
            pass  # nobody else is at work there
    for path in (out, folder):
        if path.exists():
            aside = path.with_name(f"{path.name}.before-{stamp}")
            path.rename(aside)
            say(f"moved {path} to {aside}")


def check_same_campaign(out: Path, header: ResultHeader, remedy: str = START_OVER) -> None:
    """Refuse to add to results of other settings.

    Args:
        out: The results file; it need not exist.
        header: What its campaign would be.
        remedy: What the refusal tells the user to do.

    Raises:
        RefusedError: With the keys that differ.
        ResultsError: What stands there is damaged.
    """
    stored = _stored_header(out)
    if stored is None:
        return
    if changed := changed_keys(stored, header.content):
        raise RefusedError(f"{out} holds results of other settings ({first_of(changed)}); {remedy}")
    folder = shard_folder(out)
    if out.exists() and not holds_shards(folder):
        # Computing everything again would replace a whole result by a part of it if that is interrupted.
        with open_results(out) as results:
            if results.runs:
                raise RefusedError(f"{out} can't grow, its shards are gone from {folder}; {remedy}")


def _stored_header(out: Path) -> dict[str, Any] | None:
    folder = shard_folder(out)
    with suppress(ResultsError):  # missing or damaged: every shard says itself what it is of
        return dict(read_folder_header(folder).content)
    if out.exists():
        try:
            with open_results(out) as results:
                return results.campaign_content
        except ResultsError:
            if not holds_shards(folder):
                raise  # whatever it is, nothing could write it again
    return None


def write_folder_header(folder: Path, header: ResultHeader) -> None:
    """Write whose shards a folder holds."""
    with written_whole(folder / HEADER) as temporary:
        temporary.write_text(json.dumps(asdict(header)), encoding="utf-8")


def read_folder_header(folder: Path) -> ResultHeader:
    """Return whose shards a folder holds.

    Raises:
        ResultsError: The folder does not say, or what it says is damaged.
    """
    file = folder / HEADER
    try:
        stored = json.loads(file.read_text(encoding="utf-8"))
        cases = tuple(_read_case(case) for case in stored.pop("cases"))
        header = ResultHeader(**stored, cases=cases)
        if odd := odd_header(header):
            raise ValueError(odd)
        return header
    except FileNotFoundError:
        raise ResultsError(f"{folder} is no folder of shards: it has no {HEADER}") from None
    except (AttributeError, KeyError, RecursionError, TypeError, ValueError):
        raise ResultsError(f"{file} is damaged; the same relnav run writes it again and keeps the shards") from None


def _read_case(stored: Mapping[str, Any]) -> CaseHeader:
    channels = read_channels(stored.get("channels", {}))
    return CaseHeader(**{**stored, "filters": tuple(stored["filters"]), "channels": channels})

"""What one file of measurements holds, before files are put together."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from relnav_sim.astro.epoch import Epoch
from relnav_sim.recorded.readings import Column, Start

LINE_ENDS = re.compile(r"\r\n|\n|\r")
"""Ends of lines, of Unix, Windows and what came before; no other character that Python takes for one."""


@dataclass(frozen=True)
class Recording:
    """What one file holds.

    Attributes:
        file: The file, as the user named it.
        columns: Its channels.
        run: The run that it says it is of; None: it says nothing.
        epoch: The instant of its 0 s; None: it says nothing.
        start: Where the filters start; None: it says nothing.
        notes: What the user should know: sentences.
    """

    file: str
    columns: tuple[Column, ...]
    run: int | None
    epoch: Epoch | None
    start: Start | None
    notes: tuple[str, ...] = field(default=())

"""The machines that have computed a campaign's blocks, a line for each block beside the shards: bits depend on them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from relnav_sim.results.shard_files import names_of

MACHINES = "machines.jsonl"


def note_machine(shard: Path, host: str, processor: str) -> None:
    """Note which machine has computed a block.

    Args:
        shard: The block's file.
        host: Name of the machine.
        processor: Name of its processor.
    """
    line = json.dumps({"file": shard.name, "host": host, "processor": processor})
    with suppress(OSError), open(shard.parent / MACHINES, "a", encoding="utf-8") as file:
        file.write(f"{line}\n")


def machines_of(folder: Path) -> Mapping[str, int]:
    """Return how many blocks of a folder each machine has computed, by name and processor, as far as it is known."""
    last: dict[str, str] = {}
    held = names_of(folder)
    with suppress(OSError):
        for line in (folder / MACHINES).read_text(encoding="utf-8", errors="replace").splitlines():
            with suppress(ValueError, KeyError, TypeError):
                told = json.loads(line)
                if told["file"] in held:
                    last[str(told["file"])] = f"{told['host']} ({told['processor']})"
    return {machine: list(last.values()).count(machine) for machine in sorted(set(last.values()))}

"""The results file: its layout, the shards it is merged from, reading and export.

`open_results` and `Results` load on first use, so that code which only needs names and shapes does not pay
for HDF5.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relnav_sim.results.read import Results, open_results

__all__ = ["Results", "open_results"]


def __getattr__(name: str) -> Any:
    """Import the reader on its first use."""
    if name not in __all__:
        raise AttributeError(f"module 'relnav_sim.results' has no attribute {name!r}")
    from relnav_sim.results import read

    return getattr(read, name)

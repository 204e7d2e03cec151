"""All that a results file says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from relnav_sim.results.read import open_results


def everything(path: Path) -> list[Any]:
    """Return all that a results file says, fit to be compared."""
    with open_results(path) as results:
        found: list[Any] = [results.header, results.provenance, results.failures(), results.missing()]
        columns = results.summary()
        found += [
            (name, column.tolist() if column.dtype == object else column.tobytes()) for name, column in columns.items()
        ]
        for case, header in enumerate(results.headers):
            found += [results.truth(case).tobytes(), results.time_s(case).tobytes(), repr(results.bound(case))]
            for name in header.filters:
                found += [getattr(results, of)(case, name).tobytes() for of in ("error", "sigma", "nis", "nees")]
                found += [results.distance(case, name).tobytes()]
                found += [repr(results.augmented(case, name)), repr(results.bound(case, name))]
        return found

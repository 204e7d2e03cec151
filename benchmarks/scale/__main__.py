"""Measure and write docs/clusters.md: `make scale`.

python -m scale [AXIS...] [--most N] [--longest S] [--no-docs]
"""

from __future__ import annotations

import argparse

from scale.campaigns import AXES
from scale.measure import timings
from scale.tables import keep, write_page


def main() -> None:
    """Measure along the axes that are asked for, all by default."""
    parser = argparse.ArgumentParser(prog="scale")
    parser.add_argument("axes", nargs="*", metavar="AXIS", help=", ".join(AXES))
    parser.add_argument("--most", type=int, default=10**9, help="largest size that is measured")
    parser.add_argument("--longest", type=float, default=3600.0, help="seconds that a command may take")
    parser.add_argument("--no-docs", action="store_true", help="keep the timings only")
    given = parser.parse_args()
    for axis in given.axes or AXES:
        found = []
        for timing in timings(axis, given.most, given.longest):
            print(timing, flush=True)
            found.append(timing)
        keep(found)
    if not given.no_docs:
        write_page()


if __name__ == "__main__":
    main()

"""Measure and write docs/clusters.md: `make scale`.

python -m scale [AXIS...] [--most N] [--longest S] [--again] [--no-docs]

Timings are kept after each size, and sizes that are known are not measured again: an interrupted measurement goes on.
"""

from __future__ import annotations

import argparse

from scale.campaigns import AXES
from scale.measure import timings
from scale.tables import keep, known, write_page


def main() -> None:
    """Measure along the axes that are asked for, all by default."""
    parser = argparse.ArgumentParser(prog="scale")
    parser.add_argument("axes", nargs="*", metavar="AXIS", help=", ".join(AXES))
    parser.add_argument("--most", type=int, default=10**9, help="largest size that is measured")
    parser.add_argument("--longest", type=float, default=3600.0, help="seconds that a command may take")
    parser.add_argument("--again", action="store_true", help="measure known sizes anew, too")
    parser.add_argument("--no-docs", action="store_true", help="keep the timings only")
    given = parser.parse_args()
    there = set() if given.again else {(timing.axis, timing.value) for timing in known()}
    for axis in given.axes or AXES:
        values = [value for value in AXES[axis][1] if value <= given.most and (axis, value) not in there]
        for found in timings(axis, values, given.longest):
            for timing in found:
                print(timing, flush=True)
            keep(found)
            if not given.no_docs:
                write_page()


if __name__ == "__main__":
    main()

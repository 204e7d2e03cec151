"""Rewrites the flown orbits and the K-band range of GRACE, as the LEOGPS repository has them, as CSV that relnav reads.

https://github.com/sammmlow/LEOGPS, folder reference/, MIT licence: grca_truth.csv, grcb_truth.csv and grc_kb_rng.csv
(in older versions under output/grace_truths/). Their rows have a date, a time, and position in km and velocity in dm/s,
Earth-fixed, or a range in m. Writes the first half day to grace_a.csv, grace_b.csv and k_band.csv:

    python benchmarks/grace/rewrite.py LEOGPS/reference FOLDER
"""

import sys
from datetime import datetime, timedelta
from pathlib import Path

HALF_DAY = timedelta(hours=12)
AXES = "xyz"
ORBIT = ["gps_time", *(f"{axis}_itrf_m" for axis in AXES), *(f"v{axis}_itrf_m_s" for axis in AXES)]
ORBIT_UNITS = [1e3] * 3 + [1e-1] * 3  # km, dm/s
FILES = {
    "grca_truth.csv": ("grace_a.csv", ORBIT, ORBIT_UNITS, 6),
    "grcb_truth.csv": ("grace_b.csv", ORBIT, ORBIT_UNITS, 6),
    "grc_kb_rng.csv": ("k_band.csv", ["gps_time", "range_m"], [1.0], 4),
}


def rewritten(text, header, units, digits):
    """Return the rows of the first half day under a header, in SI."""
    lines, start = [",".join(header)], None
    for row in text.split():
        date, time, *values = row.split(",")
        moment = datetime.strptime(f"{date} {time}", "%d/%m/%Y %H:%M:%S")
        start = start or moment
        if moment - start > HALF_DAY:
            break
        numbers = (f"{float(value) * unit:.{digits}f}" for value, unit in zip(values, units, strict=True))
        lines.append(",".join([moment.isoformat(), *numbers]))
    return "\n".join(lines) + "\n"


def main():
    source, target = map(Path, sys.argv[1:])
    target.mkdir(parents=True, exist_ok=True)
    for name, (new, *form) in FILES.items():
        (target / new).write_text(rewritten((source / name).read_text(encoding="utf-8-sig"), *form))
        print(f"wrote {target / new}")


if __name__ == "__main__":
    main()

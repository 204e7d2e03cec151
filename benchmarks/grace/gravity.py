"""How much of the Earth's field a truth needs: orbits started from the flown states of GRACE against the flown ones.

Takes the files that rewrite.py writes. The first table says how wrong relative positions become, RMS over 25 starts,
one every 1500 s; its last row how far a field of degree and order 40 takes a craft 10 km ahead of GRACE A from where J2
to J4 take it. Prints the tables of docs/grace.md:

    python benchmarks/grace/gravity.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np

from relnav_sim import ForceModel, GravityField, load_ephemeris, propagate

FIELDS = {"J2 to J4": (4, 0), "4 x 4": (4, 4), "10 x 10": (10, 10), "20 x 20": (20, 20), "40 x 40": (40, 40)}
FIELDS["60 x 60"] = (60, 60)
STARTS = np.arange(0.0, 36_001.0, 1500.0)
AFTER = [60.0, 120.0, 600.0, 1400.0, 2800.0, 5650.0]


def force_from(epoch, degree, order):
    field = GravityField.load("ggm05s", degree, order)
    return ForceModel(field.mu_m3_s2, field.radius_m, zonals=(), gravity=field, epoch=epoch)


def ahead(states, distance_m):
    """Return states (n, 6) turned about the orbit normal by a distance along the orbit."""
    r, v = states[:, :3], states[:, 3:]
    axis = np.cross(r, v)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    angle = (distance_m / np.linalg.norm(r, axis=1))[:, None]

    def turned(x):
        along = (axis * x).sum(axis=1, keepdims=True)
        return x * np.cos(angle) + np.cross(axis, x) * np.sin(angle) + axis * along * (1 - np.cos(angle))

    return np.concatenate([turned(r), turned(v)], axis=1)


def difference(pair, degree, order, epoch):
    """Return the difference of positions (T, 3) of two craft, ECI, at the times after a start."""
    a, b = propagate(pair, AFTER, force_from(epoch, degree, order))[..., :3]
    return b - a


def rms(errors):
    return np.sqrt(np.square(errors).sum(axis=-1).mean(axis=0))


def main():
    folder = Path(sys.argv[1])
    orbits = [load_ephemeris(next(folder.glob(f"grace_{craft}*.csv"))) for craft in "ab"]
    times_s, epochs = orbits[0].times_s, [orbits[0].epoch.later(start) for start in STARTS]
    a, b = (orbit.eci().states for orbit in orbits)
    at = np.searchsorted(times_s, STARTS[:, None] + [0.0, *AFTER])
    print("| gravity | " + " | ".join(f"{after:g} s" for after in AFTER) + " |")
    print("|" + "---|" * (1 + len(AFTER)))

    def row(name, values):
        print(f"| {name} | " + " | ".join(f"{value:.3g}" for value in values) + " |", flush=True)

    for name, size in FIELDS.items():
        found = np.array([difference(np.stack([a[k[0]], b[k[0]]]), *size, t) for k, t in zip(at, epochs, strict=True)])
        row(name, rms(found - (b - a)[at[:, 1:], :3]))
    near = np.stack([a[at[:, 0]], ahead(a[at[:, 0]], 10e3)], axis=1)
    fields = [
        np.array([difference(p, *FIELDS[f], t) for p, t in zip(near, epochs, strict=True)])
        for f in ("40 x 40", "J2 to J4")
    ]
    row("10 km ahead: 40 x 40 less J2 to J4", rms(fields[0] - fields[1]))


if __name__ == "__main__":
    main()

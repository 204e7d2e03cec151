"""Recorded orbits over the span that a campaign flies, in ECI."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from relnav_sim.astro.earth_orientation import EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.named_files import digest_of
from relnav_sim.recorded import Ephemeris, EphemerisError
from relnav_sim.recorded.load import read_orbit_file
from relnav_sim.recorded.orbit_file import OrbitFile
from relnav_sim.recorded.stated import Stated
from relnav_sim.truth.ephemeris_files import EphemerisOptions
from relnav_sim.truth.thrust import CRAFT
from relnav_sim.wording import significant

LOOSE_M = 1.0
"""Interpolation error of an orbit from which relative navigation notices it."""
UNOBSERVED = EarthOrientation()
"""The Earth's rotation as theory alone tells it."""


def first_instant(options: EphemerisOptions) -> Epoch:
    """Return the first instant that both files cover.

    Raises:
        EphemerisError: A file can't be read or used, or they cover no instant together.
    """
    both = [flown(options, craft) for craft in CRAFT]
    begin = max(each.epoch.later(each.spans[0].start_s) for each in both)
    for each in both:
        if not each.covers(begin.seconds_since(each.epoch), begin.seconds_since(each.epoch)):
            raise EphemerisError(
                f"{each.path} does not cover {begin.text()}, when the other file begins; it covers {each.coverage}"
            )
    return begin


def flown(
    options: EphemerisOptions,
    craft: str,
    epoch: Epoch | None = None,
    duration_s: float = 0.0,
    orientation: EarthOrientation = UNOBSERVED,
) -> Ephemeris:
    """Return the orbit of a craft, ECI, over a run.

    Args:
        options: The files.
        craft: chief or deputy.
        epoch: When the run starts; None: all of the file.
        duration_s: How long it takes, s.
        orientation: What is known of the Earth's rotation.

    Raises:
        EphemerisError: The file can't be read or used, is not what it was, or does not cover the run.
    """
    name, digest = options.file(craft)
    stop = None if epoch is None else epoch.later(duration_s)
    return _flown(name, digest or _digest(name), options.stated, epoch, stop, orientation)


@lru_cache(maxsize=8)
def _flown(
    name: str,
    digest: str,
    stated: Stated,
    start: Epoch | None,
    stop: Epoch | None,
    orientation: EarthOrientation,
) -> Ephemeris:
    found = _read(name, digest, stated).between(start, stop)
    return found.eci(ut1_utc_s=orientation.ut1_utc_s, polar_motion_rad=orientation.polar_motion_rad)


@lru_cache(maxsize=2)
def _read(name: str, digest: str, stated: Stated) -> OrbitFile:
    """Return what stands in a file; read once in a process, as a campaign wants several parts of it."""
    if _digest(name) != digest:
        raise EphemerisError(f"{name} has changed since the campaign was read; start again, or bring it back")
    return read_orbit_file(name, stated)


def interpolation_warnings(orbits: Iterable[Ephemeris]) -> list[str]:
    """Return a sentence on each orbit whose rows are too far apart, or too rough, to say where the craft is between."""
    return [
        f"Rows of {Path(orbit.path).name} that are withheld are met within {significant(orbit.interpolation_error_m)} m"
        " only, so that the orbit between its rows is uncertain: give rows nearer to each other, or look for rows that "
        "are off."
        for orbit in orbits
        if orbit.interpolation_error_m > LOOSE_M
    ]


def _digest(name: str) -> str:
    try:
        return digest_of(Path(name))
    except ValueError as error:
        raise EphemerisError(str(error)) from None

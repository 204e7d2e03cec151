"""Orbits in closed form, and the files that tests make of them."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch

EPOCH = Epoch.parse("2021-07-10T16:00:00 UTC")
MU_M3_S2, RADIUS_M = 3.986004418e14, 6.9e6


def circular(times_s: Array, ahead_rad: float = 0.0) -> Array:
    """Return states (T, 6) on a circle, inclined 50 deg, m and m/s."""
    n = np.sqrt(MU_M3_S2 / RADIUS_M**3)
    u = n * np.asarray(times_s) + ahead_rad
    across = np.array([0.0, np.cos(np.radians(50)), np.sin(np.radians(50))])
    first = np.array([1.0, 0.0, 0.0])
    position = RADIUS_M * (np.cos(u)[:, None] * first + np.sin(u)[:, None] * across)
    velocity = RADIUS_M * n * (-np.sin(u)[:, None] * first + np.cos(u)[:, None] * across)
    return np.concatenate([position, velocity], axis=1)


def calendar(times_s: Array, scale: str = "UTC") -> list[str]:
    return [EPOCH.later(float(time)).text(scale).removesuffix(f" {scale}") for time in times_s]


def oem_text(
    times_s: Array,
    states: Array,
    *,
    scale: str = "UTC",
    frame: str = "EME2000",
    more: str = "INTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 7\n",
    version: str = "2.0",
    after: str = "",
    head: bool = True,
) -> str:
    """Return an OEM of one segment; line 1 is the version, META_START on line 4, the first state on line 13 or more."""
    times = calendar(times_s, scale)
    rows = "\n".join(
        " ".join([time, *map(repr, (state / 1e3).tolist())]) for time, state in zip(times, states, strict=True)
    )
    start = f"CCSDS_OEM_VERS = {version}\nCREATION_DATE = 2021-07-10T16:00:00\nORIGINATOR = TEST\n" if head else ""
    return (
        f"{start}META_START\nOBJECT_NAME = ONE\nOBJECT_ID = 2021-001A\nCENTER_NAME = EARTH\nREF_FRAME = {frame}\n"
        f"TIME_SYSTEM = {scale}\nSTART_TIME = {times[0]}\nSTOP_TIME = {times[-1]}\n{more}META_STOP\n{rows}\n{after}"
    )

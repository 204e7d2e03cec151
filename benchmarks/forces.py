"""What each force amounts to by altitude: alone, as the difference of two craft 10 km apart, and after a revolution.

Root mean squares over random places on a sphere and random times of a year, and over random circular orbits from one
date. Prints the tables of docs/forces.md:

    python benchmarks/forces.py
"""

from __future__ import annotations

from typing import Any

import numpy as np

from relnav_sim import ForceModel, kernels, propagate, rtn_from_eci
from relnav_sim.arrays import Array
from relnav_sim.astro.atmosphere import LayeredAtmosphere
from relnav_sim.astro.earth_orientation import ROTATION_RAD_S, EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.gravity_field import GravityField
from relnav_sim.astro.sky import sky_between
from relnav_sim.astro.sun_moon import MOON_MU, SUN_MU, moon_position, sun_position

ALTITUDES_KM = (400, 760, 1500, 35786)
RADIUS, MU = 6378136.3, 3.986004415e14
DRAG_M2_KG, RADIATION_M2_KG = 2.2 * 0.01, 1.3 * 0.01
"""Cd A / m and Cr A / m of a craft with 0.01 m^2/kg."""
MISMATCH = 0.2
SEPARATION_M, PLACES, ORBITS = 10e3, 4000, 48
FIELDS = ((0, 0), (2, 0), (4, 0), (4, 4), (20, 20), (40, 40), (60, 60))
LEVELS = ("J2", "J3 and J4", "the rest of 4 x 4", "to 20 x 20", "to 40 x 40", "to 60 x 60")
SUNLIGHT, DRAG = "sunlight, Cr A/m 0.013 m²/kg", "drag, Cd A/m 0.022 m²/kg"
MORE_SUNLIGHT, MORE_DRAG = "sunlight, 20 % more for the second craft", "drag, 20 % more for the second craft"
LATE, MOVED = "*UT1 - UTC of 0.9 s*", "*polar motion of 0.3 arc seconds in x and y*"
EPOCH = Epoch.parse("2010-01-01T00:00:00 UTC")
LOVE_NUMBER, LIGHT_M_S = 0.3, 299792458.0
ARC_SECOND = np.pi / 180 / 3600
LEAST = (1e-15, 1e-15, 1e-5)
"""What is below the rounding of a small force, and of a propagation, counts as none."""


ERRORS = {
    LATE: EarthOrientation(ut1_utc_s=0.9),
    MOVED: EarthOrientation(polar_motion_rad=(0.3 * ARC_SECOND, 0.3 * ARC_SECOND)),
}


def places(altitude_m: float) -> tuple[Array, Array, Array, Array]:
    """Return positions of pairs (2, n, 3), unit vectors along their motion (n, 3), and times (n,)."""
    rng = np.random.default_rng(0)
    radial, along = rng.normal(size=(2, PLACES, 3))
    radial /= np.linalg.norm(radial, axis=1)[:, None]
    along -= np.einsum("ni,ni->n", along, radial)[:, None] * radial
    along /= np.linalg.norm(along, axis=1)[:, None]
    r, angle = RADIUS + altitude_m, SEPARATION_M / (RADIUS + altitude_m)
    second = r * (np.cos(angle) * radial + np.sin(angle) * along)
    ahead = np.cos(angle) * along - np.sin(angle) * radial
    speed = np.sqrt(MU / r)
    return np.stack([r * radial, second]), speed * along, speed * ahead, rng.uniform(0, 365 * 86400.0, PLACES)


def gravity(degree: int, order: int, orientation: EarthOrientation, at: Array, times: Array) -> Array:
    """Return the acceleration (n, 3) of GGM05S in ECI."""
    turned, _ = orientation.matrices(times, EPOCH)
    fixed = GravityField.load("ggm05s", degree, order).acceleration(np.einsum("nij,nj->ni", turned, at))
    return np.einsum("nji,nj->ni", turned, fixed)


def third_bodies(at: Array, times: Array, sun: float, moon: float, reflectivity: float = 0.0) -> Array:
    """Return what Sun, Moon and sunlight add (n, 3)."""
    of_each = np.full(len(at), reflectivity)
    return kernels.sky.acceleration(sky_between(EPOCH, 0.0, 365 * 86400.0), times, at, of_each, sun, moon, RADIUS)


def drag(at: Array, velocity: Array, ballistic: float) -> Array:
    """Return drag (n, 3) on circular orbits in the layers of the table."""
    states, of_each = np.concatenate([at, velocity], axis=1), np.full(len(at), ballistic)
    return kernels.atmosphere.drag(LayeredAtmosphere().compiled, RADIUS, ROTATION_RAD_S, states, of_each)


def solid_tide(at: Array, body: Array, mu: float) -> Array:
    """Return the pull (n, 3) of the bulge of degree two that a body raises (Montenbruck and Gill 2000, 3.7)."""
    r, s = np.linalg.norm(at, axis=1)[:, None], np.linalg.norm(body, axis=1)[:, None]
    e, f = at / r, body / s
    cosine = np.einsum("ni,ni->n", e, f)[:, None]
    return LOVE_NUMBER / 2 * mu / s**3 * RADIUS**5 / r**4 * ((3 - 15 * cosine**2) * e + 6 * cosine * f)


def relativity(at: Array, velocity: Array) -> Array:
    """Return Schwarzschild's correction (n, 3) (IERS Conventions 2010, equation 10.12)."""
    r = np.linalg.norm(at, axis=1)[:, None]
    v2 = (velocity**2).sum(axis=1)[:, None]
    radial = np.einsum("ni,ni->n", at, velocity)[:, None] / r
    return MU / r**2 / LIGHT_M_S**2 * ((4 * MU / r - v2) * at / r + 4 * radial * velocity)


def forces(at: Array, velocity: Array, times: Array, lead: bool) -> dict[str, Array]:
    """Return each force's acceleration (n, 3); the lead of two craft may have other coefficients."""
    more = 1 + MISMATCH * lead
    levels = [gravity(degree, order, EarthOrientation(), at, times) for degree, order in FIELDS]
    found = {"point mass": levels[0]} | {name: b - a for name, a, b in zip(LEVELS, levels, levels[1:], strict=False)}
    found["Moon"] = third_bodies(at, times, 0.0, MOON_MU)
    found["Sun"] = third_bodies(at, times, SUN_MU, 0.0)
    found[SUNLIGHT] = third_bodies(at, times, 0.0, 0.0, RADIATION_M2_KG)
    found[MORE_SUNLIGHT] = third_bodies(at, times, 0.0, 0.0, more * RADIATION_M2_KG)
    found[DRAG] = drag(at, velocity, DRAG_M2_KG)
    found[MORE_DRAG] = drag(at, velocity, more * DRAG_M2_KG)
    for name, orientation in ERRORS.items():
        found[name] = gravity(20, 20, orientation, at, times) - levels[4]
    found["*tides of the solid Earth*"] = solid_tide(at, moon_position(times, EPOCH), MOON_MU) + solid_tide(
        at, sun_position(times, EPOCH), SUN_MU
    )
    found["*relativity*"] = relativity(at, velocity)
    return found


def after_a_revolution(altitude_m: float) -> dict[str, Array]:
    """Return by how much each force moves the second craft relative to the first, (n, 3), in RTN, m."""
    pair, *velocities, _ = places(altitude_m)
    start = np.concatenate([pair, np.stack(velocities)], axis=2)[:, :ORBITS].reshape(-1, 6)
    period = 2 * np.pi * np.sqrt((RADIUS + altitude_m) ** 3 / MU)

    def relative(degree: int = 4, order: int = 4, more: float = 1.0, **also: Any) -> Array:
        field = GravityField.load("ggm05s", degree, order)
        force = ForceModel(field.mu_m3_s2, field.radius_m, (), gravity=field, epoch=EPOCH, **also)
        of_each = np.repeat([1.0, more], ORBITS)
        end = propagate(start, [period], force, DRAG_M2_KG * of_each, radiation_m2_kg=RADIATION_M2_KG * of_each)
        first, second = end[:, 0].reshape(2, ORBITS, 6)
        return rtn_from_eci(first, second)[:, :3]

    levels = [relative(degree, order) for degree, order in FIELDS]
    found = {name: b - a for name, a, b in zip(LEVELS, levels, levels[1:], strict=False)}
    air, more = LayeredAtmosphere(), 1 + MISMATCH
    with_one_more: dict[str, dict[str, Any]] = {
        "Moon": {"third_bodies": ("moon",)}, "Sun": {"third_bodies": ("sun",)},
        SUNLIGHT: {"radiation": True}, MORE_SUNLIGHT: {"radiation": True, "more": more},
        DRAG: {"atmosphere": air}, MORE_DRAG: {"atmosphere": air, "more": more},
    }  # fmt: skip
    found |= {name: relative(**options) - levels[3] for name, options in with_one_more.items()}
    return found | {name: relative(20, 20, orientation=wrong) - levels[4] for name, wrong in ERRORS.items()}


def main() -> None:
    """Print the tables."""
    titles = (
        "acceleration, m/s²", "difference over 10 km along the track, m/s²", "after a revolution, at 10 km, m",
    )  # fmt: skip
    tables: list[dict[str, list[float]]] = [{}, {}, {}]
    for altitude in ALTITUDES_KM:
        pair, first_velocity, second_velocity, times = places(altitude * 1e3)
        first = forces(pair[0], first_velocity, times, lead=False)
        second = forces(pair[1], second_velocity, times, lead=True)
        difference = {name: second[name] - first[name] for name in first}
        same_alone = {name: a for name, a in first.items() if name not in (MORE_SUNLIGHT, MORE_DRAG)}
        for table, of_names in zip(tables, (same_alone, difference, after_a_revolution(altitude * 1e3)), strict=True):
            for name, vectors in of_names.items():
                table.setdefault(name, []).append(float(np.sqrt((vectors**2).sum(axis=1).mean())))
    for title, table, least in zip(titles, tables, LEAST, strict=True):
        print(f"| {title} | " + " | ".join(f"{altitude} km" for altitude in ALTITUDES_KM) + " |")
        print("|---|" + "---|" * len(ALTITUDES_KM))
        for name, figures in table.items():
            print(f"| {name} | " + " | ".join(f"{figure:.1e}" if figure > least else "0" for figure in figures) + " |")
        print()


if __name__ == "__main__":
    main()

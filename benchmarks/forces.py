"""What each force amounts to, by altitude: its acceleration, and its difference between two craft 10 km apart.

Root mean squares over random places on a sphere and random times of a year. Prints the tables of docs/forces.md:

    python benchmarks/forces.py
"""

from __future__ import annotations

import numpy as np

from relnav_sim import kernels
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
BALLISTIC_MISMATCH = 0.2
SEPARATION_M, PLACES = 10e3, 4000
EPOCH = Epoch.parse("2010-01-01T00:00:00 UTC")
LOVE_NUMBER, LIGHT_M_S = 0.3, 299792458.0
ARC_SECOND = np.pi / 180 / 3600


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
    """Return each force's acceleration (n, 3); the lead of two craft has the other ballistic coefficient."""
    known = EarthOrientation()
    fields = ((0, 0), (2, 0), (4, 0), (4, 4), (20, 20), (40, 40), (60, 60))
    levels = [gravity(degree, order, known, at, times) for degree, order in fields]
    names = ["J2", "J3 and J4", "the rest of 4 x 4", "to 20 x 20", "to 40 x 40", "to 60 x 60"]
    found = {"point mass": levels[0]} | {name: b - a for name, a, b in zip(names, levels, levels[1:], strict=False)}
    found["Moon"] = third_bodies(at, times, 0.0, MOON_MU)
    found["Sun"] = third_bodies(at, times, SUN_MU, 0.0)
    found["sunlight, Cr A/m 0.013 m²/kg"] = third_bodies(at, times, 0.0, 0.0, RADIATION_M2_KG)
    found["drag, Cd A/m 0.022 m²/kg"] = drag(at, velocity, DRAG_M2_KG)
    found["drag, 20 % more for the second craft"] = drag(at, velocity, DRAG_M2_KG * (1 + BALLISTIC_MISMATCH * lead))
    late = EarthOrientation(ut1_utc_s=0.9)
    found["*UT1 - UTC of 0.9 s*"] = gravity(20, 20, late, at, times) - levels[4]
    moved = EarthOrientation(polar_motion_rad=(0.3 * ARC_SECOND, 0.3 * ARC_SECOND))
    found["*polar motion of 0.3 arc seconds in x and y*"] = gravity(20, 20, moved, at, times) - levels[4]
    found["*tides of the solid Earth*"] = solid_tide(at, moon_position(times, EPOCH), MOON_MU) + solid_tide(
        at, sun_position(times, EPOCH), SUN_MU
    )
    found["*relativity*"] = relativity(at, velocity)
    return found


def shown(figure: float) -> str:
    """Return a figure with two digits; what is less than the rounding of a small force counts as none."""
    return f"{figure:.1e}" if figure > 1e-15 else "0"


def main() -> None:
    """Print both tables."""
    rows: dict[str, list[tuple[float, float]]] = {}
    for altitude in ALTITUDES_KM:
        pair, first_velocity, second_velocity, times = places(altitude * 1e3)
        first = forces(pair[0], first_velocity, times, lead=False)
        second = forces(pair[1], second_velocity, times, lead=True)
        for name, of_first in first.items():
            figures = (of_first, second[name] - of_first)
            rows.setdefault(name, []).append(tuple(float(np.sqrt((a**2).sum(axis=1).mean())) for a in figures))
    for which, title in enumerate(("acceleration, m/s²", "difference over 10 km along the track, m/s²")):
        print(f"| {title} | " + " | ".join(f"{altitude} km" for altitude in ALTITUDES_KM) + " |")
        print("|---|" + "---|" * len(ALTITUDES_KM))
        for name, figures in rows.items():
            print(f"| {name} | " + " | ".join(shown(by_altitude[which]) for by_altitude in figures) + " |")
        print()


if __name__ == "__main__":
    main()

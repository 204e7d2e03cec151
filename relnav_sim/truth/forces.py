"""What moves a spacecraft: gravity, zonal or of any field, Sun and Moon, sunlight, and drag in air that co-rotates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.atmosphere import LayeredAtmosphere
from relnav_sim.astro.constants import J2, J3, J4, ROTATION_RAD_S
from relnav_sim.astro.earth_orientation import EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.frames import PARALLEL
from relnav_sim.astro.gravity_field import GravityField
from relnav_sim.astro.sky import about_eci_z, sky_between, still_sky
from relnav_sim.astro.sun_moon import MOON_MU, SUN_MU

if TYPE_CHECKING:
    from relnav_sim.kernels.atmosphere import Layers
    from relnav_sim.kernels.field_forces import FieldForces
    from relnav_sim.kernels.forces import Forces
    from relnav_sim.kernels.sky import Sky


@dataclass(frozen=True)
class ExponentialAtmosphere:
    """Density rho = density exp(-(altitude - base altitude) / scale height); altitude is |r| minus the radius.

    Args:
        base_altitude_m: Altitude at which the density is given, m.
        density_kg_m3: Density there, kg/m^3.
        scale_height_m: Altitude over which the density falls by the factor e, m.

    Raises:
        ValueError: A density or scale height that is not positive, or a value that is not finite.

    Examples:
        >>> from relnav_sim import ExponentialAtmosphere, ForceModel
        >>> air = ExponentialAtmosphere(base_altitude_m=500e3, density_kg_m3=6.967e-13, scale_height_m=63822.0)
        >>> force = ForceModel(3.986004418e14, 6378137.0, atmosphere=air)
        >>> float(air.density(500e3))
        6.967e-13
    """

    base_altitude_m: float
    density_kg_m3: float
    scale_height_m: float

    def __post_init__(self) -> None:
        if not isfinite(self.base_altitude_m):
            raise ValueError(f"base_altitude_m is {self.base_altitude_m}; it must be a finite number")
        _require_positive(self, "density_kg_m3", "scale_height_m")

    def density(self, altitude_m: Array) -> Array:
        """Return the density in kg/m^3 at altitudes in m, any shape."""
        density: Array = self.density_kg_m3 * np.exp((self.base_altitude_m - altitude_m) / self.scale_height_m)
        return density

    @cached_property
    def compiled(self) -> Layers:
        """The same as the kernels take it: one layer."""
        values = (self.base_altitude_m, self.density_kg_m3, self.scale_height_m)
        return kernels.atmosphere.Layers(*(np.array([float(value)]) for value in values))


@dataclass(frozen=True)
class ForceModel:
    """The acceleration of a spacecraft in ECI.

    Gravity is that of a zonal body about ECI z, or of a field that turns with the Earth. With a field, and with Sun and
    Moon, forces change with time: ECI then are the axes of EME2000, and times count from the epoch.

    Args:
        mu_m3_s2: Gravitational parameter, m^3/s^2; with `gravity` its own.
        radius_m: Equatorial radius, m; the zonal harmonics, the altitude and the shadow refer to it; with `gravity` its
            own.
        zonals: Unnormalised J2, J3, J4, ...; any number of them from J2 on, () for a point mass and with `gravity`.
        atmosphere: None for no drag.
        rotation_rad_s: The body's rotation rate about ECI z, rad/s; the atmosphere turns with it.
        gravity: The field, in Earth-fixed axes; None for a zonal body. It needs an epoch, as do the next two.
        epoch: When times count from, as `Epoch.parse` reads it: `2010-07-27T00:00:00 GPS`.
        third_bodies: Whose pull counts: `sun`, `moon`.
        radiation: Whether the pressure of sunlight counts, on spheres and outside the Earth's shadow.
        orientation: UT1 - UTC and polar motion; None for zero.

    Raises:
        ValueError: A gravitational parameter or radius that is not positive, or a value that is not finite; constants
            beside the field that are not its own; no epoch where one is needed; a body of another name.

    Examples:
        >>> from relnav_sim import ForceModel, GravityField
        >>> field = GravityField.load("ggm05s", 20, 20)
        >>> force = ForceModel(
        ...     field.mu_m3_s2,
        ...     field.radius_m,
        ...     zonals=(),
        ...     gravity=field,
        ...     epoch="2010-07-27T00:00:00 GPS",
        ...     third_bodies=("sun", "moon"),
        ... )
        >>> force.acceleration([7e6, 0.0, 0.0, 0.0, 7.5e3, 0.0], times_s=60.0).round(4).tolist()
        [-8.1455, -0.0001, -0.0001]
    """

    mu_m3_s2: float
    radius_m: float
    zonals: tuple[float, ...] = (J2, J3, J4)
    atmosphere: ExponentialAtmosphere | LayeredAtmosphere | None = None
    rotation_rad_s: float = ROTATION_RAD_S
    gravity: GravityField | None = None
    epoch: str | Epoch | None = None
    third_bodies: tuple[str, ...] = ()
    radiation: bool = False
    orientation: EarthOrientation | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "zonals", tuple(float(j) for j in self.zonals))
        object.__setattr__(self, "third_bodies", tuple(self.third_bodies))
        _require_positive(self, "mu_m3_s2", "radius_m")
        if not all(map(isfinite, (*self.zonals, self.rotation_rad_s))):
            raise ValueError("zonals and rotation_rad_s must be finite numbers")
        for body in self.third_bodies:
            if body not in THIRD_BODIES:
                raise ValueError(f"third_bodies has {body!r}; known are {' and '.join(THIRD_BODIES)}")
        if self.gravity is not None:
            self._check_beside(self.gravity)
        if self.epoch is not None:
            object.__setattr__(self, "epoch", Epoch.parse(self.epoch) if isinstance(self.epoch, str) else self.epoch)
        elif self.gravity is not None or self.third_bodies or self.radiation:
            raise ValueError("a gravity field, third_bodies and radiation need an epoch, which times count from")

    def _check_beside(self, gravity: GravityField) -> None:
        """Refuse what does not go with a gravity field."""
        if self.zonals:
            raise ValueError(f"the gravity field {gravity.name} has zonal harmonics of its own: give zonals=()")
        for name in ("mu_m3_s2", "radius_m"):
            given, own = getattr(self, name), getattr(gravity, name)
            if given != own:
                raise ValueError(f"{name} is {given}; the gravity field {gravity.name} has its own, give that: {own}")

    @property
    def is_plain(self) -> bool:
        """Whether `kernels.forces` has all there is: zonal gravity and air of one layer."""
        return self.gravity is None and not self.third_bodies and not self.radiation and len(self._air.bases) <= 1

    def acceleration(
        self,
        states: ArrayLike,
        ballistic_m2_kg: ArrayLike = 0.0,
        times_s: ArrayLike = 0.0,
        radiation_m2_kg: ArrayLike = 0.0,
    ) -> Array:
        """Return the acceleration (..., 3) in m/s^2, ECI.

        The last three are broadcast against the leading axes of `states`.

        Args:
            states: Position and velocity (..., 6) in m and m/s, ECI.
            ballistic_m2_kg: Cd A / m in m^2/kg; only the atmosphere uses it.
            times_s: Seconds after the epoch, where forces depend on them.
            radiation_m2_kg: Cr A / m in m^2/kg; only radiation uses it.

        Raises:
            ValueError: Forces depend on times, and one is before 1900 or after 2100.
        """
        given = [np.asarray(each, dtype=float) for each in (ballistic_m2_kg, times_s, radiation_m2_kg)]
        states = np.asarray(states, dtype=float)
        leading = np.broadcast_shapes(states.shape[:-1], *(each.shape for each in given))
        flat = np.ascontiguousarray(np.broadcast_to(states, (*leading, 6))).reshape(-1, 6)
        ballistic, times, sunlit = (np.ascontiguousarray(np.broadcast_to(each, leading)).ravel() for each in given)
        if self.is_plain:
            found = kernels.forces.acceleration(self.plain, flat, ballistic)
        else:
            areas = np.stack([ballistic, sunlit], axis=1)
            known = times[np.isfinite(times)]  # at the others the acceleration is NaN
            forces = self.between(known.min(initial=0.0), known.max(initial=0.0))
            found = kernels.field_forces.acceleration(forces, flat, areas, times)
        return found.reshape(*leading, 3)

    def normal_acceleration(
        self,
        states: ArrayLike,
        ballistic_m2_kg: ArrayLike = 0.0,
        times_s: ArrayLike = 0.0,
        radiation_m2_kg: ArrayLike = 0.0,
    ) -> Array:
        """Return the acceleration along the orbit normal r x v, (...) in m/s^2: what turns the orbit plane.

        Args:
            states: Position and velocity (..., 6) in m and m/s, ECI.
            ballistic_m2_kg: As in `acceleration`; so are the others.
            times_s: Seconds after the epoch.
            radiation_m2_kg: Cr A / m in m^2/kg.

        Raises:
            ValueError: A position and velocity are parallel, so that they span no orbit plane.
        """
        states = np.asarray(states, dtype=float)
        x, y, z, vx, vy, vz = np.moveaxis(states, -1, 0)
        nx, ny, nz = y * vz - z * vy, z * vx - x * vz, x * vy - y * vx
        h = np.sqrt(nx * nx + ny * ny + nz * nz)
        if np.any(h <= PARALLEL * np.sqrt((x * x + y * y + z * z) * (vx * vx + vy * vy + vz * vz))):
            raise ValueError("position and velocity are parallel: they span no orbit plane")
        acceleration = self.acceleration(states, ballistic_m2_kg, times_s, radiation_m2_kg)
        ax, ay, az = np.moveaxis(acceleration, -1, 0)
        normal: Array = (ax * nx + ay * ny + az * nz) / h
        return normal

    @cached_property
    def plain(self) -> Forces:
        """The same as the kernels of `kernels.forces` take it."""
        air = self._air if len(self._air.bases) else ExponentialAtmosphere(0.0, 1.0, 1.0).compiled
        return kernels.forces.Forces(
            float(self.mu_m3_s2),
            float(self.radius_m),
            np.array(self.zonals, dtype=float),
            float(air.densities[0]) if self.atmosphere else 0.0,
            float(air.bases[0]),
            float(air.scale_heights[0]),
            float(self.rotation_rad_s),
        )

    def between(self, first_s: float, last_s: float, sense: float = 1.0) -> FieldForces:
        """Return the same as the kernels of `kernels.field_forces` take it.

        It is good for times from one to another and a day beyond; what it is at a time does not depend on the others.

        Args:
            first_s: Seconds after the epoch.
            last_s: Seconds after the epoch.
            sense: -1 where the kernels count seconds before the epoch.
        """
        field = self.gravity or GravityField.zonal(self.mu_m3_s2, self.radius_m, self.zonals)
        return kernels.field_forces.FieldForces(
            float(self.mu_m3_s2),
            float(self.radius_m),
            field.series,
            self._sky(first_s, last_s),
            SUN_MU if "sun" in self.third_bodies else 0.0,
            MOON_MU if "moon" in self.third_bodies else 0.0,
            self.radiation,
            self._air,
            float(self.rotation_rad_s),
            sense,
            self._degrees_roughness,
        )

    def roughness(self, distances_m: Array) -> Array:
        """Return how much a field adds to the error estimate of a step, as a share of what the central pull makes.

        Below the body's surface, where its series need not converge, it is what it is there.
        """
        n = np.arange(3.0, 3 + len(self._degrees_roughness))
        ratio = self.radius_m / np.maximum(distances_m, self.radius_m)
        added: Array = (self._degrees_roughness * ratio[..., None] ** (2 * n)).sum(axis=-1)
        return added

    @cached_property
    def _degrees_roughness(self) -> Array:
        """What each degree from 3 on adds at the radius: the square of its relative acceleration times n^5.5."""
        if self.gravity is None:
            return np.empty(0)
        n = np.arange(3.0, self.gravity.degree + 1)
        variances = (np.square(self.gravity.C[3:]) + np.square(self.gravity.S[3:])).sum(axis=1)
        roughness: Array = ROUGHNESS * np.square((n + 1) * n**5.5) * variances
        return roughness

    def _sky(self, first_s: float, last_s: float) -> Sky:
        """Return the sky; over a zonal body its own axis is ECI z."""
        if self.epoch is None:
            return still_sky(first_s, last_s)
        assert isinstance(self.epoch, Epoch)
        sky = sky_between(self.epoch, first_s, last_s, self.orientation)
        return sky if self.gravity is not None else about_eci_z(sky)

    @cached_property
    def _air(self) -> Layers:
        nothing = np.empty(0)
        return self.atmosphere.compiled if self.atmosphere else kernels.atmosphere.Layers(nothing, nothing, nothing)


THIRD_BODIES = ("sun", "moon")
ROUGHNESS = 1.3e-3
"""Measured over GGM05S with degrees 20 to 60, 300 to 800 km high: the sum is right within a factor of 2, which is a
tenth of the step."""


def _require_positive(model: object, *names: str) -> None:
    for name in names:
        value = getattr(model, name)
        if not (isfinite(value) and value > 0):
            raise ValueError(f"{name} is {value}; it must be a positive number")

"""What sensors share that look at the other craft: mounting, field of view, and the chain from body to orbit frame."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array, Mask
from relnav_sim.astro.attitude import in_axes, nadir_axes
from relnav_sim.astro.line_of_sight import Vector, half_open, mounting_matrix, rotate, rows, sight_vector, spherical_of
from relnav_sim.astro.tangent_plane import deflected
from relnav_sim.options import Effect
from relnav_sim.sensors.host_frame import HostFrame
from relnav_sim.sensors.interface import RelativeSensorOptions, Sensed, within

AngleForm = Literal["spherical", "tangent"]
"""What the noise of two angles is: of azimuth and elevation themselves, or two small turns across the line of sight."""
HalfAngle = Annotated[float, Field(gt=0, le=180)]


def read_across(azimuth: Array, elevation: Array, errors: Array) -> tuple[Array, Array]:
    """Return azimuth and elevation of a line of sight that is read off by two small turns across it, (..., 2) rad."""
    direction = sight_vector(np.ones(()), azimuth, elevation)
    _, read_azimuth, read_elevation = spherical_of(deflected(direction, errors[..., 0], errors[..., 1]))
    return half_open(read_azimuth), read_elevation


class SightSensorOptions(RelativeSensorOptions):
    """A sensor with axes of its own, mounted in a body that keeps to its host's LVLH frame.

    The LVLH frame has x along-track, y minus orbit normal, z nadir. Azimuth counts from the sensor's x axis towards y,
    elevation towards minus z.
    """

    mounting_deg: tuple[float, float, float] = Field(
        default=(0.0, 0.0, 0.0),
        description="Yaw, pitch and roll from the LVLH frame to the sensor's frame, deg, about z, the new y and the "
        "new x; default: aligned, so that azimuth 0 is straight ahead. The azimuth does not exist on the z axis",
    )
    field_of_view_deg: Annotated[tuple[HalfAngle, HalfAngle] | None, Effect("field of view", "absence")] = Field(
        default=None,
        description="Half angles of the field of view in azimuth and elevation about the boresight, deg; default: all "
        "round",
    )
    boresight: Annotated[Literal["fixed", "tracking"], Effect("field of view", "absence")] = Field(
        default="fixed",
        description="fixed: along the sensor's x axis; tracking: gimballed to the other craft, so that the field of "
        "view never cuts, the angles still counted from the mounting (the gimbal's are known)",
    )

    @property
    def mounting(self) -> Array:
        """Rotation (3, 3) from the host's LVLH frame to the sensor's frame."""
        return mounting_matrix(*self.mounting_deg)

    def true_sight(self, truth: Sensed) -> Vector:
        """Return the true range (m), azimuth and elevation (rad) of the other craft, each (runs or 1, K)."""
        difference = truth.target[..., :3] - truth.host[..., :3]
        in_nadir = in_axes(nadir_axes(truth.host), (difference[..., 0], difference[..., 1], difference[..., 2]))
        return spherical_of(rotate(rows(self.mounting), in_nadir))

    def in_reach(self, truth: Sensed) -> Mask:
        """Return where the other craft is within the range limits and the field of view, (runs or 1, K)."""
        return self.sees(self.true_sight(truth))

    def sees(self, sight: Vector) -> Mask:
        """Return where a range (m), azimuth and elevation (rad) are within the range limits and the field of view."""
        distance, azimuth, elevation = sight
        seen = within(self.range_limits_m, distance)
        if self.field_of_view_deg is not None and self.boresight == "fixed":
            half_azimuth, half_elevation = np.radians(self.field_of_view_deg)
            seen &= (np.abs(azimuth) <= half_azimuth) & (np.abs(elevation) <= half_elevation)
        return seen

    def in_estimated_frame(self, z: Array, frame: HostFrame) -> Array:
        """Return range, azimuth and elevation (runs, K, 3) with the angles as seen from the estimated orbit frame.

        NaN in the angles where the host does not know its attitude or orbit; the range stays.
        """
        if frame.body_to_orbit is None:
            return z
        sight = sight_vector(z[..., 0], z[..., 1], z[..., 2])
        _, azimuth, elevation = spherical_of(self.in_orbit_frame(sight, frame))
        return np.stack([z[..., 0], half_open(azimuth), elevation], axis=-1)

    def off_azimuth_axis(self, truth: Sensed) -> Array:
        """Return the angle between the true line of sight and the azimuth axis, (runs or 1, K), rad."""
        return np.asarray(np.pi / 2 - np.abs(self.true_sight(truth)[2]))

    def in_orbit_frame(self, measured: Vector, frame: HostFrame) -> Vector:
        """Return a measured line of sight as seen from the sensor mounted in the host's estimated orbit frame.

        From the sensor's frame to the body by the mounting, to ECI by the measured attitude, and to the orbit frame
        that the measured orbit gives. NaN where the host does not know its attitude or orbit.
        """
        to_orbit = frame.body_to_orbit
        if to_orbit is None:
            return measured
        return rotate(rows(self.mounting), to_orbit(rotate(rows(self.mounting.T), measured)))

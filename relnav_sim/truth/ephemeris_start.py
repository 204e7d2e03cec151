"""A start on a recorded orbit: the state at one instant, from which the craft is propagated."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from relnav_sim.arrays import Array
from relnav_sim.astro.earth_orientation import EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.named_files import in_campaign
from relnav_sim.options import Options, Origin
from relnav_sim.recorded import load_ephemeris
from relnav_sim.truth.epoch_text import EpochText
from relnav_sim.truth.orbit_options import OrbitStart, Vector
from relnav_sim.truth.start_context import StartContext


class RecordedState(Options):
    """A state of a recorded orbit, ECI (EME2000)."""

    epoch: EpochText = Field(description="Its instant, with its time scale")
    position_m: Vector = Field(description="Position, m")
    velocity_m_s: Vector = Field(description="Velocity, m/s")


class EphemerisStart(OrbitStart):
    """The state of a recorded orbit at `truth.epoch`, or else at its first epoch; forces move the craft from there on.

    `truth.ephemeris` flies recorded orbits themselves.
    """

    file: Annotated[str, Origin("state_read")] = Field(
        description="CCSDS OEM, or a CSV table that states its frame and time scale, relative to the campaign's file"
    )
    state_read: RecordedState | None = Field(
        default=None, description="What was read; filled in from the file. Leave it out"
    )

    @field_validator("state_read", mode="after")
    @classmethod
    def _left_out(cls, state: RecordedState | None, info: ValidationInfo) -> RecordedState | None:
        if state is not None and in_campaign(info):
            raise ValueError("comes from the file; leave it out")
        return state

    def read(self, path: Path, epoch: Epoch | None, orientation: EarthOrientation) -> EphemerisStart:
        """Return the same with its state read.

        Args:
            path: Where the file is.
            epoch: When the run starts; None: at the first epoch of the file.
            orientation: What is known of the Earth's rotation, for orbits in ITRF.

        Raises:
            ValueError: The file can't be used or does not cover the epoch; one sentence with ``file:line:``.
        """
        try:
            orbit = load_ephemeris(path, start=epoch, stop=epoch)
        except OSError as error:
            raise ValueError(f"{path}: {error.strerror}") from None
        orbit = orbit.eci(ut1_utc_s=orientation.ut1_utc_s, polar_motion_rad=orientation.polar_motion_rad)
        start = epoch or orbit.epoch.later(orbit.spans[0].start_s)
        x, y, z, vx, vy, vz = orbit.at(start.seconds_since(orbit.epoch)).tolist()
        state = RecordedState(epoch=start.text("TAI"), position_m=(x, y, z), velocity_m_s=(vx, vy, vz))
        return self.model_copy(update={"state_read": state})

    @property
    def own_epoch(self) -> Epoch | None:
        """The instant of the state."""
        return None if self.state_read is None else Epoch.parse(self.state_read.epoch)

    def state(self, context: StartContext) -> Array:
        """Return position and velocity (6,), ECI, m and m/s."""
        assert self.state_read is not None
        return np.array([*self.state_read.position_m, *self.state_read.velocity_m_s])

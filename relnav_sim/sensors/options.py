"""The sensors of a campaign."""

from __future__ import annotations

from pydantic import Field

from relnav_sim.options import Options
from relnav_sim.sensors.accelerometer import AccelerometerOptions
from relnav_sim.sensors.gnss import GnssOptions
from relnav_sim.sensors.radar import RadarOptions
from relnav_sim.sensors.star_tracker import StarTrackerOptions


class SensorsOptions(Options):
    """What is measured: the radar, what tells its carrier where it points, and thrust. Every sigma is one sigma."""

    radar: RadarOptions | None = Field(
        default=None, description="Range, azimuth and elevation of the other craft; filters need it"
    )
    gnss: GnssOptions | None = Field(
        default=None, description="Position and velocity of the radar's carrier; default: its orbit frame is perfect"
    )
    star_tracker: StarTrackerOptions | None = Field(
        default=None, description="Attitude of the radar's carrier; default: it is perfect"
    )
    accelerometer: AccelerometerOptions | None = Field(
        default=None, description="Specific force that the craft feel; default: filters are told the planned thrust"
    )


def sensor_kinds() -> dict[str, type[Options]]:
    """Return the options model of every sensor by its name in a campaign."""
    return {
        "radar": RadarOptions,
        "gnss": GnssOptions,
        "star_tracker": StarTrackerOptions,
        "accelerometer": AccelerometerOptions,
    }

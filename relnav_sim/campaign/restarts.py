"""Which sensors of a filter give the fixes that it can be restarted from."""

from __future__ import annotations

from collections.abc import Sequence

from relnav_sim.sensors import Sensors, relative_sensors


def restart_sensors(sensors: Sensors, used: Sequence[str] | None) -> list[str]:
    """Return the sensors, of those that a filter uses, whose measurement gives the position at its own epoch.

    Args:
        sensors: All sensors.
        used: Names of those that the filter uses; None: all relative ones.
    """
    return [name for name, each in relative_sensors(sensors, used).items() if each.gives_fix and not each.latency_s]

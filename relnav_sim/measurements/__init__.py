"""What a filter believes a sensor reads: the interface, linear and user-given measurements, the built-in sensors.

For own data, `from relnav_sim import measurements`, one function a sensor: ``measurements.radar(...)`` and so on.

Examples:
    >>> from relnav_sim import measurements
    >>> measurements.radar(range_sigma_m=2.0, angle_sigma_deg=0.05).dimension
    3
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relnav_sim.measurements.ranging import crosslink as crosslink
    from relnav_sim.measurements.ranging import lidar as lidar
    from relnav_sim.measurements.relative_state import relative_gnss as relative_gnss
    from relnav_sim.measurements.spherical_radar import first_fix as first_fix
    from relnav_sim.measurements.spherical_radar import radar as radar
    from relnav_sim.measurements.tangent_sight import camera as camera

# No module here may have one of these names: once imported, it would take the function's place.
_HOME = {
    "camera": "relnav_sim.measurements.tangent_sight",
    "crosslink": "relnav_sim.measurements.ranging",
    "first_fix": "relnav_sim.measurements.spherical_radar",
    "lidar": "relnav_sim.measurements.ranging",
    "radar": "relnav_sim.measurements.spherical_radar",
    "relative_gnss": "relnav_sim.measurements.relative_state",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Import a public name on its first use, so that the package imports fast."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])

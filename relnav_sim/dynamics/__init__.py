"""Relative motion that a filter may believe in: one model a file, and its process noise.

For own data, `from relnav_sim import dynamics`, one function a model: ``dynamics.cw(...)`` and so on.

Examples:
    >>> from relnav_sim import Step, dynamics
    >>> cw = dynamics.cw(mean_motion_rad_s=1.1e-3, step_s=10.0, acceleration_psd_m2_s3=1e-10)
    >>> cw.transition([[0.0] * 6], Step(0, 10.0)).shape
    (6, 6)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relnav_sim.astro.chief_orbit import ChiefOrbit as ChiefOrbit
    from relnav_sim.dynamics.averaged_j2 import schweighart_sedwick as schweighart_sedwick
    from relnav_sim.dynamics.clohessy_wiltshire import cw as cw
    from relnav_sim.dynamics.elliptic import yamanaka_ankersen as yamanaka_ankersen
    from relnav_sim.dynamics.quadratic import cw_second_order as cw_second_order
    from relnav_sim.dynamics.two_body import nonlinear as nonlinear
    from relnav_sim.dynamics.two_body_field import nonlinear_field as nonlinear_field
    from relnav_sim.dynamics.two_body_j2 import nonlinear_j2 as nonlinear_j2

# No module here may have one of these names: once imported, it would take the function's place.
_HOME = {
    "ChiefOrbit": "relnav_sim.astro.chief_orbit",
    "cw": "relnav_sim.dynamics.clohessy_wiltshire",
    "cw_second_order": "relnav_sim.dynamics.quadratic",
    "yamanaka_ankersen": "relnav_sim.dynamics.elliptic",
    "schweighart_sedwick": "relnav_sim.dynamics.averaged_j2",
    "nonlinear": "relnav_sim.dynamics.two_body",
    "nonlinear_j2": "relnav_sim.dynamics.two_body_j2",
    "nonlinear_field": "relnav_sim.dynamics.two_body_field",
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

"""relnav: Monte Carlo campaigns that tell which relative-navigation filter to fly."""

from __future__ import annotations

import importlib

TYPE_CHECKING = False  # `typing` would bring modules along before `python -m relnav_sim` has set its path right
if TYPE_CHECKING:
    from typing import Any

__version__ = "0.2.0"

_HOME = {
    "load_campaign": "campaign",
    "Campaign": "campaign",
    "CampaignError": "campaign",
    "run_campaign": "runner.run",
    "error_budget": "budget",
    "Budget": "budget",
    "simulate": "simulation.chunks",
    "Simulation": "simulation.chunks",
    "open_results": "results",
    "Results": "results",
    "load_ephemeris": "recorded",
    "Ephemeris": "recorded",
    "EphemerisError": "recorded",
    "regret": "statistics.regret",
    "Regret": "statistics.regret",
    "propagate": "truth",
    "ForceModel": "truth",
    "ExponentialAtmosphere": "truth",
    "GravityField": "astro.gravity_field",
    "LayeredAtmosphere": "astro.atmosphere",
    "Epoch": "astro.epoch",
    "eci_from_itrf": "astro.earth_orientation",
    "itrf_from_eci": "astro.earth_orientation",
    "rtn_from_eci": "astro.frames",
    "eci_from_rtn": "astro.frames",
    "create_filter": "filters.registry",
    "register_dynamics": "dynamics.registry",
    "register_filter": "filters.registry",
    "register_sensor": "sensors.registry",
    "run_filter": "filters.run",
    "FilterHistory": "filters.run",
    "smooth": "filters.smoother",
    "SmoothedHistory": "filters.smoother",
    "fit_gp_dynamics": "dynamics.gp.fit",
    "LinearDynamics": "dynamics.interface",
    "Step": "dynamics.interface",
    "LinearMeasurement": "measurements.linear",
    "FunctionMeasurement": "measurements.function",
    "MixtureNoise": "measurements.given_noise",
}

_ROOMS = ("dynamics", "measurements")
"""Packages that are public themselves: the built-in models, for own data."""

__all__ = sorted([*_HOME, *_ROOMS])


def __getattr__(name: str) -> Any:
    """Import a public name on its first use, so that `import relnav_sim` stays fast."""
    if name in _ROOMS:
        return importlib.import_module(f"relnav_sim.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'relnav_sim' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"relnav_sim.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])

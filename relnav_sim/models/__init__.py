"""The former home of dynamics and measurements, kept for packages written for relnav 0.1; it goes with 0.3."""

import warnings

warnings.warn(
    "relnav_sim.models goes with relnav 0.3; import from relnav_sim, relnav_sim.dynamics.interface or "
    "relnav_sim.measurements.interface instead",
    DeprecationWarning,
    stacklevel=2,
)

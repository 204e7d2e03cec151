"""The relative dynamics that a campaign can name."""

from __future__ import annotations

from relnav_sim.dynamics.averaged_j2 import SchweighartSedwickOptions
from relnav_sim.dynamics.clohessy_wiltshire import CwOptions
from relnav_sim.dynamics.elliptic import YamanakaAnkersenOptions
from relnav_sim.dynamics.gp.dynamics import GpOptions
from relnav_sim.dynamics.quadratic import CwSecondOrderOptions
from relnav_sim.dynamics.two_body import NonlinearOptions
from relnav_sim.dynamics.two_body_j2 import NonlinearJ2Options
from relnav_sim.options import Options

_KINDS: dict[str, type[Options]] = {
    "cw": CwOptions,
    "cw_second_order": CwSecondOrderOptions,
    "yamanaka_ankersen": YamanakaAnkersenOptions,
    "schweighart_sedwick": SchweighartSedwickOptions,
    "nonlinear": NonlinearOptions,
    "nonlinear_j2": NonlinearJ2Options,
    "gp": GpOptions,
}


def is_learned(options: Options) -> bool:
    """Return whether the dynamics of these options are learned from a track."""
    return isinstance(options, GpOptions)


def dynamics_kinds() -> dict[str, type[Options]]:
    """Return the options model of every dynamics kind by its name."""
    return dict(_KINDS)

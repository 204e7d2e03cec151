"""Small-matrix work in compiled loops, behind filters, dynamics, measurements and the truth.

Each file is a theme. Its functions are compiled by numba at their first call on a machine and read from a folder of
compiled code after that. They take and return arrays that lead with the runs, in C order, as everything in relnav does;
a run is an iteration of a loop, so its bits do not depend on which other runs are there. Inside, up to `LANES` runs
lie side by side as the last axis, so that one instruction of the processor serves several.

A module of them is plain Python, and what compiles is imported at the first call that needs it. `kernels.kalman.update
(...)` is how to call one; within `kernels.compiling.interpreted()` it runs as the plain Python that it is.

Examples:
    >>> import numpy as np
    >>> from relnav_sim import kernels
    >>> P = np.eye(2)[None]
    >>> kernels.kalman.predict(P, np.array([[[1.0, 1.0], [0.0, 1.0]]]), np.zeros((1, 2, 2))).tolist()
    [[[2.0, 1.0], [1.0, 1.0]]]
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relnav_sim.kernels import angles as angles
    from relnav_sim.kernels import atmosphere as atmosphere
    from relnav_sim.kernels import bound as bound
    from relnav_sim.kernels import budget as budget
    from relnav_sim.kernels import chief_orbit as chief_orbit
    from relnav_sim.kernels import components as components
    from relnav_sim.kernels import converted_radar as converted_radar
    from relnav_sim.kernels import counting as counting
    from relnav_sim.kernels import deputy as deputy
    from relnav_sim.kernels import distortion as distortion
    from relnav_sim.kernels import epochs as epochs
    from relnav_sim.kernels import field_forces as field_forces
    from relnav_sim.kernels import field_paths as field_paths
    from relnav_sim.kernels import forces as forces
    from relnav_sim.kernels import frame_error as frame_error
    from relnav_sim.kernels import frames as frames
    from relnav_sim.kernels import gp as gp
    from relnav_sim.kernels import gravity as gravity
    from relnav_sim.kernels import iekf as iekf
    from relnav_sim.kernels import joseph as joseph
    from relnav_sim.kernels import kalman as kalman
    from relnav_sim.kernels import lagged as lagged
    from relnav_sim.kernels import likelihood as likelihood
    from relnav_sim.kernels import maps as maps
    from relnav_sim.kernels import merging as merging
    from relnav_sim.kernels import normals as normals
    from relnav_sim.kernels import orbits as orbits
    from relnav_sim.kernels import particles as particles
    from relnav_sim.kernels import point_step as point_step
    from relnav_sim.kernels import proposal as proposal
    from relnav_sim.kernels import ranging as ranging
    from relnav_sim.kernels import relative_flow as relative_flow
    from relnav_sim.kernels import resampling as resampling
    from relnav_sim.kernels import reweighted_step as reweighted_step
    from relnav_sim.kernels import reweighting as reweighting
    from relnav_sim.kernels import roots as roots
    from relnav_sim.kernels import sample_step as sample_step
    from relnav_sim.kernels import sampling as sampling
    from relnav_sim.kernels import sight as sight
    from relnav_sim.kernels import sigma_points as sigma_points
    from relnav_sim.kernels import sky as sky
    from relnav_sim.kernels import spherical_harmonics as spherical_harmonics
    from relnav_sim.kernels import srif as srif
    from relnav_sim.kernels import statistics as statistics
    from relnav_sim.kernels import tangent as tangent
    from relnav_sim.kernels import two_step as two_step
    from relnav_sim.kernels import ud as ud


class CompilerError(ImportError):
    """What compiles the kernels can't be imported; the message says why."""


def __getattr__(name: str) -> Any:
    """Import a theme on its first use; it then is an attribute of the package."""
    try:
        return importlib.import_module(f"relnav_sim.kernels.{name}")
    except ModuleNotFoundError as error:
        if error.name != f"relnav_sim.kernels.{name}":
            raise
        raise AttributeError(f"module 'relnav_sim.kernels' has no attribute {name!r}") from None

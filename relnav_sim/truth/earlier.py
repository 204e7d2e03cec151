"""The same flight begun earlier: where both craft came from."""

from __future__ import annotations

from dataclasses import replace
from math import degrees

import numpy as np

from relnav_sim.astro.frames import eci_from_rtn, rtn_from_eci
from relnav_sim.astro.orbits import elements_from_state
from relnav_sim.truth.craft_options import ORBIT_STARTS, RELATIVE_STARTS
from relnav_sim.truth.dispersion_options import DispersionsOptions
from relnav_sim.truth.options import TruthOptions
from relnav_sim.truth.orbit_options import OrbitOptions
from relnav_sim.truth.relative_options import RelativeOptions
from relnav_sim.truth.stepping import Batch
from relnav_sim.truth.trajectory import force_model, nominal_relative

_TURNED = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])


def begun_earlier(options: TruthOptions, duration_s: float) -> TruthOptions:
    """Return the truth that begins `duration_s` before the nominal start and coasts there; nothing is dispersed.

    Time runs backwards for states with their velocities turned round, about a body that turns the other way, in air
    that drives instead of braking; what depends on the calendar does so at earlier and earlier times.

    Raises:
        ValueError: A craft would come from below the surface.
    """
    force = force_model(options)
    ballistic = np.array([options.chief.ballistic_m2_kg, options.deputy.ballistic_m2_kg])
    radiation = np.array([options.chief.radiation_m2_kg, options.deputy.radiation_m2_kg])
    chief = options.chief_state[None]
    normal = force.normal_acceleration(chief, ballistic[0], 0.0, radiation[0])
    deputy = eci_from_rtn(chief, nominal_relative(options), normal)
    backwards = Batch(
        np.concatenate([chief, deputy]) * _TURNED,
        replace(force, rotation_rad_s=-force.rotation_rad_s),
        -ballistic,
        radiation,
        rtol=1e-12,
        kept_steps=1,
        surface_m=force.radius_m,
        sense=-1.0,
    )
    turned = np.empty((2, 1, 6))
    backwards.write(np.array([duration_s]), turned)
    if not np.isfinite(turned).all():
        raise ValueError(f"{duration_s:g} s before the start a craft is below the surface")
    chief, deputy = turned[:, 0] * _TURNED
    relative = rtn_from_eci(chief, deputy, force.normal_acceleration(chief, ballistic[0], -duration_s, radiation[0]))
    elements = elements_from_state(chief, force.mu_m3_s2)
    orbit = OrbitOptions(
        a_km=float(elements.semi_major_axis_m) / 1e3,
        e=float(elements.eccentricity),
        i_deg=degrees(float(elements.inclination_rad)),
        raan_deg=degrees(float(elements.raan_rad)),
        argp_deg=degrees(float(elements.argument_of_perigee_rad)),
        ta_deg=degrees(float(elements.true_anomaly_rad)),
    )
    x, y, z, vx, vy, vz = relative.tolist()
    epoch = options.start_epoch
    start = RelativeOptions(position_m=(x, y, z), velocity_m_s=(vx, vy, vz))
    return options.model_copy(
        update={
            "epoch": None if epoch is None else epoch.later(-duration_s).text("TAI"),
            "chief": options.chief.model_copy(update={**dict.fromkeys(ORBIT_STARTS), "orbit": orbit}),
            "deputy": options.deputy.model_copy(
                update={**dict.fromkeys((*RELATIVE_STARTS, *ORBIT_STARTS)), "relative": start}
            ),
            "dispersions": DispersionsOptions(),
            "manoeuvres": {},
        }
    )

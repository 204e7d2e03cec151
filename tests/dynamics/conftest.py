"""Orbits and true relative motion for the dynamics' tests."""

from dataclasses import dataclass

import numpy as np
import pytest

from relnav_sim import ForceModel, eci_from_rtn, propagate, rtn_from_eci
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.constants import J2, J3, J4, MU_M3_S2, RADIUS_M
from relnav_sim.astro.kepler import initial_state
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions

NOISE = ProcessNoiseOptions(acceleration_psd_m2_s3=1e-8)


@dataclass(frozen=True)
class Scene:
    """A chief's orbit, started with the perigee at 7000 km, and deputies with its period."""

    orbit: ChiefOrbit
    noise: ProcessNoiseOptions = NOISE

    @property
    def period_s(self):
        return 2 * np.pi / self.orbit.mean_motion_rad_s

    def deputies(self, separation_m, runs=6, seed=1):
        """Return relative states (runs, 6) at about that separation, of the chief's energy."""
        rng = np.random.default_rng(seed)
        chief = initial_state(self.orbit)
        relative = rng.normal(size=(2, runs, 3))
        relative /= np.linalg.norm(relative, axis=2)[..., None]
        relative *= separation_m * np.array([1.0, 0.5 * self.orbit.mean_motion_rad_s])[:, None, None]
        relative = np.concatenate([*relative], axis=1)
        deputy = eci_from_rtn(chief, relative)
        speed2 = chief[3:] @ chief[3:] + 2 * MU_M3_S2 * (
            1 / np.linalg.norm(deputy[:, :3], axis=1) - 1 / np.linalg.norm(chief[:3])
        )
        deputy[:, 3:] *= (np.sqrt(speed2) / np.linalg.norm(deputy[:, 3:], axis=1))[:, None]
        return rtn_from_eci(chief, deputy)

    def truth(self, relative, times_s, zonals=()):
        """Return the chief (1, T, 6), ECI, and the true relative states (runs, T, 6)."""
        force = ForceModel(MU_M3_S2, RADIUS_M, zonals=zonals)
        start = initial_state(self.orbit)
        deputy = eci_from_rtn(start, relative, force.normal_acceleration(start))
        chief = propagate(start[None], times_s, force, rtol=1e-13)
        deputies = propagate(deputy, times_s, force, rtol=1e-13)
        return chief, rtn_from_eci(chief, deputies, force.normal_acceleration(chief))


@pytest.fixture
def scene():
    def make(e=0.0, i_deg=51.6, j2=J2, zonals=2):
        angles = np.radians([i_deg, 20.0, 40.0, 30.0])
        return Scene(ChiefOrbit(7e6 / (1 - e), e, *angles, MU_M3_S2, RADIUS_M, j2, J3, J4).up_to(zonals))

    return make

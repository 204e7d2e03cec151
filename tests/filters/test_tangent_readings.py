"""Every filter takes tangent readings, also with some missing: near the boresight as it takes azimuth and elevation."""

from __future__ import annotations

import numpy as np
import pytest

from relnav_sim import create_filter, run_filter
from relnav_sim import dynamics as motions
from relnav_sim.astro.line_of_sight import spherical_of
from relnav_sim.astro.tangent_plane import deflected, unit
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.measurements.sight import Sight
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar
from relnav_sim.measurements.tangent_sight import TangentSight

RUNS, EPOCHS, STEP_S = 4, 25, 5.0
SIGMAS = np.array([1.0, 1e-3, 1e-3])
NOISE = SightNoise(
    np.array([0.9, 0.1]), np.array([SIGMAS, 4 * SIGMAS]), SIGMAS, (3e-4) ** 2 * np.diag([1.0, 2.0, 3.0]), "mixture"
)
OWN = Sight(np.eye(3), "chief", None)
PLACE = np.array([5.0, 1500.0, -8.0, 0.0, 0.0, 0.0])  # 6 mrad off the boresight
KINDS = sorted(name for name, kind in filter_kinds().items() if not kind.learned_dynamics and name != "kf")


def readings():
    """The same errors as azimuth and elevation and as turns across the line of sight."""
    v = np.random.default_rng(31).normal(size=(RUNS, EPOCHS, 3)) * SIGMAS
    sight = tuple(np.moveaxis(np.broadcast_to(PLACE, (EPOCHS, 6))[..., :3] @ OWN.sensor_from_rtn.T, -1, 0))
    spherical = v + np.stack(spherical_of(sight), axis=-1)
    tangent = spherical.copy()
    _, tangent[..., 1], tangent[..., 2] = spherical_of(deflected(unit(sight), v[..., 1], v[..., 2]))
    for z in (spherical, tangent):
        z[1, 4:9] = np.nan
        z[2, 10:15, 1:] = np.nan
        z[3, 17, 0] = np.nan
    return spherical, tangent


@pytest.mark.parametrize("name", KINDS)
def test_every_filter_takes_them(name):
    fields = filter_kinds()[name].options_model.model_fields
    fewer = {key: 200 for key in ("samples", "particles") if key in fields}
    motion = motions.cw(mean_motion_rad_s=0.0011, step_s=STEP_S, acceleration_psd_m2_s3=1e-6)
    P0 = np.diag(np.square([3.0, 3.0, 3.0, 0.05, 0.05, 0.05]))
    spherical, tangent = (
        run_filter(create_filter(name, motion, model, **fewer), z, PLACE, P0, step_s=STEP_S)
        for model, z in zip((SphericalRadar(np.eye(3), NOISE), TangentSight(OWN, NOISE)), readings(), strict=True)
    )
    np.testing.assert_array_equal(tangent.dof, spherical.dof)
    assert not tangent.failures
    sigma = np.sqrt(np.diagonal(spherical.covariance, axis1=-2, axis2=-1))
    apart = np.abs((tangent.mean - spherical.mean) / sigma)
    if "particles" in fields:
        # A weight that rounds otherwise may draw another particle; from there on these are two samples of 200.
        assert np.median(apart[:, :5]) < 1e-3
        assert np.sqrt(np.square(apart).mean()) < 0.3
    else:
        assert apart.max() < 0.05
        np.testing.assert_allclose(tangent.nis, spherical.nis, rtol=0.03, atol=0.02)

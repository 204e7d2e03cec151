import numpy as np

from relnav_sim import create_filter, dynamics, measurements, run_filter
from replication.inverse.each_run import DynamicsOfEachRun, RadarOfEachRun


def test_runs_of_unlike_models_are_what_each_gives_alone() -> None:
    rng = np.random.default_rng(3)
    motions = [
        dynamics.cw(mean_motion_rad_s=n, step_s=h, acceleration_psd_m2_s3=psd)
        for n, h, psd in ((1.0e-3, 1.0, 1e-8), (1.1e-3, 7.0, 1e-6))
    ]
    sigmas = np.array([[1.0, 0.01, 0.01], [5.0, 0.001, 0.001]])
    m0 = np.array([[10.0, 500.0, 20.0, 0, 0, 0], [-40.0, -900.0, 60.0, 0, 0, 0]])
    P0 = np.diag([100.0] * 3 + [0.01] * 3)
    both = RadarOfEachRun(sigmas)
    z = both.predict(np.repeat(m0[:, None], 12, axis=1), 0) + sigmas[:, None] * rng.standard_normal((2, 12, 3))
    for name in ("ekf", "iekf", "ukf", "two_step"):
        found = run_filter(create_filter(name, DynamicsOfEachRun(motions), both), z, m0, P0).mean
        for run, motion in enumerate(motions):
            radar = measurements.radar(range_sigma_m=sigmas[run, 0], angle_sigma_deg=float(np.degrees(sigmas[run, 1])))
            alone = run_filter(create_filter(name, motion, radar), z[[run]], m0[[run]], P0).mean
            np.testing.assert_allclose(found[run], alone[0], rtol=1e-7, atol=1e-6)

"""The public home of the built-in models: their examples, their equality with a campaign's, and docs/own-data.md."""

import doctest
import importlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import relnav_sim
from relnav_sim import Step, dynamics, measurements
from relnav_sim.astro.epoch import Epoch
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions
from relnav_sim.dynamics.registry import dynamics_kinds

PAGE = Path(__file__).parents[1] / "docs" / "own-data.md"
ORBIT = dynamics.ChiefOrbit(7.0e6, 0.01, 0.9, 0.1, 0.2, 0.3)
PUBLIC = [(room, name) for room in (dynamics, measurements) for name in room.__all__]
MODELS = [(room.__name__, name) for room, name in PUBLIC if name != "ChiefOrbit"]


@pytest.mark.parametrize("room, name", MODELS)
def test_examples_run(room, name):
    function = getattr(importlib.import_module(room), name)
    (found,) = doctest.DocTestFinder(recurse=False).find(function, name, globs={})
    assert found.examples
    failures = []
    doctest.DocTestRunner().run(found, out=failures.append)
    assert not failures, "".join(failures)


def test_no_module_hides_a_public_name():
    for room, name in PUBLIC:
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module(f"{room.__name__}.{name}")
    assert relnav_sim.dynamics is dynamics and relnav_sim.measurements is measurements
    for room in (dynamics, measurements):
        with pytest.raises(AttributeError, match="no_such"):
            _ = room.no_such


def test_every_built_in_dynamics_has_a_function_that_gives_what_campaigns_build():
    x = np.array([[100.0, -5000.0, 300.0, 0.1, 0.2, -0.3]])
    given = {"step_s": 10.0, "acceleration_psd_m2_s3": 1e-8}
    epoch = Epoch.parse("2025-03-20T12:00:00 UTC")
    context = DynamicsContext(ORBIT, ProcessNoiseOptions(acceleration_psd_m2_s3=1e-8), 10.0, epoch=epoch)
    names = [name for name, options in dynamics_kinds().items() if options.__module__.startswith("relnav_sim.")]
    names.remove("gp")  # which `fit_gp_dynamics` makes
    for name in names:
        where = {"mean_motion_rad_s": ORBIT.mean_motion_rad_s} if name == "cw" else {"orbit": ORBIT}
        where |= {"epoch": epoch} if "epoch" in dynamics_kinds()[name].needs else {}
        own, built = getattr(dynamics, name)(**where, **given), dynamics_kinds()[name]().build(context)
        for step in (Step(0, 10.0), Step(3, 10.0)):
            assert np.array_equal(own.propagate(x, step), built.propagate(x, step)), name
            assert np.array_equal(own.process_noise(x, step), built.process_noise(x, step)), name
    n = ORBIT.mean_motion_rad_s
    own = dynamics.cw(mean_motion_rad_s=n, **given)
    np.testing.assert_array_equal(own.transition(x, Step(0)), cw_transition(n, 10.0))


def test_the_chief_s_own_states_take_the_nominal_orbit_s_place():
    from relnav_sim.dynamics.chief_segments import NominalChief

    nominal = NominalChief(ORBIT, 10.0)
    chief = np.concatenate([nominal.at(epoch) for epoch in range(-1, 3)])
    given = {"orbit": ORBIT, "step_s": 10.0, "acceleration_psd_m2_s3": 1e-8}
    x = np.array([[100.0, -5000.0, 300.0, 0.1, 0.2, -0.3]])
    own, by_orbit = dynamics.nonlinear_j2(**given, chief=chief), dynamics.nonlinear_j2(**given)
    for epoch in range(4):
        np.testing.assert_allclose(own.propagate(x, Step(epoch)), by_orbit.propagate(x, Step(epoch)), rtol=0, atol=1e-8)
    with pytest.raises(ValueError, match=r"chief has shape \(4, 5\); it must be \(T, 6\) or \(runs, T, 6\)"):
        dynamics.nonlinear_j2(**given, chief=chief[:, :5])


@pytest.mark.parametrize(
    "wrong, words",
    [
        ({"mean_motion_rad_s": 0.0}, "must be positive"),
        ({"step_s": -1.0}, "must be positive"),
        ({"acceleration_psd_m2_s3": -1e-8}, "from 0 up"),
        ({"acceleration_psd_m2_s3": np.nan}, "from 0 up"),
    ],
)
def test_what_is_no_model_is_refused(wrong, words):
    with pytest.raises(ValueError, match=words):
        dynamics.cw(**{"mean_motion_rad_s": 1e-3, "step_s": 1.0, "acceleration_psd_m2_s3": 1e-8} | wrong)
    with pytest.raises(ValueError, match="must be positive"):
        measurements.radar(range_sigma_m=0.0, angle_sigma_deg=1.0)
    with pytest.raises(ValueError, match="chief's nominal orbit"):
        measurements.radar(range_sigma_m=1.0, angle_sigma_deg=1.0, host="deputy")


@pytest.mark.parametrize(
    "wrong, words",
    [
        ({"semi_major_axis_m": 7000.0}, "semi_major_axis_m is 7000, within a body of 6.37814e+06 m"),
        ({"eccentricity": 1.2}, "eccentricity is 1.2; it must be from 0 to less than 1"),
        ({"raan_rad": np.nan}, "raan_rad is nan; it must be a finite number"),
    ],
)
def test_what_is_no_orbit_is_refused(wrong, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        replace(ORBIT, **wrong)


def test_what_gives_no_first_fix_is_refused():
    radar = measurements.radar(range_sigma_m=1.0, angle_sigma_deg=1.0)
    with pytest.raises(
        ValueError, match=r"z has shape \(3,\); it must be \(runs, 3\); for one measurement use z\[None\]"
    ):
        measurements.first_fix(radar, np.array([1000.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match="gives no position; take a radar"):
        measurements.first_fix(measurements.lidar(range_sigma_m=1.0), np.array([[1000.0]]))
    with pytest.raises(ValueError, match=r"z has shape \(1, 2\)"):
        measurements.first_fix(measurements.camera(angle_sigma_deg=1.0), np.zeros((1, 2)))


def test_the_page_filters_recorded_readings(tmp_path, monkeypatch):
    """What it prints is the estimate of measurements that are simulated here, consistent with its own covariance."""
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    rng = np.random.default_rng(3)
    n, T = 1.107e-3, 600
    F, x = cw_transition(n, 1.0), np.array([50.0, -2000.0, 100.0, 0.05, -0.1, 0.02])
    states = [x]
    for _ in range(T - 1):
        states.append(F @ states[-1])
    states = np.array(states)
    forward, right, down = states[:, 1], -states[:, 2], -states[:, 0]
    z = np.stack([np.linalg.norm(states[:, :3], axis=1), np.arctan2(right, forward)], axis=1)
    z = np.column_stack([z, np.arctan2(-down, np.hypot(forward, right))])
    z += rng.normal(size=z.shape) * [2.0, *np.radians([0.05, 0.05])]
    z[100:110] = np.nan
    np.savetxt(tmp_path / "readings.csv", z, delimiter=",", header="range_m,azimuth_rad,elevation_rad", comments="")
    monkeypatch.chdir(tmp_path)
    space = {}
    exec(code, space)  # the page's own words
    history = space["history"]
    error = history.mean[0] - states[1:]
    nis = history.nis[0][np.isfinite(history.nis[0])]
    assert len(nis) == T - 1 - 10
    # The mean of N chi-square values with 3 degrees of freedom: 3 +- 5 sqrt(6 / N).
    assert abs(nis.mean() - 3) < 5 * np.sqrt(6 / len(nis))
    final = error[-1] @ np.linalg.solve(history.covariance[0, -1], error[-1])
    assert final < 27.9  # chi-square with 6 degrees of freedom: 1e-4 beyond
    assert np.linalg.norm(error[-1, :3]) < 2.0

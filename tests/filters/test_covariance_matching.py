"""Process noise found during a run, on a linear problem whose noise is known."""

from dataclasses import replace

import numpy as np
import pytest

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, dynamics, measurements, run_filter
from relnav_sim.dynamics.clohessy_wiltshire import cw_system, cw_transition
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.white_noise import WhiteAcceleration
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.covariance_matching import CovarianceMatching, _told
from relnav_sim.filters.editing import edited
from relnav_sim.filters.editing_options import EditingOptions
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.measurements.partial import PartialMeasurement
from relnav_sim.streams import RandomSource

MEAN_MOTION, STEP_S, SIGMA_M = 1.1e-3, 10.0, 0.003
TRUE = np.array([1e-8, 3e-8, 5e-9])
PRIOR = np.diag([10.0] * 3 + [0.1] * 3) ** 2
AXES = ("radial", "along_track", "normal")
NAMES = tuple(f"{axis}_psd_m2_s3" for axis in AXES)
SINGLE = ("kf", "ekf", "iekf", "ukf", "ckf", "sr_ukf", "huber", "mckf", "student_t", "adaptive_alpha_kf")


def white(densities):
    base = LinearDynamics(cw_transition(MEAN_MOTION, STEP_S), np.zeros((6, 6)))
    return WhiteAcceleration(base, cw_system(MEAN_MOTION), densities, STEP_S)


def matching(kind, densities, window):
    motion, filter = white(densities), filter_kinds()[kind]
    measurement = PartialMeasurement(LinearMeasurement(np.eye(3, 6), SIGMA_M**2 * np.eye(3)), "")
    return CovarianceMatching(filter.factory(motion, measurement, filter.options_model()), motion, window)


def flight(runs, epochs, every=1):
    """Return true states (runs, T, 6) with the true process noise, and readings (runs, T, 3) at every so many steps."""
    rng = np.random.default_rng(8)
    F, root = (
        cw_transition(MEAN_MOTION, STEP_S),
        np.linalg.cholesky(white(TRUE).process_noise(np.zeros((1, 6)), Step(0))),
    )
    x, truth = rng.normal(size=(runs, 6)) @ np.sqrt(PRIOR), np.empty((runs, epochs, 6))
    for k in range(epochs):
        truth[:, k] = x = x @ F.T + rng.normal(size=(runs, 6)) @ root.T
    z = truth[..., :3] + SIGMA_M * rng.normal(size=(runs, epochs, 3))
    z[:, np.arange(epochs) % every > 0] = np.nan
    return truth, z


def densities(history):
    return np.stack([history.extras[name] for name in NAMES], axis=-1)


@pytest.mark.parametrize(
    ("start", "every"),
    [(0.1, 1), pytest.param(30.0, 1, marks=pytest.mark.slow), pytest.param(0.1, 3, marks=pytest.mark.slow)],
)
def test_a_known_density_is_found(start, every):
    """Mean of 100 runs over the last half within 10 %, whether readings come at every step or at every third."""
    epochs = 600 * every
    truth, z = flight(100, epochs, every)
    history = run_filter(matching("kf", start * TRUE, 50), z, np.zeros(6), PRIOR, step_s=STEP_S)
    last = slice(epochs // 2, None)
    assert np.allclose(np.nanmean(densities(history)[:, last], axis=(0, 1)) / TRUE, 1, atol=0.1)
    error = (history.mean - truth)[:, last]
    nees = np.einsum("bti,btij,btj->bt", error, np.linalg.inv(history.covariance[:, last]), error).mean() / 6
    assert 0.9 < nees < 1.1
    assert (np.linalg.eigvalsh(history.covariance[:, last]) > 0).all()


@pytest.mark.parametrize("kind", SINGLE)
def test_a_run_has_the_same_bits_in_any_block(kind):
    _, z = flight(7, 60)
    z[2, 10:14] = z[5, 30] = np.nan  # some runs are not read at some epochs
    of = [run_filter(matching(kind, TRUE, 20), part, np.zeros(6), PRIOR, step_s=STEP_S) for part in (z, z[2:3], z[4:])]
    for alone, runs in ((of[1], slice(2, 3)), (of[2], slice(4, None))):
        assert np.array_equal(alone.mean, of[0].mean[runs])
        assert np.array_equal(alone.covariance, of[0].covariance[runs])
        assert np.array_equal(densities(alone), densities(of[0])[runs], equal_nan=True)
    assert not np.array_equal(densities(of[0])[:, -1], np.tile(TRUE, (7, 1)))


def test_a_run_that_is_read_later_than_others_holds_up_none():
    """Where it has told nothing yet there is nothing to fit: to the bit as by itself, no singular matrix."""
    _, z = flight(3, 40)
    z[1, :5] = np.nan
    whole = run_filter(matching("kf", TRUE, 10), z, np.zeros(6), PRIOR, step_s=STEP_S)
    for run in range(3):
        alone = run_filter(matching("kf", TRUE, 10), z[run : run + 1], np.zeros(6), PRIOR, step_s=STEP_S)
        assert np.array_equal(whole.covariance[run], alone.covariance[0])


@pytest.mark.parametrize("action", ["inflate", "restart"])
def test_a_run_that_begins_anew_does_so_with_the_first_densities(action):
    """Beside another run that does not, and to the bit as by itself."""
    _, z = flight(2, 60)
    z[0, 40:] += 50.0
    options = EditingOptions(probability=0.9999, max_rejects=2, action=action)

    def run(part):
        return run_filter(edited(matching("ukf", TRUE, 10), options, None), part, np.zeros(6), PRIOR, step_s=STEP_S)

    both, alone = run(z), run(z[:1])
    assert np.array_equal(both.covariance[0], alone.covariance[0])
    acted = np.flatnonzero(both.edits_by[""]["actions"][0])
    assert len(acted) and acted[0] >= 41 and not both.edits_by[""]["actions"][1].any()
    found = densities(both)
    assert not np.array_equal(found[0, acted[0]], TRUE) and np.array_equal(found[0, acted[0] + 1], TRUE)


def test_the_score_is_the_derivative_of_the_likelihood():
    """And its variance the information: by finite differences and chi-square, on the exact linear problem."""
    runs, epochs = 400, 40
    _, z = flight(runs, epochs)

    def log_likelihood(densities):
        plain = LinearDynamics(cw_transition(MEAN_MOTION, STEP_S), white(densities).process_noise(None, Step(0)))
        measurement = LinearMeasurement(np.eye(3, 6), SIGMA_M**2 * np.eye(3))
        return run_filter(create_filter("kf", plain, measurement), z, np.zeros(6), PRIOR).log_likelihood.sum(axis=1)

    scores, information = np.zeros((runs, 3)), np.zeros((runs, 3))
    held = matching("kf", TRUE, 50)
    belief = held.start(Gaussian(np.zeros((runs, 6)), np.tile(PRIOR, (runs, 1, 1))), RandomSource(0, range(runs)))
    for k in range(epochs):
        belief = replace(held.predict(belief, Step(k, STEP_S)), densities=np.tile(TRUE, (runs, 1)))
        belief, _ = held.update(belief, z[:, k], Step(k, STEP_S))
        corrected = Gaussian(belief.mean, belief.covariance)
        score, told, made, moved = _told(belief.predicted, corrected, belief.made, belief.moved)
        scores, information = scores + score, information + told
        belief = replace(belief, predicted=corrected, made=made, moved=moved)  # counted: `predict` finds no correction
    for axis in range(3):
        off = np.where(np.arange(3) == axis, 1e-3 * TRUE, 0)
        slope = (log_likelihood(TRUE + off) - log_likelihood(TRUE - off)) / (2e-3 * TRUE[axis])
        assert np.allclose(scores[:, axis], slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max())
    # Mean 0 and variance 1 of what is close to normal: five standard errors of each.
    normal = scores / np.sqrt(information.mean(axis=0))
    assert (np.abs(normal.mean(axis=0)) < 5 / np.sqrt(runs)).all()
    assert (np.abs(np.square(normal).mean(axis=0) - 1) < 5 * np.sqrt(2 / runs)).all()


@pytest.mark.parametrize(
    "factor", [1e-3, *(pytest.param(one, marks=pytest.mark.slow) for one in (1e-4, 1e-2, 1e2, 1e3, 1e4))]
)
def test_the_start_is_forgotten(factor):
    """After some windows the densities are those of the same runs started right."""
    _, z = flight(20, 700)
    found = [
        densities(run_filter(matching("kf", start * TRUE, 30), z, np.zeros(6), PRIOR, step_s=STEP_S))[:, -100:]
        for start in (1.0, factor)
    ]
    assert np.allclose(found[1], found[0], rtol=0.05)


def test_the_filters_that_can():
    kinds = filter_kinds()
    assert all(kinds[name].matches_covariance for name in SINGLE)
    assert not any(kinds[name].matches_covariance for name in ("two_step", "particle", "imm", "gaussian_sum"))


NOISE = {"mean_motion_rad_s": MEAN_MOTION, "step_s": STEP_S}
START = dict(zip(NAMES, TRUE, strict=True))


@pytest.mark.parametrize(
    ("form", "refused"),
    [
        ({"adaptive": {"start": START, "window": 1}}, "window"),
        ({"adaptive": {"start": START}, "snc_rtn": START}, "exactly one of"),
        ({"dmc": {axis: {"sigma_m_s2": 1e-6, "tau_s": 100} for axis in AXES}}, "dmc: its three states"),
        ({}, "exactly one of"),
    ],
)
def test_process_noise_that_can_not_be_added_is_refused(form, refused):
    motion = dynamics.cw(mean_motion_rad_s=MEAN_MOTION, step_s=STEP_S, acceleration_psd_m2_s3=0.0)
    with pytest.raises(ValueError, match=f"filter 'ekf': process_noise.*{refused}"):
        create_filter("ekf", motion, measurements.relative_gnss(position_sigma_m=1.0), process_noise=NOISE | form)


def test_filters_and_states_that_can_not_have_it_are_refused():
    gnss, adaptive = measurements.relative_gnss(position_sigma_m=1.0), NOISE | {"adaptive": {"start": START}}
    motion = dynamics.cw(mean_motion_rad_s=MEAN_MOTION, step_s=STEP_S, acceleration_psd_m2_s3=0.0)
    with pytest.raises(ValueError, match=r"process_noise\.adaptive: this filter is not a single Gaussian"):
        create_filter("imm", motion, gnss, process_noise=adaptive)
    two, position = LinearDynamics(np.eye(2), np.eye(2)), LinearMeasurement(np.eye(1, 2), np.eye(1))
    with pytest.raises(ValueError, match="6 states; the dynamics have 2"):
        create_filter("kf", two, position, process_noise=adaptive)

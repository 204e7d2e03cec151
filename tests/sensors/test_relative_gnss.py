"""Relative GNSS: its readings, what filters are told of them, cycle slips, and what is refused."""

import numpy as np
import pytest
from scipy.stats import binom, chi2

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.campaign.problems import CampaignError
from relnav_sim.sensors import sensor_measurement
from relnav_sim.sensors.jumps import Jumps
from relnav_sim.simulation.block import simulate_block
from relnav_sim.simulation.chunks import chunks, told
from relnav_sim.streams import RandomSource, Streams
from relnav_sim.truth import nominal_chief

TEXT = """
name: relative_gnss
seed: 3
runs: 4
clock: {duration_s: 100, step_s: 1, store_every_s: 5}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  deputy:
    relative: {position_m: [50, -3000, 200], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 100
    area_m2: 1
    drag_coefficient: 2.2
  forces: {zonals: 4, drag: exponential}
sensors:
  relative_gnss: SENSOR
  gnss: {position_sigma_m: 30, velocity_sigma_m_s: 0.15}
start: {kind: first_fix, velocity_sigma_m_s: 0.5}
statistics: {settle_s: 20}
filters:
  kf: {kind: kf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-8}}
  ekf: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-9}}
"""
FORMS = {"relative_gnss": "cartesian"}
TAIL = 1e-4
DISPERSED = "start={kind: dispersed, position_sigma_m: [5, 5, 5], velocity_sigma_m_s: [0.1, 0.1, 0.1]}"


def campaign(sensor, *settings):
    return parse_campaign(TEXT.replace("SENSOR", sensor), list(settings))


def readings(config, runs, seed=3):
    """All readings (runs, T, m) as a filter takes them, and the true states (runs, T, 6)."""
    parts = list(chunks(config, RandomSource(seed, tuple(runs))))
    z = np.concatenate([told(part, FORMS, config)["relative_gnss"] for part in parts], axis=1)
    truth = np.concatenate([part.truth.relative for part in parts], axis=1)
    return z, np.broadcast_to(truth, (*z.shape[:2], 6))


def model(config, **told_of):
    return sensor_measurement("relative_gnss", config.sensors, nominal_chief(config.truth), 1.0, "cartesian", **told_of)


def in_bounds(squares, degrees):
    low, high = chi2.ppf([TAIL, 1 - TAIL], degrees)
    assert low < squares.sum() < high


@pytest.mark.parametrize(
    ("sensor", "settings"),
    [
        ("{solution: code}", []),
        ("{solution: carrier}", []),
        ("{solution: carrier, velocity_sigma_m_s: 0.002}", []),
        ("{solution: code, velocity_sigma_m_s: 0.0005}", ["sensors.gnss=null"]),
        ("{position_sigma_m: 0.3, velocity_sigma_m_s: 0.01, latency_s: 0.8}", [DISPERSED]),
    ],
)
def test_true_states_have_residuals_of_the_claimed_covariance(sensor, settings):
    """With the fix's errors in the frame, or none; the latency known."""
    config = campaign(sensor, *settings).cases[0].config
    z, truth = readings(config, range(40))
    believed = model(config)
    for epoch in (2, 50, 99):
        x = truth[:, epoch]
        nu = believed.residual(z[:, epoch], believed.predict(x, epoch))
        R = np.broadcast_to(believed.noise(x, epoch), (len(x), nu.shape[1], nu.shape[1]))
        in_bounds(np.einsum("ri,rij,rj->r", nu, np.linalg.inv(R), nu), nu.size)
        each = np.square(nu).sum(axis=0) / np.einsum("rii->ri", R).mean(axis=0)
        low, high = chi2.ppf([TAIL, 1 - TAIL], len(nu))
        assert ((low < each) & (each < high)).all()


def test_outliers_are_told_as_asked():
    config = campaign("{noise: {kind: mixture, scale: 10, fraction: 0.1}}").cases[0].config
    x = np.zeros((1, 6))
    for assumed, variance in (("nominal", 1.0), ("total", 0.9 + 10.0), ("mixture", 0.9 + 10.0)):
        R = model(config, assumed_noise=assumed).noise(x, 0)
        np.testing.assert_allclose(np.reshape(R, (-1, 3, 3))[0], variance * np.eye(3), rtol=1e-12)
    components = model(config, assumed_noise="mixture").mixture(x, 0)
    np.testing.assert_allclose(components.covariances.reshape(-1, 3, 3)[-1], 100 * np.eye(3), rtol=1e-12)


def test_a_slip_stays_until_the_ambiguities_are_fixed_anew():
    rate, refix_s, size_m = 120.0, 20.0, 5.0
    keys = f"slip_rate_per_hour: {rate}, refix_s: {refix_s}, slip_sigma_m: {size_m}"
    config = campaign(f"{{position_sigma_m: 1.0e-6, {keys}}}", "sensors.gnss=null").cases[0].config
    z, truth = readings(config, range(60))
    off = z - truth[..., :3]
    slipped = np.abs(off).max(axis=2) > 0.1
    # From epoch 20 on the share is stationary: no slip in the last 20 epochs has the probability exp(-20 / 30).
    share = 1 - np.exp(-rate * refix_s / 3600)
    assert abs(slipped[:, 20:].mean() - share) < 0.06
    # An error that is held in inertial axes turns in the orbit frame, by 5 mm in a second.
    begun = (np.abs(np.diff(off, axis=1)).max(axis=2) > 0.1) & slipped[:, 1:]
    low, high = binom.ppf([TAIL, 1 - TAIL], begun.size, -np.expm1(-rate / 3600))
    assert low <= begun.sum() <= high
    run, epoch = np.argwhere(begun)[0]
    np.testing.assert_allclose(off[run, epoch + 2], off[run, epoch + 1], atol=0.02)
    sizes = off[:, 1:][begun]
    in_bounds(np.square(sizes / size_m), sizes.size)


def test_jumps_do_not_depend_on_the_block_or_the_chunks():
    def jumps(runs):
        switches, sizes = (Streams([np.random.default_rng([run, which]) for run in runs]) for which in (0, 1))
        return Jumps(switches, sizes, 0.1, 7, 3)

    whole = jumps(range(5)).sample(90)
    parts = jumps([1, 4])
    np.testing.assert_array_equal(np.concatenate([parts.sample(k) for k in (1, 40, 3, 46)], axis=1), whole[[1, 4]])
    assert 0.2 < (whole != 0).any(axis=2).mean() < 0.8


def test_filters_go_by_it():
    """By kf too, as it is linear: consistent, and within a third of a metre of 1 m fixes."""
    case = campaign("{solution: code, velocity_sigma_m_s: 0.05}", "runs=20").cases[0]
    result = simulate_block(case, 3, range(20)).result
    assert not result.failures
    for name in ("kf", "ekf"):
        error, sigma = result.filters[name].error[:, -1, :6], result.filters[name].sigma[:, -1, :6]
        assert np.sqrt(np.square(error[:, :3]).sum(axis=1).mean()) < 0.8
        # Six correlated errors of 20 runs, each of the size claimed.
        ratio = np.square(error / sigma).mean()
        assert 0.6 < ratio < 1.5


def test_start_and_readings_do_not_depend_on_the_block():
    case = campaign("{velocity_sigma_m_s: 0.05, slip_rate_per_hour: 60}").cases[0]
    together = simulate_block(case, 3, range(4)).result
    alone = simulate_block(case, 3, [2]).result
    for name in ("kf", "ekf"):
        np.testing.assert_array_equal(alone.filters[name].error[0], together.filters[name].error[2])


def test_outside_its_limits_it_reads_nothing():
    config = campaign("{range_limits_m: [0, 2000]}").cases[0].config
    assert np.isnan(readings(config, range(2))[0]).all()


@pytest.mark.parametrize(
    ("sensor", "sentence"),
    [
        ("{host: deputy}", "host"),
        ("{solution: phase}", "solution"),
        ("{noise: {kind: gauss_markov, tau_s: 10}}", "needs a gaussian or mixture part"),
        (
            "{noise: [{kind: gaussian}, {kind: bias, value: [1, 1, 1, 1, 1, 1]}]}",
            "the bias has 6 values; this sensor has 3",
        ),
        ("{refix_s: 0}", "refix_s"),
    ],
)
def test_bad_input_is_said_in_a_sentence(sensor, sentence):
    with pytest.raises(CampaignError, match=sentence):
        campaign(sensor)

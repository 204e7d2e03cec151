"""Each source by itself: its part of a budget against the Monte Carlo in which nothing else is drawn."""

import numpy as np
import pytest
from scipy.stats import chi2
from small import Number, campaign, errors

from relnav_sim.budget import error_budget
from relnav_sim.budget.linearised import asked_numbers
from relnav_sim.budget.truth_errors import truth_numbers
from relnav_sim.campaign.load import parse_campaign

LOOKED_AT = (2, 10, 21, 40, 60)
# A filter that predicts about the chief's orbit as it estimates it, told of thrust by an accelerometer, 50 km away: its
# sensor needs no frame, so that GNSS acts through the prediction alone.
ABOUT_CHIEF = """
name: about_chief
seed: 7
runs: 10
clock: {duration_s: 60, step_s: 1, store_every_s: 5}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 30, argp_deg: 0, ta_deg: 40}
    mass_kg: 200
    area_m2: 1
  deputy:
    relative: {position_m: [-100, -50000, 3000], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 100
    area_m2: 1
  manoeuvres: {push: {time_s: 10, duration_s: 15, delta_v_m_s: [1, 3, 2]}}
sensors:
  crosslink: {range_sigma_m: 0.3, range_rate_sigma_m_s: 0.01}
  gnss: {position_sigma_m: 10, velocity_sigma_m_s: 1}
  accelerometer:
    host: deputy
    velocity_random_walk_m_s_sqrt_s: 3.0e-3
    bias_sigma_m_s2: 1.0e-3
    scale_factor_sigma_percent: 1
    deadband_m_s2: 3.0e-2
start: {kind: dispersed, position_sigma_m: [3, 5, 4], velocity_sigma_m_s: [0.1, 0.2, 0.1]}
filters:
  ekf: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-4}}
statistics: {settle_s: 30}
"""


def inside_band(squares, variances, runs):
    """Whether sums of squares over runs, each of its own chi-square law, are in one simultaneous 99.9 % band."""
    ratio = squares / variances
    low, high = chi2.ppf([0.0005 / ratio.size, 1 - 0.0005 / ratio.size], runs)
    return bool(((ratio > low) & (ratio < high)).all())


def compare(made, runs, wanted, noise=True):
    """Compare the sources with these words with the Monte Carlo; return how many there are."""
    budget = error_budget(made, filter="ekf")
    config = made.cases[0].config
    silent = Number("", 0)
    quiet = errors(made, "ekf", 1, lambda *_: False, nominal=False, number=silent)
    keys = {}
    for sensor, options in config.sensors.items():
        for place, channel in enumerate(options.channels):
            keys[sensor, channel.name] = (lambda *at, key=(sensor, place): at == key), silent
    for one in asked_numbers(config).normal:
        keys[one.sensor, one.word, one.place] = (lambda *_: False), Number(f"{one.sensor}.{one.word}", one.place)
    for one in truth_numbers(config, config.filters["ekf"]):
        keys[one.stream, one.place] = (lambda *_: False), Number(one.stream, one.place)
    named = {words(key): found for key, found in keys.items()}
    parts = {}  # white noise and correlated errors of a channel are drawn together
    for place, source in enumerate(budget.sources):
        bare = source.removeprefix("deputy ").removesuffix(" noise").partition(" correlated")[0]
        if bare in named and any(word in source for word in wanted):
            parts[bare] = parts.get(bare, 0.0) + budget.variance[place][list(LOOKED_AT)]
    for bare, variance in parts.items():
        kept, number = named[bare]
        error = errors(made, "ekf", runs, kept, nominal=False, number=number)
        squares = np.square(error - quiet)[:, LOOKED_AT].sum(axis=0)
        # Left out, as of second order: components whose sigma is below a tenth of the source's largest at any time.
        kinds = variance.reshape(-1, 2, 3)
        shown = (kinds > 1e-2 * kinds.max(axis=(0, 2), keepdims=True)).reshape(variance.shape)
        assert inside_band(squares[shown], variance[shown], runs), bare
        assert shown.any()
    return len(parts)


def words(key):
    """Return what the budget calls a number."""
    head, *rest = key
    if len(key) == 2 and isinstance(rest[0], str):
        return f"{head} {rest[0]}"
    name = head.removeprefix("truth.").replace(".", " ") if len(key) == 2 else f"{head} {rest[0]}"
    return f"{name} {rest[-1] + 1}" if rest[-1] else name


def test_the_chiefs_orbit_and_measured_thrust_are_those_of_the_monte_carlo():
    made = parse_campaign(ABOUT_CHIEF)
    assert error_budget(made, filter="ekf").not_covered == ()
    assert compare(made, 60, ("velocity_y", "bias 2")) == 2


@pytest.mark.slow
def test_the_chiefs_orbit_and_measured_thrust_are_those_of_500_runs():
    # Two of range and rate, six of GNSS, three each of the accelerometer's noise, bias and scale factor.
    assert compare(parse_campaign(ABOUT_CHIEF), 500, ("",)) == 17


@pytest.mark.slow
def test_execution_errors_dispersions_and_noise_are_those_of_500_runs():
    # Told of the plan and right about the velocity: else fixed errors of metres, times the part of the range that a
    # drawn number moves the deputy by, are of second order and more than the budget has late in the run.
    made = campaign(
        "sensors.radar={range_sigma_m: 2, angle_sigma_deg: 0.1}", "truth.deputy.relative.velocity_m_s=[0, 0, 0]"
    )
    assert compare(made, 500, ("",)) == 12 + 4 + 1


@pytest.mark.slow
def test_correlated_errors_are_those_of_500_runs():
    made = campaign("sensors.radar.noise=[{kind: gaussian}, {kind: gauss_markov, tau_s: 20, scale: 2}]")
    assert compare(made, 500, ("radar",)) == 3

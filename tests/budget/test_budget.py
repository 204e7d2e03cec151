"""Error budgets of campaigns: parts and total against Monte Carlo, and what a filter itself states."""

import numpy as np
import pytest
from scipy.stats import chi2
from small import campaign, errors

import relnav_sim
from relnav_sim.budget import error_budget

QUIET = ("truth.manoeuvres={}", "truth.dispersions={}")
LOOKED_AT = (2, 10, 21, 40, 60)


@pytest.fixture(scope="module")
def budgets():
    made = campaign()
    return {name: error_budget(made, filter=name) for name in ("ekf", "kf", "sr_ukf")}


@pytest.mark.parametrize("name", ["ekf", "kf", "sr_ukf"])
def test_the_parts_sum_to_the_total(budgets, name):
    budget = budgets[name]
    assert len(budget.sources) == len(set(budget.sources)) >= 12
    assert budget.variance.shape == (len(budget.sources), 61, 6)
    assert budget.total.shape == budget.formal.shape == (61, 6)
    np.testing.assert_allclose(budget.variance.sum(axis=0), budget.total, rtol=1e-10, atol=1e-12)


def inside_band(squares, variances, runs):
    """Whether sums of squares over runs, each of its own chi-square law, are in one simultaneous 99.9 % band."""
    ratio = squares / variances
    low, high = chi2.ppf([0.0005 / ratio.size, 1 - 0.0005 / ratio.size], runs)
    return bool(((ratio > low) & (ratio < high)).all())


CHANNELS = {
    **{("radar", place): f"radar {word}" for place, word in enumerate(("range", "azimuth", "elevation"))},
    **{("gnss", place): f"gnss {kind}_{axis}" for place, (kind, axis) in enumerate(
        (kind, axis) for kind in ("position", "velocity") for axis in "xyz")},
    **{("star_tracker", place): f"star_tracker {word}" for place, word in enumerate(("cross_1", "cross_2", "about"))},
}  # fmt: skip


def one_by_one(name, runs):
    """Compare each channel's noise by itself with the Monte Carlo in which nothing else errs."""
    made = campaign("sensors.radar.noise={kind: gaussian}", *QUIET)
    budget = error_budget(made, filter=name)
    quiet = errors(made, name, 1, lambda *_: False)
    compared = 0
    for key, words in CHANNELS.items():
        (place,) = (i for i, source in enumerate(budget.sources) if source == f"{words} noise")
        error = errors(made, name, runs, lambda *channel, key=key: channel == key) - quiet
        variance = budget.variance[place][list(LOOKED_AT)]
        squares = np.square(error[:, LOOKED_AT]).sum(axis=0)
        # To second order a noise of 1e-3 rad in angle is a shift of 3 mm along the line of sight, which no filter
        # averages away: left out are components whose sigma is below a tenth of the source's largest, centimetres.
        kinds = variance.reshape(-1, 2, 3)
        shown = (kinds > 1e-2 * kinds.max(axis=2, keepdims=True)).reshape(variance.shape)
        assert inside_band(squares[shown], variance[shown], runs), words
        compared += int(shown.any())
    assert compared == 12


def test_each_noise_by_itself_is_that_of_the_monte_carlo():
    one_by_one("ekf", 60)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ekf", "kf", "sr_ukf"])
def test_each_noise_by_itself_is_that_of_500_runs(name):
    one_by_one(name, 500)


def whole(name, runs, made):
    """Compare everything at once with the Monte Carlo."""
    budget = error_budget(made, filter=name)
    error = errors(made, name, runs, nominal=False)[:, LOOKED_AT] - budget.means.sum(axis=0)[list(LOOKED_AT)]
    drawn = budget.total - np.square(budget.means.sum(axis=0))
    variance = drawn[list(LOOKED_AT)]
    assert inside_band(np.square(error).sum(axis=0)[variance > 0], variance[variance > 0], runs)


@pytest.mark.parametrize("name", ["ekf", "kf", "sr_ukf"])
def test_the_total_is_that_of_the_monte_carlo(name):
    whole(name, 150, campaign())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ekf", "kf", "sr_ukf"])
def test_the_total_is_that_of_500_runs(name):
    whole(name, 500, campaign())


def test_a_dispersed_start_is_that_of_the_monte_carlo():
    start = "start={kind: dispersed, position_sigma_m: [30, 20, 10], velocity_sigma_m_s: [0.1, 0.2, 0.3]}"
    made = campaign(start)
    whole("ekf", 150, made)
    assert {"start position", "start velocity"} < set(error_budget(made, filter="ekf").sources)


def test_fixed_sources_are_what_is_left_when_nothing_is_drawn():
    made = campaign(*QUIET)
    budget = error_budget(made, filter="ekf")
    left = errors(made, "ekf", 1, lambda *_: False)[0]
    # To first order: the radar's constant error of 1 sigma in range is a part of its noise, which is off here.
    (place,) = (i for i, source in enumerate(budget.sources) if source == "radar range bias")
    expected = budget.means.sum(axis=0) - budget.means[place]
    np.testing.assert_allclose(left[5:, :3], expected[5:, :3], atol=0.02 * np.abs(expected[5:, :3]).max())


def test_matched_models_state_what_the_budget_says():
    """Without process noise, bias and neglected forces, the filter's covariance is the sum of the parts."""
    made = campaign(
        *QUIET,
        "sensors.radar={range_sigma_m: 2, angle_sigma_deg: 0.1}",
        "truth.forces={zonals: 2, drag: none}",
        "filters.ekf.dynamics={kind: nonlinear_j2}",
        "filters.ekf.process_noise.acceleration_psd_m2_s3=1.0e-15",
        "start={kind: dispersed, position_sigma_m: 30, velocity_sigma_m_s: 0.1}",
    )
    budget = error_budget(made, filter="ekf")
    # The filter is told of the frame's error for a circular orbit at the chief's semi-major axis; e = 0.001 here.
    np.testing.assert_allclose(budget.total, budget.formal, rtol=0.01)


def test_halving_a_source():
    made = campaign("sensors.radar={range_sigma_m: 2, angle_sigma_deg: 0.1, azimuth_bias_deg: 0.02}", *QUIET)
    budget = error_budget(made, filter="kf")
    halved = dict(zip(budget.sources, budget.halved(), strict=True))
    less = campaign("sensors.radar={range_sigma_m: 2, angle_sigma_deg: 0.1, azimuth_bias_deg: 0.01}", *QUIET)
    # Measurements are taken about the biased ones: 3.5e-4 rad to second order.
    np.testing.assert_allclose(halved["radar azimuth bias"][1:], error_budget(less, filter="kf").total[1:], rtol=3e-4)
    place = budget.sources.index("radar range noise")
    np.testing.assert_allclose(halved["radar range noise"], budget.total - 0.75 * budget.variance[place], rtol=1e-12)
    np.testing.assert_array_equal(halved["interaction of fixed sources"], budget.total)


def test_a_gate_is_left_out_and_named():
    made = campaign(*QUIET, "filters.ekf.gate_probability=0.5")
    gated, free = error_budget(made, filter="ekf"), error_budget(campaign(*QUIET), filter="ekf")
    np.testing.assert_array_equal(gated.total, free.total)
    assert gated.not_covered == ("measurements that the gate rejects",)


@pytest.mark.parametrize("kind", ["ekf", "ud_ekf", "srif"])
def test_the_gain_of_a_filter_in_float32_is_not_read_off_rounded_readings(kind):
    """At 200 km float32 holds a range to 0.016 m only, a sixth of this sigma."""
    far = ("truth.deputy.relative.position_m=[0, -200000, 100]", "sensors.radar.range_sigma_m=0.1")
    made = campaign(*QUIET, *far, f"filters.single={{kind: {kind}, arithmetic: float32, dynamics: {{kind: cw}}}}",
                    f"filters.double={{kind: {kind}, dynamics: {{kind: cw}}}}")  # fmt: skip
    single, double = (error_budget(made, filter=name) for name in ("single", "double"))
    np.testing.assert_array_equal(single.total, double.total)
    assert "rounding in float32: the filter counts as one in float64" in single.not_covered
    assert not any("float32" in words for words in double.not_covered)


def test_what_is_not_in_it_is_named():
    noise = "sensors.radar.noise=[{kind: gaussian}, {kind: outage, rate_per_hour: 60, mean_duration_s: 5}]"
    made = campaign(
        noise,
        "sensors.radar.latency_s=0.1",
        "filters.ekf.assumed_latency=none",
        "filters.ekf.dynamics={kind: nonlinear_j2}",
        "start={kind: dispersed, position_sigma_m: 9, velocity_sigma_m_s: 1}",
    )
    assert error_budget(made, filter="ekf").not_covered == (
        "random outages of radar: its measurements count as there",
        "the latency of radar, of which the filter is not told",
    )


def test_filters_whose_gain_depends_on_the_readings_are_refused_by_name():
    made = campaign()
    with pytest.raises(ValueError, match="filter 'huber' has no error budget: its gain depends on the measurements"):
        error_budget(made, filter="huber")
    with pytest.raises(ValueError, match="there is no filter 'ekg'; there are ekf, kf, sr_ukf, huber"):
        error_budget(made, filter="ekg")
    with pytest.raises(IndexError, match="there is no case 3"):
        error_budget(made, case=3)
    assert error_budget(made).filter == "ekf"


def test_a_filter_that_its_arithmetic_fails_has_no_budget():
    unequal = ("filters.srif={kind: srif, dynamics: {kind: cw}}", "start.velocity_sigma_m_s=1e9")
    with pytest.raises(
        ValueError, match="'srif' has no error budget: it fails on the nominal truth at 1 s: srif holds"
    ):
        error_budget(campaign(*unequal), 0, "srif")


def test_process_noise_that_is_found_from_the_readings_has_no_budget():
    start = "{radial_psd_m2_s3: 1.0e-8, along_track_psd_m2_s3: 1.0e-8, normal_psd_m2_s3: 1.0e-8}"
    made = campaign(f"filters.ekf.process_noise={{adaptive: {{start: {start}}}}}")
    with pytest.raises(ValueError, match="filter 'ekf' has no error budget: its gain depends on the measurements"):
        error_budget(made, filter="ekf")


def test_it_is_public():
    assert relnav_sim.error_budget is error_budget

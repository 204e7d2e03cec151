"""Warnings of whole campaigns: from the nominal trajectory before the run, from the flown truth after it."""

from pathlib import Path

import numpy as np
import pytest

from relnav_sim.campaign.idle_options import idle_options
from relnav_sim.campaign.implausible import implausible_values
from relnav_sim.campaign.load import load_campaign, parse_campaign
from relnav_sim.campaign.warnings import campaign_warnings, flown_warnings
from relnav_sim.sensors.noise.gauss_markov import GaussMarkovNoise
from relnav_sim.sensors.noise.process import NoiseSetting
from relnav_sim.streams import RandomSource

ELLIPSE = """
name: ellipse
seed: 1
runs: 2
clock: {duration_s: 2400, step_s: 1, store_every_s: 10}
truth:
  chief: {orbit: {a_km: 6978.137, e: 0, i_deg: 50}, mass_kg: 1, area_m2: 1}
  deputy: {relative: {position_m: [200, 0, 0], velocity_m_s: [0, -0.43324, 0.21662]}, mass_kg: 1, area_m2: 1}
  forces: {zonals: 0, drag: none}
sensors:
  radar: {range_sigma_m: 1, angle_sigma_deg: 0.05, host: HOST}
filters:
  ekf: {kind: ekf, process_noise: {acceleration_psd_m2_s3: 1.0e-9}}
"""


@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_the_safety_ellipse_leaves_the_axis_when_it_should(host):
    """x = 200 cos nt, y = -400 sin nt, z = 200 sin nt: 5 deg from x where sqrt(5) tan nt = tan 5 deg, at 36 s."""
    campaign = parse_campaign(ELLIPSE.replace("HOST", host))
    (sentence,) = campaign_warnings(campaign)
    assert "azimuth axis from 0 to 36 s, nearest 0 deg" in sentence
    n, t = 1.0831e-3, np.arange(0, 2401, 10.0)
    c, s = np.cos(n * t), np.sin(n * t)
    flown = np.stack([200 * c, -400 * s, 200 * s, -200 * n * s, -400 * n * c, 200 * n * c], axis=-1)[None]
    (after,) = flown_warnings(campaign.content, [("base", {}, t, flown, {"ekf": ()})])
    assert "azimuth axis from 0 to 30 s, nearest 0 deg" in after


def test_cases_are_named_where_they_differ():
    text = ELLIPSE.replace("HOST", "chief") + "grid: {sensors.radar.range_sigma_m: [1, 500]}\n"
    found = campaign_warnings(parse_campaign(text))
    assert found[0].startswith("The line of sight is within 5 deg")
    assert found[1].startswith("In case sensors.radar.range_sigma_m=500: About ")
    campaign = parse_campaign(text)
    t, flown = np.array([0.0, 10.0]), np.tile([200.0, 0, 0, 0, -0.43, 0.2], (1, 2, 1))
    cases = [(case.label, case.variables, t, flown, {"ekf": ()}) for case in campaign.cases]
    assert [sentence[:40] for sentence in flown_warnings(campaign.content, cases)] == [s[:40] for s in found]


def test_a_start_without_a_reading_and_a_fall_are_said_before_the_run():
    text = ELLIPSE.replace("HOST", "chief, range_limits_m: [210, 900]")
    assert [s for s in campaign_warnings(parse_campaign(text)) if "first_fix" in s] == [
        "The radar gives no position at 0 s, where start.kind first_fix needs one: every run would fail; take "
        "start.kind dispersed or given."
    ]
    down = "  manoeuvres: {down: {time_s: 60, delta_v_m_s: [0, -200, 0]}}\nsensors:"
    found = campaign_warnings(parse_campaign(ELLIPSE.replace("HOST", "chief").replace("sensors:", down)))
    assert found[0].startswith("In the nominal trajectory the deputy falls to the Earth at ")


IDLE = ELLIPSE.replace("HOST", "chief").replace("  forces: {zonals: 0, drag: none}\n", "  forces: {FORCES}\nMORE")
AIR = "atmosphere: {density_kg_m3: 1.0e-12}"
TURNED = "  earth_orientation: {ut1_utc_s: -0.1}\n"
DATE = "  epoch: 2026-01-01T00:00:00 UTC\n"


@pytest.mark.parametrize(
    ("forces", "more", "sentence"),
    [
        (f"drag: layers, {AIR}", "", "truth.forces.atmosphere has no effect with drag: layers, as the layers have"),
        (f"drag: none, {AIR}", "", "truth.forces.atmosphere has no effect with drag: none, as there is no drag"),
        ("drag: exponential", TURNED, "truth.earth_orientation has no effect, as the campaign has no date"),
        ("drag: exponential", TURNED + DATE, "truth.earth_orientation has no effect, as nothing depends on how"),
        (f"drag: exponential, {AIR}", DATE, None),
        ("gravity: {model: ggm05s, degree: 4}", TURNED + DATE, None),
    ],
)
def test_options_without_effect_are_told(forces, more, sentence):
    found = campaign_warnings(parse_campaign(IDLE.replace("FORCES", forces).replace("MORE", more)))
    idle = [each for each in found if "no effect" in each]
    assert len(idle) == (sentence is not None)
    assert sentence is None or idle[0].startswith(sentence)


@pytest.mark.parametrize(
    ("noise", "said"),
    [
        ("{kind: outage, windows_s: [[10, 20], [9000, 9500]]}", ["outage from 9000 to 9500 s"]),
        ("{kind: outage, windows_s: [[10, 20]], rate_per_hour: 1, mean_duration_s: 9}", []),
        ("{kind: ramp, rate_per_s: 1, from_s: 7000}", ["ramp from 7000 s"]),
        ("{kind: stuck, from_s: 50, until_s: 7000}", []),
    ],
)
def test_what_happens_after_the_end_of_the_run_is_told(noise, said):
    text = ELLIPSE.replace("HOST", "chief")
    text = text.replace("radar: {", f"radar: {{noise: [{{kind: gaussian}}, {noise}], ")
    found = [each for each in campaign_warnings(parse_campaign(text)) if "no effect" in each]
    end_s = parse_campaign(text).cases[0].config.clock.duration_s
    assert found == [f"sensors.radar.noise: the {what} has no effect, as the run ends at {end_s:g} s." for what in said]


def test_what_happens_after_the_end_of_a_stressed_run_is_told_before_it_is_flown():
    late = "[{kind: gaussian}, {kind: outage, windows_s: [[9000, 9500]]}]"
    campaign = parse_campaign(ELLIPSE.replace("HOST", "chief") + f"stress: {{dark: {{sensors.radar.noise: {late}}}}}\n")
    for flown in (campaign, campaign.with_stress()):
        (found,) = [each for each in campaign_warnings(flown) if "no effect" in each]
        assert found.startswith("In case") and "stress=dark" in found and "outage from 9000 to 9500 s" in found


def test_numbers_that_no_flight_has_are_told_with_their_unit():
    content = {
        "sensors": {"radar": {"range_sigma_m": 2e9, "range_limits_m": [0, float("inf")], "latency_s": 1e9}},
        "filters": {"ekf": {"process_noise": {"acceleration_psd_m2_s3": 1e60}, "alpha": 1e300}},
        "grid": {"start.velocity_sigma_m_s": [1.0, 3e5]},
    }
    assert implausible_values(content) == [
        "sensors.radar.range_sigma_m: 2e+09 m is implausibly large; check the unit.",
        "filters.ekf.process_noise.acceleration_psd_m2_s3: 1e+60 m^2/s^3 is implausibly large; check the unit.",
        "grid.start.velocity_sigma_m_s: 300000 m/s is implausibly large; check the unit.",
    ]


def test_a_correlation_time_without_end_is_a_bias_and_no_slip():
    """Ten days of noise with tau = 1e12 s change by sqrt(2 t / tau) = 0.13 % of sigma, root mean square."""
    part = GaussMarkovNoise(tau_s=1e12)
    noise = "[{kind: gaussian}, {kind: gauss_markov, tau_s: 1.0e12}, {kind: outage, windows_s: [[2000, 1.0e12]]}]"
    text = ELLIPSE.replace("HOST", "chief").replace(
        "radar: {", f"radar: {{range_limits_m: [0, 1.0e12], noise: {noise}, "
    )
    assert implausible_values(parse_campaign(text).content) == []
    assert implausible_values({"grid": {"sensors.radar.noise.1.tau_s": [1e12]}, "clock": {"step_s": 1e12}}) == [
        "clock.step_s: 1e+12 s is implausibly large; check the unit."
    ]
    starts = {"radar": {"windows_s": [[1e12, 2e12]], "range_limits_m": [1e15, 1e16]}}
    assert implausible_values({"sensors": starts}) == [
        "sensors.radar.windows_s: 1e+12 s is implausibly large; check the unit.",
        "sensors.radar.range_limits_m: 1e+15 m is implausibly large; check the unit.",
    ]
    setting = NoiseSetting("noise", RandomSource(1, tuple(range(50))), 1, 864.0)
    drawn = part.process(setting).sample(864.0 * np.arange(1000))
    assert np.std(drawn[:, 0]) == pytest.approx(1, abs=0.3)
    assert np.sqrt(np.mean(np.square(drawn[:, -1] - drawn[:, 0]))) == pytest.approx(np.sqrt(2 * 863136 / 1e12), rel=0.3)


def test_no_campaign_that_comes_with_relnav_has_idle_options():
    for path in sorted((Path(__file__).parents[2] / "campaigns").glob("*.yaml")):
        campaign = load_campaign(path)
        assert [idle_options(case.config) for case in campaign.cases] == [[]] * len(campaign.cases), path.name
        assert implausible_values(campaign.content) == [], path.name

"""Process noise in campaigns: correlated and found, what is refused, and the example of docs/process-noise.md."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from small_campaign import TEXT

from relnav_sim import CampaignError, create_filter, dynamics, load_campaign, run_filter, simulate
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.sensors import sensor_measurement
from relnav_sim.simulation.block import simulate_block
from relnav_sim.simulation.campaign_filter import create_campaign_filter
from relnav_sim.truth import nominal_chief
from relnav_sim.tuning.scalars import free_scalars, with_values

PAGE = Path(__file__).parents[2] / "docs" / "process-noise.md"
PLAIN = TEXT[: TEXT.index("grid:")].replace("sigma_deg: 0.1}", "sigma_deg: 0.1, noise: {kind: gaussian}}")
DENSITIES = "{radial_psd_m2_s3: 1.0e-8, along_track_psd_m2_s3: 1.0e-8, normal_psd_m2_s3: 1.0e-8}"
ADAPTIVE = f"{{adaptive: {{window: 10, start: {DENSITIES}}}}}"


def dmc(sigma_m_s2, tau_s):
    axis = f"{{sigma_m_s2: {sigma_m_s2}, tau_s: {tau_s}}}"
    return f"{{dmc: {{radial: {axis}, along_track: {axis}, normal: {axis}}}}}"


def campaign(tmp_path, filters, text=PLAIN):
    path = tmp_path / "noise.yaml"
    entries = "".join(f"  {name}: {{{entry}}}\n" for name, entry in filters.items())
    path.write_text(text[: text.index("filters:")] + "filters:\n" + entries)
    return load_campaign(path)


def block(found, runs):
    return simulate_block(found.cases[0], found.seed, runs).result


@pytest.mark.parametrize("kind", ["kf", "ekf", "ukf"])
def test_a_short_correlation_is_white_acceleration(tmp_path, kind):
    """S = 2 sigma^2 tau: the error differs from that of white acceleration in the order of tau over the step of 1 s."""
    found = campaign(
        tmp_path,
        {
            "white": f"kind: {kind}, process_noise: {{snc_rtn: {DENSITIES}}}",
            "short": f"kind: {kind}, process_noise: {dmc(0.07071067811865475, 1.0e-6)}",
        },
    )
    filters = block(found, range(4)).filters
    white, short = filters["white"].error, filters["short"].error
    assert np.allclose(short, white, rtol=0, atol=1e-5 * np.abs(white).max())
    assert filters["short"].augmented.names == tuple(f"unmodelled_acceleration_{axis}" for axis in "xyz")


@pytest.mark.parametrize("noise", [ADAPTIVE, dmc(5.0e-6, 100)])
def test_a_run_has_the_same_bits_in_any_block(tmp_path, noise):
    found = campaign(tmp_path, {kind: f"kind: {kind}, process_noise: {noise}" for kind in ("kf", "ekf", "sr_ukf")})
    whole, part = block(found, range(5)), block(found, range(3, 5))
    for kind, filter in whole.filters.items():
        for name in ("error", "sigma", "nis", "nees"):
            own, other = getattr(filter, name), getattr(part.filters[kind], name)
            assert np.array_equal(own[3:], other, equal_nan=True), (kind, name)


@pytest.mark.parametrize("kind", ["two_step", "particle", "unscented_particle", "imm", "gaussian_sum"])
def test_what_has_no_single_gaussian_is_refused_by_name(tmp_path, kind):
    with pytest.raises(CampaignError, match=rf"process_noise\.adaptive: the {kind} filter is not a single Gaussian"):
        campaign(tmp_path, {"x": f"kind: {kind}, process_noise: {ADAPTIVE}"})


@pytest.mark.parametrize("noise", [ADAPTIVE, dmc(5.0e-6, 100)])
def test_learned_dynamics_have_their_own(tmp_path, noise):
    with pytest.raises(CampaignError, match="gp dynamics have learned a process noise of their own"):
        campaign(tmp_path, {"x": f"kind: ekf, dynamics: {{kind: gp}}, process_noise: {noise}"})


def test_all_numbers_are_free(tmp_path):
    filters = {"snc": f"{{snc_rtn: {DENSITIES}}}", "dmc": dmc(5.0e-6, 100), "found": ADAPTIVE}
    loaded = campaign(tmp_path, {name: f"kind: ekf, process_noise: {noise}" for name, noise in filters.items()})
    free = free_scalars(loaded)
    assert {name: len(scalars) for name, scalars in free.items()} == {"snc": 3, "dmc": 6, "found": 4}
    (window,) = (scalar for scalar in free["found"] if scalar.path[-1] == "window")
    entry = with_values(loaded.cases[0].config.filters["found"], {window.path: window.value(0.5)})
    assert with_values(entry, {window.path: 30.0}).process_noise.adaptive.window == 30
    assert entry.process_noise.adaptive.window == 55  # half way from 10 to 300 on a logarithmic scale


def test_the_example_of_the_page(tmp_path):
    page = PAGE.read_text(encoding="utf-8")
    path = tmp_path / "process_noise.yaml"
    path.write_text(re.search(r"```yaml\n(name: .*?)```", page, re.DOTALL)[1])
    found = load_campaign(path)
    filters = block(found, range(found.runs)).filters
    rows = re.findall(r"^\| `(\w+)` \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", page, re.MULTILINE)
    assert [name for name, *_ in rows] == list(filters)
    for name, *printed in rows:
        summary = filters[name].summary
        settled = 1
        position, velocity = summary["rms"][:, settled, 6:].mean(axis=0)
        means = position, velocity, summary["anees"][:, settled, 0].mean()
        assert [f"{mean:.4g}" for mean in means] == printed


@pytest.mark.parametrize("noise", [ADAPTIVE, f"{{snc_rtn: {DENSITIES}}}", "{acceleration_psd_m2_s3: 1.0e-9}"])
def test_a_filter_by_hand_has_the_bits_of_the_campaigns(tmp_path, noise):
    found = campaign(tmp_path, {"x": f"kind: ekf, process_noise: {noise}"})
    config, entry = found.cases[0].config, found.cases[0].config.filters["x"]
    orbit, step_s = nominal_chief(config.truth), config.clock.step_s
    theirs = create_campaign_filter(entry, config, DynamicsContext(orbit, entry.process_noise, step_s)).filter
    own = create_filter(
        "ekf",
        dynamics.cw(mean_motion_rad_s=orbit.mean_motion_rad_s, step_s=step_s, acceleration_psd_m2_s3=0.0),
        {"radar": sensor_measurement("radar", config.sensors, orbit, step_s, frame="told")},
        process_noise={"mean_motion_rad_s": orbit.mean_motion_rad_s, "step_s": step_s, **yaml.safe_load(noise)},
    )
    z = {"radar": simulate(found, runs=range(2)).z["radar"]}
    prior = np.array([0.0, -2000, 100, 0, 0, 0]), np.diag([100.0] * 3 + [1.0] * 3) ** 2
    one, other = (run_filter(each, z, *prior, step_s=step_s) for each in (theirs, own))
    assert np.isfinite(one.mean).all() and one.nis.any()
    assert np.array_equal(one.mean, other.mean) and np.array_equal(one.covariance, other.covariance)
    assert set(one.extras) == set(other.extras)


def test_the_python_of_the_page():
    made: dict = {}
    exec(re.search(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[1], made)
    assert made["history"].extras["radial_psd_m2_s3"][0, -1] < 1e-8  # of a craft at rest

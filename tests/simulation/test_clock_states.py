"""A crosslink in campaigns: consistent filters, clocks that are found or accounted for, and what is refused."""

import numpy as np
import pytest
from scipy.stats import chi2

from relnav_sim import CampaignError, load_campaign
from relnav_sim.simulation.augmented_states import true_augmented_states
from relnav_sim.simulation.block import simulate_block
from relnav_sim.simulation.chunks import chunks
from relnav_sim.streams import RandomSource

RUNS = 20
LINK = (
    "{kind: crosslink, range_sigma_m: 0.3, range_rate_sigma_m_s: 2.0e-3, clock_bias_sigma_m: 3, "
    "clock_drift_sigma_m_s: 2.0e-3}"
)
CLOCK = "{kind: clock, sigma_m: 3, drift_sigma_m_s: 2.0e-3"
# On a relative ellipse, one revolution, with a truth that the filter's dynamics follow exactly and a good start.
WHOLE = f"""
name: link
seed: 3
runs: {RUNS}
clock: {{duration_s: 5600, step_s: 10, store_every_s: 200}}
truth:
  chief:
    orbit: {{a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}}
    mass_kg: 200
    area_m2: 1
  deputy:
    relative: {{position_m: [500, 0, 400], velocity_m_s: [0.2, -1.10682, 0.3]}}
    mass_kg: 100
    area_m2: 1
  forces: {{zonals: 2, drag: none}}
sensors:
  link: {LINK}
start: {{kind: dispersed, position_sigma_m: 1, velocity_sigma_m_s: 1.0e-3}}
statistics: {{settle_s: 1000}}
"""


def campaign(tmp_path, filters, text=WHOLE):
    path = tmp_path / "link.yaml"
    path.write_text(text + "filters:\n" + filters)
    return load_campaign(path)


def entry(name, augment="[]", more=""):
    return (
        f"  {name}: {{kind: ekf, dynamics: {{kind: nonlinear_j2}}, "
        f"process_noise: {{acceleration_psd_m2_s3: 1.0e-16}}, augment: {augment}{more}}}\n"
    )


def test_clocks_are_found_or_accounted_for(tmp_path):
    entries = (
        entry("ignoring") + entry("estimating", f"[{CLOCK}}}]") + entry("considering", f"[{CLOCK}, mode: consider}}]")
    )
    outcome = simulate_block(campaign(tmp_path, entries).cases[0], 3, range(RUNS))
    assert not outcome.broken and not outcome.result.failures
    found = outcome.result.filters
    # Half the epochs apart the errors of a run are still correlated, so one epoch counts.
    low, high = chi2.ppf([0.0005, 0.9995], 6 * RUNS) / (6 * RUNS)
    for k in (10, 20, -1):
        anees = {name: found[name].nees[:, k].mean() / 6 for name in found}
        assert low < anees["estimating"] < high and low < anees["considering"] < high
    assert anees["ignoring"] > 10 * high
    nis = found["estimating"].nis[:, 1:]
    low, high = chi2.ppf([0.0005, 0.9995], 2 * nis.size)
    assert low < nis.sum() < high
    clock = found["estimating"].augmented
    assert (clock.names, clock.units) == (("clock_bias", "clock_drift"), ("m", "m/s"))
    low, high = chi2.ppf([0.0005, 0.9995], RUNS)
    for k in (10, 20, -1):
        z = clock.error[:, k] / clock.sigma[:, k]
        assert ((low < np.square(z).sum(axis=0)) & (np.square(z).sum(axis=0) < high)).all()
    assert (clock.sigma[:, -1] < np.array([0.2, 0.02]) * [3, 2e-3]).all()  # and they were found
    considered = found["considering"].augmented
    assert (considered.estimate == 0).all()
    t = np.arange(0, 5601, 200)
    np.testing.assert_allclose(considered.sigma[..., 1], 2e-3, rtol=1e-6)
    np.testing.assert_allclose(considered.sigma[..., 0], np.tile(np.hypot(3, 2e-3 * t), (RUNS, 1)), rtol=1e-6)


def test_the_true_clock_is_that_of_each_run(tmp_path):
    config = campaign(tmp_path, entry("ekf", f"[{CLOCK}, sensor: link}}]")).cases[0].config
    source = RandomSource(3, (0, 1, 2))
    first = next(iter(chunks(config, source)))
    values = true_augmented_states(config.filters["ekf"], config, first.truth, source)
    assert values.shape == (3, len(first.truth.times_s), 2)
    relative = first.truth.relative
    distance = np.linalg.norm(relative[..., :3], axis=-1)
    error = first.z["link"] - np.stack([distance, (relative[..., :3] * relative[..., 3:]).sum(-1) / distance], axis=-1)
    noise = error - values
    squared = np.square(noise / [0.3, 2e-3]).sum(axis=(0, 1))
    low, high = chi2.ppf([1e-4, 1 - 1e-4], noise[..., 0].size)
    assert ((low < squared) & (squared < high)).all()
    assert np.abs(noise.mean(axis=1) / [0.3, 2e-3]).max() < 4 / np.sqrt(noise.shape[1])


def test_two_sensors_may_each_have_a_bias_of_their_own(tmp_path):
    both = WHOLE.replace("sensors:\n", "sensors:\n  lidar: {range_sigma_m: 0.05}\n")
    biases = "[{kind: range_bias, sigma_m: 3}, {kind: range_bias, sigma_m: 3, sensor: link}]"
    outcome = simulate_block(campaign(tmp_path, entry("ekf", biases), both).cases[0], 3, range(2))
    assert not outcome.broken
    assert outcome.result.filters["ekf"].augmented.names == ("range_bias", "link_range_bias")


@pytest.mark.parametrize(
    "filters, sentence",
    [
        (entry("e", f"[{CLOCK}, sensor: lidar}}]"), "lidar has not the channel range and range_rate"),
        (
            entry("e", f"[{CLOCK}}}]", ", sensors: [lidar]"),
            r"no sensor of this filter (lidar) has the channel range and",
        ),
        (entry("e", f"[{CLOCK}, sensor: linc}}]"), "the filter has no sensor linc; it goes by lidar, link"),
        (
            entry("e", f"[{CLOCK}}}, {{kind: range_bias, sigma_m: 1, sensor: link}}]"),
            "clock is an error of link's range too",
        ),
        (
            entry("e", "[{kind: range_bias, sigma_m: 1}, {kind: range_bias, sigma_m: 1, sensor: lidar}]"),
            "range_bias is an error of lidar's range too; no measurement can separate them",
        ),
        (entry("e", "[{kind: differential_drag, sigma_m_s2: 1.0e-7, sensor: link}]"), "no error of a sensor"),
        (
            entry("e", "[{kind: attitude_error, sigma_arcsec: 10}]"),
            "no sensor of this filter (lidar, link) has a channel",
        ),
        (entry("e", f"[{CLOCK}, tau_s: 9}}]"), "tau_s"),
        (entry("e").replace("kind: ekf", "kind: kf"), "the kf filter needs a linear measurement, and lidar gives none"),
    ],
)
def test_what_makes_no_sense_is_refused_with_a_sentence(tmp_path, filters, sentence):
    both = WHOLE.replace("sensors:\n", "sensors:\n  lidar: {range_sigma_m: 0.05}\n")
    with pytest.raises(CampaignError) as refused:
        campaign(tmp_path, filters, both)
    assert any(sentence in problem for problem in refused.value.problems), refused.value.problems
    assert all("link.yaml:" in problem for problem in refused.value.problems)


def test_a_start_at_the_first_fix_needs_angles(tmp_path):
    text = WHOLE[: WHOLE.index("start:")] + "start: {kind: first_fix, velocity_sigma_m_s: 1}\n"
    with pytest.raises(CampaignError, match=r"no sensor here gives a position by itself \(link\)"):
        campaign(tmp_path, entry("e"), text + "statistics: {settle_s: 1000}\n")

"""Extra states in campaigns: where they start, what they gain, what is refused."""

import numpy as np
import pytest
from scipy.stats import chi2
from small_campaign import TEXT

from relnav_sim import CampaignError, load_campaign
from relnav_sim.runner.block import simulate_block
from relnav_sim.runner.extra import extended_prior, extension_of
from relnav_sim.runner.simulation import stretches
from relnav_sim.runner.start import radar_model, starting_belief
from relnav_sim.streams import RandomSource

BIASES = (
    "[{kind: range_bias, sigma_m: 20}, {kind: azimuth_bias, sigma_deg: 0.5}, {kind: elevation_bias, sigma_deg: 0.5}]"
)
PLAIN = TEXT[: TEXT.index("grid:")].replace("sigma_deg: 0.1}", "sigma_deg: 0.1, noise: {kind: gaussian}}")


def campaign(tmp_path, filters, text=PLAIN):
    path = tmp_path / "extra.yaml"
    path.write_text(text[: text.index("filters:")] + "filters:\n" + filters)
    return load_campaign(path)


def test_the_first_fix_is_as_wrong_as_the_biases_make_it(tmp_path):
    """The error of the first fix and of the biases, over many runs, fits the joint prior."""
    entry = f"  ekf: {{kind: ekf, augment: {BIASES}}}\n"
    runs, rng = 400, np.random.default_rng(0)
    config = campaign(tmp_path, entry).cases[0].config
    extra = extension_of(config.filters["ekf"], config)
    source = RandomSource(5, tuple(range(runs)))
    first = next(iter(stretches(config, source)))
    b = extra.sigma * rng.standard_normal((runs, 3))
    z = first.inputs["polar"].copy()
    z += b[:, None]
    biased = type(first)(first.first_epoch, first.truth, first.z, {"polar": z}, first.fallen)
    prior = extended_prior(starting_belief(config, radar_model(config), biased, source), extra, config)
    truth = np.concatenate([first.truth.relative[:, 0], b], axis=1)
    # The velocity at the start is no random number of the right size here, so position and biases are looked at.
    places = [0, 1, 2, 6, 7, 8]
    error = (prior.mean - truth)[:, places]
    P = prior.covariance[:, places][:, :, places]
    nees = np.einsum("bi,bij,bj->b", error, np.linalg.inv(P), error).sum()
    low, high = chi2.ppf([0.0005, 0.9995], 6 * runs)
    assert low < nees < high


@pytest.mark.parametrize("kind", ["kf", "ekf"])
def test_a_bias_is_found_or_accounted_for(tmp_path, kind):
    """A bias of 5 sigmas of the noise: ignored, estimated, considered."""
    extras = {
        "ignoring": "[]",
        "estimating": "[{kind: azimuth_bias, sigma_deg: 0.5}]",
        "considering": "[{kind: azimuth_bias, sigma_deg: 0.5, mode: consider}]",
    }
    entries = "".join(
        f"  {name}: {{kind: {kind}, dynamics: {{kind: nonlinear_j2}}, "
        f"process_noise: {{acceleration_psd_m2_s3: 1e-14}}, augment: {extra}}}\n"
        for name, extra in extras.items()
    )
    text = PLAIN
    for old, new in (
        ("range_sigma_m: 2,", "range_sigma_m: 2, azimuth_bias_deg: 0.5,"),
        ("duration_s: 40, step_s: 1, store_every_s: 4", "duration_s: 5600, step_s: 20, store_every_s: 400"),
        ("  dispersions:", "  forces: {zonals: 2, drag: none}\n  dispersions:"),
    ):
        assert old in text
        text = text.replace(old, new)
    text = "\n".join(line for line in text.splitlines() if not line.startswith(("  gnss:", "  star_tracker:")))
    outcome = simulate_block(campaign(tmp_path, entries, text).cases[0], 5, range(10))
    assert not outcome.broken and not outcome.result.failures
    found = outcome.result.filters
    rms = {name: np.sqrt(np.mean(np.square(found[name].error[:, -3:, :3]).sum(axis=-1))) for name in extras}
    assert rms["estimating"] < 0.2 * rms["ignoring"]
    anees = {name: found[name].nees[:, -1].mean() / 6 for name in extras}
    low, high = chi2.ppf([0.0005, 0.9995], 60) / 60
    assert low < anees["estimating"] < high < 10 < anees["ignoring"]
    # The bias is the same in all runs and one sigma of what was expected, so the band holds from above only.
    assert anees["considering"] < high


@pytest.mark.parametrize(
    "filters, sentence",
    [
        ("  p: {kind: particle, augment: [{kind: range_bias, sigma_m: 1, mode: consider}]}\n", "can't account for"),
        ("  t: {kind: two_step, augment: [{kind: range_bias, sigma_m: 1, mode: consider}]}\n", "can't account for"),
        ("  e: {kind: ekf, augment: [{kind: range_bias, sigma_m: 1}, {kind: range_bias, sigma_m: 2}]}\n", "twice"),
        ("  e: {kind: ekf, augment: [{kind: azimuth_bias, sigma_m: 1}]}\n", "sigma_deg"),
        ("  e: {kind: ekf, augment: [{kind: azimuth_bais, sigma_deg: 1}]}\n", "azimuth_bias"),
        ("  e: {kind: ekf, augment: [{kind: range_bias, sigma_m: 1, tau_s: 9, walk_m_per_sqrt_s: 1}]}\n", "not both"),
    ],
)
def test_what_makes_no_sense_is_refused_with_a_sentence(tmp_path, filters, sentence):
    with pytest.raises(CampaignError) as refused:
        campaign(tmp_path, filters)
    assert len(refused.value.problems) >= 1 and any(sentence in problem for problem in refused.value.problems)
    assert all("extra.yaml:" in problem for problem in refused.value.problems)

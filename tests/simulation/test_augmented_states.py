"""Augmented states in campaigns: where they start, what they gain, what is refused."""

import numpy as np
import pytest
from scipy.stats import chi2
from small_campaign import TEXT

from relnav_sim import CampaignError, load_campaign
from relnav_sim.simulation.augmented_states import extended_prior, extension_of, true_augmented_states
from relnav_sim.simulation.block import simulate_block
from relnav_sim.simulation.chunks import chunks
from relnav_sim.simulation.start import starting_belief
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
    first = next(iter(chunks(config, source)))
    b = extra.sigma * rng.standard_normal((runs, 3))
    z = first.inputs["radar"]["spherical"].copy()
    z += b[:, None]
    biased = type(first)(first.first_epoch, first.truth, first.z, {"radar": {"spherical": z}}, first.ended)
    prior = extended_prior(starting_belief(config, biased, source), extra, config)
    truth = np.concatenate([first.truth.relative[:, 0], b], axis=1)
    # The velocity at the start is no random number of the right size here, so position and biases are looked at.
    places = [0, 1, 2, 6, 7, 8]
    error = (prior.mean - truth)[:, places]
    P = prior.covariance[:, places][:, :, places]
    nees = np.einsum("bi,bij,bj->b", error, np.linalg.inv(P), error).sum()
    low, high = chi2.ppf([0.0005, 0.9995], 6 * runs)
    assert low < nees < high


def exact_text():
    """Return the campaign with a truth that the nonlinear_j2 dynamics follow exactly, one revolution long."""
    text = PLAIN
    for old, new in (
        ("duration_s: 40, step_s: 1, store_every_s: 4", "duration_s: 5600, step_s: 20, store_every_s: 400"),
        ("  dispersions:", "  forces: {zonals: 2, drag: none}\n  dispersions:"),
    ):
        assert old in text
        text = text.replace(old, new)
    return "\n".join(line for line in text.splitlines() if not line.startswith(("  gnss:", "  star_tracker:")))


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
    text = exact_text().replace("range_sigma_m: 2,", "range_sigma_m: 2, azimuth_bias_deg: 0.5,")
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
    bias = found["estimating"].augmented
    assert (bias.names, bias.units) == (("azimuth_bias",), ("rad",))
    assert found["ignoring"].augmented is None
    np.testing.assert_allclose(bias.estimate - bias.error, np.radians(0.5), rtol=1e-5)
    z = bias.error[:, -1, 0] / bias.sigma[:, -1, 0]
    low, high = chi2.ppf([0.0005, 0.9995], 10)
    assert low < np.sum(z**2) < high
    # The settled span is 15 stored points of 280 epochs here; both say the same to what that thinning leaves.
    thinned = np.sqrt(np.mean(np.square(bias.error[:, 1:, 0]), axis=1))
    np.testing.assert_allclose(bias.rms[:, 1, 0], thinned, rtol=0.5)
    considered = found["considering"].augmented
    assert (considered.estimate == 0).all()
    np.testing.assert_allclose(considered.sigma, np.radians(0.5), rtol=1e-6)


@pytest.mark.parametrize("carrier", [pytest.param("both", marks=pytest.mark.slow), "deputy"])
def test_an_accelerometer_s_bias_is_found(tmp_path, carrier):
    """Each run has its own bias, which a filter adds up unless it estimates or considers it."""
    extras = {
        "ignoring": "[]",
        "estimating": "[{kind: accelerometer_bias, sigma_m_s2: 2e-5}]",
        "considering": "[{kind: accelerometer_bias, sigma_m_s2: 2e-5, mode: consider}]",
    }
    entries = "".join(
        f"  {name}: {{kind: ekf, dynamics: {{kind: nonlinear_j2}}, "
        f"process_noise: {{acceleration_psd_m2_s3: 1e-14}}, augment: {extra}}}\n"
        for name, extra in extras.items()
    )
    # The chief is as unsteady as the deputy, so half of the variance is each one's.
    sigma = 2e-5 / np.sqrt(2 if carrier == "both" else 1)
    sensor = f"{{carrier: {carrier}, velocity_random_walk_m_s_sqrt_s: 1e-5, bias_sigma_m_s2: {sigma}}}"
    text = exact_text().replace("sensors:", f"sensors:\n  accelerometer: {sensor}")
    runs = 20
    outcome = simulate_block(campaign(tmp_path, entries, text).cases[0], 5, range(runs))
    assert not outcome.broken and not outcome.result.failures
    found = outcome.result.filters
    low, high = chi2.ppf([0.0005, 0.9995], 6 * runs) / (6 * runs)
    anees = {name: found[name].nees[:, -1].mean() / 6 for name in extras}
    assert low < anees["estimating"] < high and low < anees["considering"] < high < 10 < anees["ignoring"]
    bias = found["estimating"].augmented
    assert bias.names == tuple(f"accelerometer_bias_{axis}" for axis in "xyz")
    z = bias.error[:, -1] / bias.sigma[:, -1]
    low, high = chi2.ppf([0.0005, 0.9995], 3 * runs)
    assert low < np.sum(z**2) < high
    # After one revolution little of it is left.
    assert (bias.sigma[:, -1] < 0.1 * 2e-5).all()


def test_true_values_where_they_are_known(tmp_path):
    extras = (
        "[{kind: differential_drag, sigma_m_s2: 1e-6}, {kind: elevation_bias, sigma_deg: 1}, "
        "{kind: attitude_error, sigma_arcsec: 10}]"
    )
    entry = f"  ekf: {{kind: ekf, augment: {extras}}}\n"

    def true_values(text):
        config = campaign(tmp_path, entry, text).cases[0].config
        first = next(iter(chunks(config, RandomSource(5, (0, 1)))))
        return (
            true_augmented_states(config.filters["ekf"], config, first.truth, RandomSource(5, (0, 1))),
            first.truth,
            config,
        )

    biased = PLAIN.replace("angle_sigma_deg: 0.1,", "angle_sigma_deg: 0.1, elevation_bias_deg: 0.2,").replace(
        "noise: {kind: gaussian}", "noise: [{kind: gaussian}, {kind: bias, value: [0, 0, 3]}]"
    )
    values, truth, config = true_values(biased)
    assert values.shape == (2, 41, 5)
    np.testing.assert_allclose(values[..., 1], np.radians(0.2 + 3 * 0.1), rtol=1e-12)
    assert (values[..., 2:] == 0).all()
    # Drag by hand, against the air that turns with the Earth; the along-track axis is that of the chief.
    r, v = truth.chief[..., :3], truth.chief[..., 3:]
    constants, air = config.truth.constants, config.truth.forces.atmosphere

    def drag(states, ballistic):
        wind = states[..., 3:] - np.cross([0, 0, constants.rotation_rad_s], states[..., :3])
        altitude = np.linalg.norm(states[..., :3], axis=-1) - constants.radius_m
        density = air.density_kg_m3 * np.exp((air.base_altitude_m - altitude) / air.scale_height_m)
        return -0.5 * ballistic * (density * np.linalg.norm(wind, axis=-1))[..., None] * wind

    along = np.cross(np.cross(r, v), r)
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    difference = drag(truth.deputy, 2.2 / 100) - drag(truth.chief, 2.2 / 200)
    expected = (difference * along).sum(axis=-1)
    assert (expected < 0).all()
    np.testing.assert_allclose(values[..., 0], expected, rtol=1e-7)

    drifting = PLAIN.replace("noise: {kind: gaussian}", "noise: [{kind: gaussian}, {kind: gauss_markov, tau_s: 60}]")
    assert np.isnan(true_values(drifting)[0][..., 1]).all()
    dispersed = PLAIN.replace("  dispersions:", "  dispersions:\n    density: {kind: normal, sigma: 0.1}")
    assert np.isnan(true_values(dispersed)[0][..., 0]).all()


@pytest.mark.parametrize(
    "filters, sentence",
    [
        ("  p: {kind: particle, augment: [{kind: range_bias, sigma_m: 1, mode: consider}]}\n", "can't account for"),
        ("  t: {kind: two_step, augment: [{kind: range_bias, sigma_m: 1, mode: consider}]}\n", "can't account for"),
        ("  e: {kind: ekf, augment: [{kind: range_bias, sigma_m: 1}, {kind: range_bias, sigma_m: 2}]}\n", "twice"),
        ("  e: {kind: ekf, augment: [{kind: azimuth_bias, sigma_m: 1}]}\n", "sigma_deg"),
        ("  e: {kind: ekf, augment: {kind: azimuth_bias, sigma_deg: 1}}\n", "must be a list, not a section"),
        ("  e: {kind: ekf, augment: [{kind: accelerometer_bias, sigma_m_s2: 1}]}\n", "no measured thrust"),
        ("  e: {kind: ekf, augment: [{kind: azimuth_bais, sigma_deg: 1}]}\n", "azimuth_bias"),
        ("  e: {kind: ekf, augment: [{kind: range_bias, sigma_m: 1, tau_s: 9, walk_m_per_sqrt_s: 1}]}\n", "not both"),
    ],
)
def test_what_makes_no_sense_is_refused_with_a_sentence(tmp_path, filters, sentence):
    with pytest.raises(CampaignError) as refused:
        campaign(tmp_path, filters)
    assert len(refused.value.problems) >= 1 and any(sentence in problem for problem in refused.value.problems)
    assert all("extra.yaml:" in problem for problem in refused.value.problems)

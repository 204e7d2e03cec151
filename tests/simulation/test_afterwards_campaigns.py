"""Campaigns with rows that are known afterwards: smoothers, batch least squares and fitted starts."""

import numpy as np
import pytest
from small_campaign import TEXT

from relnav_sim import CampaignError, load_campaign, smooth
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.fitted_start import fitted_start
from relnav_sim.simulation import spill
from relnav_sim.simulation.block import filter_block, simulate_block
from relnav_sim.simulation.chunks import chunks
from relnav_sim.streams import RandomSource

PLAIN = TEXT[: TEXT.index("grid:")].replace("sigma_deg: 0.1}", "sigma_deg: 0.1, noise: {kind: gaussian}}")
DENSITIES = "{radial_psd_m2_s3: 1.0e-8, along_track_psd_m2_s3: 1.0e-8, normal_psd_m2_s3: 1.0e-8}"
ADAPTIVE = f"{{adaptive: {{window: 10, start: {DENSITIES}}}}}"
AXIS = "{sigma_m_s2: 1.0e-5, tau_s: 50}"
DMC = f"{{dmc: {{radial: {AXIS}, along_track: {AXIS}, normal: {AXIS}}}}}"
LAG = "smoother: {fixed_lag: {lag_s: 7}}"
SERIES = ("error", "sigma", "nis", "nees")


def campaign(tmp_path, filters, *changes):
    text = PLAIN[: PLAIN.index("filters:")]
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "afterwards.yaml"
    path.write_text(text + "filters:\n" + "".join(f"  {name}: {{{entry}}}\n" for name, entry in filters.items()))
    return load_campaign(path)


def block(found, runs=range(3)):
    outcome = simulate_block(found.cases[0], found.seed, runs)
    assert not outcome.broken, {name: one.traceback for name, one in outcome.broken.items()}
    return outcome.result


class Watch:
    def __init__(self):
        self.filtered, self.smoothed, self.filters = {}, {}, {}

    def __call__(self, name, filter, chunk, before, history):
        self.filtered.setdefault(name, []).append(history)
        self.filters[name] = filter

    def afterwards(self, name, chunk, history):
        self.smoothed.setdefault(name, []).append(history)


def watched(found, runs=range(2)):
    case, source, watch = found.cases[0], RandomSource(found.seed, tuple(runs)), Watch()
    outcome = filter_block(case, source, chunks(case.config, source), watch=watch)
    assert not outcome.broken
    return watch, outcome.result


def joined(histories, name):
    return np.concatenate([getattr(one, name) for one in histories], axis=1)


def test_a_row_is_what_the_smoother_makes_of_the_whole_run(tmp_path, monkeypatch):
    """Over the border of a chunk, back to the start; the matrices never change, so the library's smoother can too."""
    monkeypatch.setattr("relnav_sim.simulation.chunks.CHUNK_EPOCHS", 24)
    kinds = {
        "rts": "kind: ekf, smoother: rts",
        "lag": f"kind: ekf, {LAG}",
        "long": "kind: ekf, smoother: {fixed_lag: {lag_s: 55}}",
    }
    watch, result = watched(campaign(tmp_path, kinds, ("duration_s: 40", "duration_s: 60")))
    for name, lag in (("rts", None), ("lag", 7), ("long", 55)):
        parts = watch.filtered[name]
        history = type(parts[0])(*(joined(parts, each) for each in ("mean", "covariance", "nis", "log_likelihood")), {})
        whole = smooth(history, watch.filters[name].dynamics, lag=lag)
        sigma = np.sqrt(np.einsum("btii->bti", whole.covariance))
        mean, covariance = joined(watch.smoothed[name], "mean"), joined(watch.smoothed[name], "covariance")
        assert (np.abs(mean - whole.mean) / sigma).max() < 1e-9
        assert (np.abs(covariance - whole.covariance) / (sigma[..., None] * sigma[:, :, None])).max() < 1e-9
        stored = np.sqrt(np.einsum("btii->bti", covariance))[:, ::4]
        assert np.allclose(result.filters[name].sigma, stored, rtol=1e-6)
        assert np.array_equal(joined(watch.smoothed[name], "nis"), history.nis, equal_nan=True)


GAUSSIAN = ("kf", "ckf", "sr_ukf", "two_step")
ROWS = {
    **{kind: f"kind: {kind}, smoother: rts" for kind in GAUSSIAN},
    "nonlinear": "kind: ukf, dynamics: {kind: nonlinear_j2}, smoother: rts",
    "sampled": f"kind: alpha_kf, samples: 100, {LAG}",
    "adaptive": f"kind: ekf, process_noise: {ADAPTIVE}, smoother: rts",
    "dmc": f"kind: ekf, process_noise: {DMC}, {LAG}",
    "augmented": "kind: ekf, augment: [{kind: range_bias, sigma_m: 5}], smoother: rts",
    "batch": "kind: batch_least_squares, augment: [{kind: range_bias, sigma_m: 5}]",
    "start": "kind: sr_ukf, batch_start: {duration_s: 8}",
    "particles": "kind: particle, particles: 100, batch_start: {duration_s: 8}",
}


def test_a_run_has_the_same_bits_in_any_block_and_wherever_things_are_kept(tmp_path, monkeypatch):
    found = campaign(tmp_path, ROWS)
    whole = block(found)
    monkeypatch.setattr(spill, "IN_MEMORY_BYTES", 1000)
    part = block(found, range(1, 3))
    assert not whole.failures
    for kind, filter in whole.filters.items():
        for name in SERIES:
            own, other = getattr(filter, name), getattr(part.filters[kind], name)
            assert np.isfinite(filter.error).all()
            assert np.array_equal(own[1:], other, equal_nan=True), (kind, name)


def test_later_readings_make_estimates_better_and_the_fit_best_where_the_dynamics_are_right(tmp_path):
    kinds = {
        "filter": "kind: ekf",
        "lag": f"kind: ekf, {LAG}",
        "rts": "kind: ekf, smoother: rts",
        "batch": "kind: batch_least_squares, dynamics: {kind: nonlinear_j2}",
    }
    result = block(
        campaign(tmp_path, kinds, ("dispersions:", "forces: {zonals: 2, drag: none}\n  dispersions:")), range(12)
    )
    rms = [np.sqrt(np.square(result.filters[name].error[:, 3:-1, :3]).mean()) for name in kinds]
    assert rms == sorted(rms, reverse=True) and rms[2] < 0.7 * rms[0]
    nees = result.filters["batch"].nees[:, 5].sum()
    assert 72 - 4 * 12 < nees < 72 + 4 * 12, "chi-square with 12 x 6 degrees of freedom, four sigmas of 12"


def test_a_run_that_fails_on_the_way_has_no_smoothed_estimates(tmp_path):
    """The radar's measurements of one run jump by more than numbers hold; the others keep their bits."""
    kinds = {"rts": "kind: ekf, smoother: rts", "lag": f"kind: ekf, {LAG}"}
    found = campaign(tmp_path, kinds)
    case, source = found.cases[0], RandomSource(found.seed, (0, 1, 2))

    def spoilt():
        for chunk in chunks(case.config, source):
            chunk.inputs["radar"]["spherical"][1, 20] = 1e200
            yield chunk

    outcome = filter_block(case, source, spoilt())
    told = {failure.filter: failure for failure in outcome.result.failures}
    assert {name: (one.run, one.epoch) for name, one in told.items()} == {"rts": (1, 0), "lag": (1, 14)}, told
    assert all("the pass forward failed at epoch 21: " in one.reason for one in told.values())
    whole = block(found)
    for name in kinds:
        mine, other = outcome.result.filters[name].error, whole.filters[name].error
        assert np.array_equal(mine[[0, 2]], other[[0, 2]])
    assert np.array_equal(outcome.result.filters["lag"].error[1, :4], whole.filters["lag"].error[1, :4])


def test_readings_that_a_start_is_fitted_to_are_not_used_again(tmp_path):
    watch, _ = watched(campaign(tmp_path, {"plain": "kind: ekf", "start": "kind: ekf, batch_start: {duration_s: 8}"}))
    (fitted,), (plain,) = watch.filtered["start"], watch.filtered["plain"]
    assert (fitted.dof[:, :9] == 0).all() and np.isnan(fitted.nis[:, :9]).all() and (fitted.dof[:, 9:] == 3).all()
    sigma = np.sqrt(np.einsum("btii->bti", plain.covariance))
    # The same measurements in another way: with little process noise it is the filter's own estimate, nearly.
    assert 0 < (np.abs(fitted.mean - plain.mean) / sigma)[:, 8].max() < 0.5
    # Until it is there nothing is known but the prior.
    dynamics = watch.filters["start"].dynamics
    for k in range(1, 8):
        expected = dynamics.propagate(fitted.mean[:, k - 1], Step(k, 1.0))
        assert np.allclose(fitted.mean[:, k], expected, rtol=1e-12) and (fitted.mean[:, k] != plain.mean[:, k]).any()
    found = campaign(tmp_path, {"start": "kind: ekf, batch_start: {duration_s: 8}"})
    case, source = found.cases[0], RandomSource(found.seed, (0, 1))
    (chunk,) = chunks(case.config, source)
    z = chunk.inputs["radar"]["spherical"]
    filter = watch.filters["start"]
    start = Gaussian(plain.mean[:, 0].copy(), plain.covariance[:, 0].copy())
    fit = fitted_start(filter, {"radar": z[:, 1:9]}, start, source, 1.0)
    assert np.array_equal(fit.mean, fitted.mean[:, :9])


def test_a_start_that_can_not_be_fitted_fails_its_run(tmp_path):
    found = campaign(tmp_path, {"start": "kind: ekf, batch_start: {duration_s: 8}"})
    case, source = found.cases[0], RandomSource(found.seed, (0, 1))

    def spoilt():
        for chunk in chunks(case.config, source):
            chunk.inputs["radar"]["spherical"][1, 5] = 1e200
            yield chunk

    (failure,) = filter_block(case, source, spoilt()).result.failures
    assert (failure.run, failure.epoch) == (1, 0)
    assert failure.reason.startswith("no start could be fitted: Gauss-Newton has not converged in 20 passes")


def test_nobody_s_key_is_part_of_a_campaign_that_does_not_use_it(tmp_path):
    plain = campaign(tmp_path, {"ekf": "kind: ekf"})
    assert plain.hash == campaign(tmp_path, {"ekf": "kind: ekf, smoother: null, out_of_sequence: null"}).hash
    assert plain.hash != campaign(tmp_path, {"ekf": "kind: ekf, smoother: rts"}).hash
    assert plain.hash.startswith("e42ed854b01d"), "as it was before there were such keys"


REFUSED = {
    "kind: particle, smoother: rts": "the particle filter is no single Gaussian",
    "kind: imm, smoother: rts": "the imm filter is no single Gaussian",
    "kind: ekf, smoother: RTS": "must be 'rts', not the text 'RTS'; did you mean 'rts'?",
    "kind: ekf, smoother: {fixed_lag: {lag_s: 0.5}}": "0.5 s is no whole number of steps of 1 s; take 1",
    "kind: ekf, smoother: {fixed_lag: {lag_s: 40}}": "40 s is not shorter than the run of 40 s; take smoother: rts",
    "kind: ekf, smoother: rts, augment: [{kind: range_bias, sigma_m: 5, mode: consider}]": "range_bias is accounted",
    "kind: ekf, smoother: rts, batch_start: {duration_s: 5}": "leave batch_start out",
    "kind: batch_least_squares, smoother: rts": "batch_least_squares knows all measurements already",
    "kind: batch_least_squares, batch_start: {duration_s: 5}": "is fitted to all measurements itself",
    f"kind: batch_least_squares, process_noise: {DMC}": "fits one trajectory without process noise",
    "kind: ekf, batch_start: {duration_s: 40}": "leaves the filter nothing of a run of 40 s",
    "kind: ekf, batch_start: {duration_s: 0.5}": "0.5 s is no whole number of steps of 1 s; take 1",
    "kind: ekf, out_of_sequence: keep": "must be 'drop' or 'buffer'",
}


@pytest.mark.parametrize("entry", REFUSED)
def test_what_makes_no_sense_is_refused_by_name(tmp_path, entry):
    with pytest.raises(CampaignError) as error:
        campaign(tmp_path, {"row": entry})
    assert REFUSED[entry] in str(error.value) and "filters.row." in str(error.value)

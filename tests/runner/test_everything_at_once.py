"""A campaign that uses as much as possible at once: whatever holds for simple campaigns holds for it, to the bit.

Manoeuvres with execution errors, accelerometers, a late radar with a bias and outliers, filters with augmented states
that are estimated and considered, mixtures, fixed and random samples, learned dynamics, bounds and diagnostics.
"""

import json
import shutil

import h5py
import numpy as np
import pytest
import yaml

from relnav_sim import load_campaign, open_results, run_campaign
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.dynamics import registry as dynamics_registry
from relnav_sim.dynamics.clohessy_wiltshire import CwOptions
from relnav_sim.filters import registry
from relnav_sim.filters.alpha_kf import AlphaKalmanFilter
from relnav_sim.filters.ekf import ExtendedKalmanFilter
from relnav_sim.results import layout, seal
from relnav_sim.results.block import ResultsError
from relnav_sim.results.changes import changed_keys
from relnav_sim.runner.bound_task import bound_tasks, finished_bounds
from relnav_sim.runner.merging import merge_results
from relnav_sim.runner.single import run_single
from relnav_sim.runner.unfinished import results_so_far

TEXT = """
name: everything
seed: 7
runs: 3
block_runs: 2
clock: {duration_s: 40, step_s: 2, store_every_s: 4}
truth:
  chief: {orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}, mass_kg: 400, area_m2: 4}
  deputy:
    relative: {position_m: [-10, -2000, 0], velocity_m_s: [0, 0, 0]}
    mass_kg: 200
    area_m2: 2
  manoeuvres:
    long: {time_s: 11, duration_s: 8, delta_v_m_s: [-0.3, 0.04, 0.011]}
    first: {time_s: 30.1, delta_v_m_s: [0.1, 0.1, 0.3]}
    second: {time_s: 30.8, delta_v_m_s: [0.17, 0.11, 0.31]}
    third: {time_s: 31.1, delta_v_m_s: [0.171, 0.112, 0.313]}
  execution_errors: {magnitude_sigma_percent: 1, direction_sigma_deg: 0.5, timing_sigma_s: 0.05}
  dispersions: {relative_position: {kind: normal, sigma_m: 20}}
sensors:
  radar:
    range_sigma_m: 1
    angle_sigma_deg: 0.05
    azimuth_bias_deg: 0.05
    time_tag_jitter_s: 0.005
    noise: {kind: mixture, scale: 4, fraction: 0.05}
  gnss: {position_sigma_m: 10, velocity_sigma_m_s: 0.05}
  star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30}
  accelerometer:
    {velocity_random_walk_m_s_sqrt_s: 3.0e-4, bias_sigma_m_s2: 3.0e-5, scale_factor_sigma_percent: 0.03}
start: {kind: dispersed, position_sigma_m: 30, velocity_sigma_m_s: 0.1}
statistics: {settle_s: 20}
filters:
  ekf:
    kind: ekf
    dynamics: {kind: nonlinear_j2}
    augment: [{kind: azimuth_bias, sigma_deg: 0.1}, {kind: accelerometer_bias, sigma_m_s2: 4.0e-5}]
  schmidt: {kind: ekf, augment: [{kind: azimuth_bias, sigma_deg: 0.1, mode: consider}]}
  imm: {kind: imm, dynamics: {kind: nonlinear_j2}, assumed_noise: mixture}
  alpha_kf: {kind: alpha_kf, samples: 100, sampling: fixed, augment: [{kind: azimuth_bias, sigma_deg: 0.1}]}
  particle: {kind: particle, particles: 50, dynamics: {kind: cw_second_order}, assumed_latency: none}
  gp_ukf:
    kind: gp_ukf
    dynamics:
      {kind: gp, training: smoothed_radar, training_points: 50, training_span_s: 200, calibration_span_s: 60}
tune: {budget: 5, runs: 2}
requirements: {near: {kind: rms, quantity: r, below_m: 50}}
zip: {sensors.radar.latency_s: [0.2, 0]}
"""

TIMINGS = {spec.name for spec in layout.SUMMARY if spec.timing}


def made(**changes):
    """Return the campaign with whole sections changed."""
    return parse_campaign(json.dumps(yaml.safe_load(TEXT) | changes))


def without(*names):
    return {name: entry for name, entry in yaml.safe_load(TEXT)["filters"].items() if name not in names}


def whole_file(path):
    """Return every dataset of a results file as it lies there, but measured times."""
    found = {}

    def visit(name, item):
        if isinstance(item, h5py.Dataset) and name.rpartition("/")[2] not in TIMINGS:
            values = item[()]
            found[name] = (values.shape, values.tolist() if values.dtype == object else values.tobytes())

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def assert_same_file(a, b):
    first, second = whole_file(a), whole_file(b)
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


@pytest.fixture(scope="module")
def whole():
    return made()


@pytest.fixture(scope="module")
def reference(whole, tmp_path_factory):
    return run_campaign(whole, tmp_path_factory.mktemp("everything") / "whole.h5", backend="sequential")


def test_everything_is_there(reference):
    names = whole_file(reference)
    for name in ("bound", "gp_ukf/bound", "ekf/extra_sigma", "schmidt/extra_mean", "alpha_kf/diagnostics"):
        assert f"case_001/{name}" in names
    with open_results(reference) as results:
        assert not results.failures() and not results.missing()
        assert all(np.isfinite(results.bound(1, name)).all() for name in (None, *results.filters))


@pytest.mark.slow
def test_parts_of_other_blocks_merge_to_the_whole(tmp_path, reference):
    campaign = made(block_runs=1)
    parts = [run_campaign(campaign, tmp_path / f"{i}.h5", backend="sequential", part=(i, 2)) for i in (1, 2)]
    assert_same_file(reference, merge_results(tmp_path / "merged.h5", [parts[1], parts[0]]))
    folder = parts[0].with_name("1.h5.shards")
    assert_same_file(reference, merge_results(tmp_path / "again.h5", [folder, parts[1]]))


@pytest.mark.slow
def test_a_campaign_that_grew_is_the_whole(tmp_path, reference):
    out = tmp_path / "grown.h5"
    late = {"sensors.radar.latency_s": [0.2]}
    run_campaign(made(runs=1, filters=without("ekf", "gp_ukf"), zip=late, requirements={}), out, backend="sequential")
    run_campaign(made(filters=without("gp_ukf"), zip=late, tune=None, block_runs=1), out, backend="sequential")
    run_campaign(made(), out, backend="sequential")
    assert_same_file(reference, out)
    # The folder holds the bounds of fewer filters too; they agree with the last ones.
    assert_same_file(reference, merge_results(tmp_path / "merged.h5", [out.with_name("grown.h5.shards")]))


@pytest.mark.slow
def test_one_run_at_full_rate_is_that_of_the_campaign(tmp_path, reference):
    path = run_single(made(), 1, 2, tmp_path / "one.h5", trace=True, backend="sequential")
    with open_results(path) as one, open_results(reference) as many:
        for name in one.filters:
            assert one.series(0, name, 2).error[::2].tobytes() == many.series(1, name, 2).error.tobytes()
            for key, values in one.diagnostics(0, name).items():
                assert values[0].tobytes() == many.diagnostics(1, name)[key][2].tobytes()
            if (extra := one.augmented(0, name)) is not None:
                assert extra.sigma[0, ::2].tobytes() == many.augmented(1, name).sigma[2].tobytes()
                assert extra.rms[0].tobytes() == many.augmented(1, name).rms[2].tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_workers_do_not_show(tmp_path, reference, workers):
    assert_same_file(reference, run_campaign(made(), tmp_path / "out.h5", workers=workers))


def test_the_order_of_manoeuvres_does_not_show():
    truth = yaml.safe_load(TEXT)["truth"]
    truth["manoeuvres"] = dict(reversed(truth["manoeuvres"].items()))
    swapped = made(truth=truth)
    assert swapped.hash == made().hash
    # Sums over manoeuvres are taken in this order.
    assert list(swapped.cases[0].config.truth.manoeuvres) == list(made().cases[0].config.truth.manoeuvres)


@pytest.mark.parametrize(
    "change, keys",
    [
        ("truth.manoeuvres.first.time_s=29.5", ["truth.manoeuvres.first.time_s"]),
        ("truth.execution_errors.timing_sigma_s=0.06", ["truth.execution_errors.timing_sigma_s"]),
        ("sensors.accelerometer.bias_sigma_m_s2=2e-5", ["sensors.accelerometer.bias_sigma_m_s2"]),
        ("sensors.radar.time_tag_jitter_s=0", ["sensors.radar.time_tag_jitter_s"]),
        ("filters.ekf.augment[0].sigma_deg=0.2", ["filters.ekf.augment"]),
        ("filters.schmidt.augment=[]", ["filters.schmidt.augment"]),
        ("filters.imm.known_thrust=planned", ["filters.imm.known_thrust"]),
        ("filters.particle.assumed_latency=known", ["filters.particle.assumed_latency"]),
        ("filters.gp_ukf.dynamics.training=truth", ["filters.gp_ukf.dynamics.training"]),
        ("filters.ekf.augment[0].mode=estimate", []),
        ("truth.manoeuvres.long.duration_s=8.0", []),
        ("requirements={}", []),
        ("tune.budget=6", []),
        ("bound=false", []),
        ("stop={metric: r_rms_m, half_width: 1, at: [2]}", []),
    ],
)
def test_what_is_a_change(whole, tmp_path, change, keys):
    path = tmp_path / "everything.yaml"
    path.write_text(TEXT)
    before, after = whole, load_campaign(path, [change])
    assert changed_keys(before.content, after.content) == keys
    assert (before.hash == after.hash) is not bool(keys)
    per_filter = bool(keys) and keys[0].startswith("filters.")
    same_cases = [case.id for case in before.cases] == [case.id for case in after.cases]
    assert same_cases is (per_filter or not keys)


class _Bad:
    """Goes wrong in run 2."""

    def start(self, prior, source):
        self.place = source.runs.index(2) if 2 in source.runs else None
        return super().start(prior, source)

    def correct(self, belief, z, step):
        belief, innovation = super().correct(belief, z, step)
        if self.place is not None and step.epoch == 9:
            self.go_wrong(belief)
        return belief, innovation


class _Raising(_Bad, AlphaKalmanFilter):
    def go_wrong(self, belief):
        raise ZeroDivisionError("too interesting")


class _Lost(_Bad, ExtendedKalmanFilter):
    def go_wrong(self, belief):
        belief.mean[self.place, 6:] = np.nan


def test_a_bad_run_costs_no_other_run_its_extra_states_or_diagnostics(tmp_path, monkeypatch):
    kinds = registry.filter_kinds()
    for good, bad in (("alpha_kf", _Raising), ("ekf", _Lost)):
        kind = registry.FilterKind(f"bad_{good}", kinds[good].options_model, bad, kinds[good].measurement, 3.0)
        monkeypatch.setitem(registry._KINDS, kind.name, kind)
    filters = {name: entry for name, entry in without().items() if name in ("alpha_kf", "ekf")}
    filters |= {f"bad_{name}": {**entry, "kind": f"bad_{name}"} for name, entry in filters.items()}
    changes = {"filters": filters, "zip": {"sensors.radar.latency_s": [0]}, "runs": 4, "bound": False}
    files = [
        run_campaign(made(**changes, block_runs=size), tmp_path / f"{size}.h5", backend="sequential") for size in (4, 1)
    ]
    assert_same_file(*files)
    with open_results(files[0]) as results:
        failures = {failure.filter: failure for _, failure in results.failures()}
        assert {(failure.run, name) for name, failure in failures.items()} == {(2, "bad_alpha_kf"), (2, "bad_ekf")}
        assert failures["bad_ekf"].epoch == 9, "lost augmented states are a failure at once, not when they are used"
        for good in ("alpha_kf", "ekf"):
            extra = results.augmented(0, f"bad_{good}")
            assert extra.names == results.augmented(0, good).names
            assert np.isfinite(extra.rms[[0, 1, 3]]).all() and np.isfinite(extra.sigma[[0, 1, 3]]).all()
            assert results.diagnostics(0, f"bad_{good}").keys() == results.diagnostics(0, good).keys()
            for values in results.diagnostics(0, f"bad_{good}").values():
                assert np.isfinite(values[[0, 1, 3]]).all()
        for part in ("estimate", "sigma", "rms"):  # to the bit where nothing is drawn
            ours, theirs = (getattr(results.augmented(0, name), part) for name in ("bad_ekf", "ekf"))
            np.testing.assert_array_equal(ours[[0, 1, 3]], theirs[[0, 1, 3]])


class _Motion:
    """Clohessy and Wiltshire's motion, with a process noise that goes wrong."""

    dimension, linear = 6, True

    def __init__(self, dynamics, wrong):
        self.dynamics, self.wrong = dynamics, wrong

    def propagate(self, states, step):
        return self.dynamics.propagate(states, step)

    def transition(self, mean, step):
        return self.dynamics.transition(mean, step)

    def process_noise(self, states, step):
        return self.wrong(self.dynamics.process_noise(states, step))


def _exit(Q):
    raise SystemExit("enough")


WRONG = {"not_finite": lambda Q: Q * np.nan, "shape": lambda Q: Q[..., :3, :3], "exits": _exit}


def test_a_bad_model_costs_its_own_bound_only(tmp_path, monkeypatch):
    for name, wrong in WRONG.items():

        def build(self, context, wrong=wrong):
            return _Motion(CwOptions.build(self, context), wrong)

        annotations = {"kind": f"__import__('typing').Literal['{name}']"}
        model = type(f"{name}_options", (CwOptions,), {"__annotations__": annotations, "kind": name, "build": build})
        monkeypatch.setitem(dynamics_registry._KINDS, name, model)
    filters = {"ekf": {"kind": "ekf"}, **{name: {"kind": "ekf", "dynamics": {"kind": name}} for name in WRONG}}
    alone = {"zip": {"sensors.radar.latency_s": [0]}, "runs": 1}
    said = []
    out = run_campaign(made(filters=filters, **alone), tmp_path / "o.h5", backend="sequential", say=said.append)
    good = run_campaign(made(filters={"ekf": filters["ekf"]}, **alone), tmp_path / "good.h5", backend="sequential")
    with open_results(out) as results, open_results(good) as reference:
        assert {failure.filter for _, failure in results.failures()} == set(WRONG)
        for name in (None, "ekf"):
            assert results.bound(0, name).tobytes() == reference.bound(0, name).tobytes()
        assert all(results.bound(0, name) is None for name in WRONG)
    (sentence,) = [sentence for sentence in said if "Cramér-Rao" in sentence]
    assert "not_finite: ValueError: its transition or process noise is not finite" in sentence
    assert "exits: SystemExit: enough" in sentence and "shape: ValueError" in sentence


def test_a_foreign_bound_is_computed_again(tmp_path):
    campaign = made(filters={"kf": {"kind": "kf"}}, runs=1)
    run_campaign(campaign, tmp_path / "o.h5", backend="sequential")
    before = whole_file(tmp_path / "o.h5")
    one, other = bound_tasks(campaign, tmp_path / "o.h5.shards")
    one.path.write_bytes(other.path.read_bytes())
    said = []
    run_campaign(campaign, tmp_path / "o.h5", backend="sequential", say=said.append)
    assert f"{one.path}: this is the bound of something else; computing it again" in said
    assert finished_bounds([one], said.append) != [None] and whole_file(tmp_path / "o.h5") == before


def test_what_is_there_of_an_unfinished_campaign_names_the_command_that_computes_it(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.argv", ["relnav", "run", "it.yaml"])
    out = tmp_path / "o.h5"
    run_campaign(made(filters={"kf": {"kind": "kf"}}), out, backend="sequential", part=(1, 2))
    monkeypatch.setattr("sys.argv", ["relnav", "inspect", "o.h5"])
    with results_so_far(out) as path, open_results(path) as results:
        assert results.provenance.command_line == "relnav run it.yaml"
        assert results.missing() and results.bound(0) is not None


@pytest.mark.slow
def test_a_stranger_s_file_with_other_content_is_damaged_in_words(tmp_path, reference):
    path = tmp_path / "strange.h5"
    shutil.copy(reference, path)
    with h5py.File(path, "r+") as file:
        del file.attrs[seal.ATTRIBUTE]  # else the change itself is noticed first
        content = json.loads(file.attrs["campaign_content"])
        file.attrs["campaign_content"] = json.dumps({**content, "filters": None})
    with pytest.raises(ResultsError, match="'filters' of its campaign_content is damaged"):
        open_results(path)
    with h5py.File(path, "r+") as file:
        file.attrs["campaign_content"] = json.dumps(content)
        del file["case_000/ekf/extra_unit"]
    with open_results(path) as results, pytest.raises(ResultsError, match="lacks units of its augmented states"):
        results.augmented(0, "ekf")

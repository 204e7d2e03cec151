"""Options that take a paper's own way: the filters' contract holds, and at their defaults they change no campaign."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from every_filter import small_options
from radar_problem import radar_problem

from relnav_sim import create_filter, run_filter
from relnav_sim.campaign import parse_campaign

DEMO = yaml.safe_load((Path(__file__).parents[2] / "campaigns" / "demo.yaml").read_text(encoding="utf-8"))
SAMPLED = {"sampled_states": "all", "covariance_correction": False}
COPIES = {"estimate": "after_resampling", "ess_fraction": 1.0}
WAYS = [
    ("alpha_kf", {"sampled_states": "all"}),
    ("alpha_kf", {"covariance_correction": False}),
    ("alpha_kf", {**SAMPLED, "proposal": "posterior"}),
    ("alpha_kf", {**SAMPLED, "sampling": "antithetic", "fixed_point": 3}),
    ("alpha_kf", {**SAMPLED, "arithmetic": "float32"}),
    ("mkf", SAMPLED),
    ("particle", {**COPIES, "mcmc_steps": 1}),
    ("unscented_particle", COPIES),
    ("two_step", {"start": "unscented_plain"}),
    ("two_step", {"start": "unscented_plain", "arithmetic": "float32"}),
    ("adaptive_two_step", {"start": "unscented_plain", "start_kappa": 2.0}),
]
DEFAULTS = {
    "alpha_kf": {"sampled_states": "observed", "covariance_correction": True},
    "mkf": {"sampled_states": "observed", "covariance_correction": True},
    "particle": {"estimate": "before_resampling"},
    "unscented_particle": {"estimate": "before_resampling"},
    "gp_particle": {"estimate": "before_resampling", "dynamics": {"kind": "gp", "regression": None}},
}


@pytest.fixture(scope="module")
def problem():
    problem = radar_problem(runs=4, steps=12)
    problem.z[1, 4:6] = np.nan
    problem.z[2, 8, 1] = np.nan
    problem.measurement.depends_on = (0, 1, 2)
    return problem


def flown(problem, kind, rows=(0, 1, 2, 3), **options):
    filter = create_filter(kind, problem.dynamics, problem.measurement, **small_options(kind), **options)
    rows = list(rows)
    return run_filter(filter, problem.z[rows], problem.mean0[rows], problem.cov0, seed=3, runs=rows)


@pytest.mark.parametrize(("kind", "way"), WAYS)
def test_a_filter_keeps_its_contract(problem, kind, way):
    whole = flown(problem, kind, **way)
    assert not whole.failures and np.isfinite(whole.mean).all()
    variances = np.einsum("...ii->...i", whole.covariance)
    scale = np.sqrt(variances[..., :, None] * variances[..., None, :])
    assert np.linalg.eigvalsh(whole.covariance / scale).min() > 0
    for rows in ([1], [0, 2, 3]):
        part = flown(problem, kind, rows, **way)
        for name in ("mean", "covariance", "nis", "log_likelihood"):
            assert np.array_equal(getattr(part, name), getattr(whole, name)[rows], equal_nan=True), name
    np.testing.assert_array_equal(np.isnan(whole.nis), np.isnan(problem.z).all(axis=2))
    arithmetic = {key: way[key] for key in way.keys() & {"arithmetic"}}
    assert not np.array_equal(whole.mean, flown(problem, kind, **arithmetic).mean), "the option does nothing"


@pytest.mark.parametrize("kind", DEFAULTS)
def test_a_default_that_is_written_out_changes_no_hash(kind):
    def entry(options):
        campaign = parse_campaign(json.dumps({**DEMO, "filters": {"one": {"kind": kind, **options}}}))
        return campaign.hash, campaign.cases[0].filter_ids["one"]

    dynamics = {"dynamics": {"kind": "gp"}} if kind.startswith("gp") else {}
    absent = entry(dynamics)
    assert entry(DEFAULTS[kind]) == absent
    other = {"sampled_states": "all"} if kind in ("alpha_kf", "mkf") else {"estimate": "after_resampling"}
    assert not set(entry(dynamics | other)) & set(absent)
    if dynamics:
        learned = {"dynamics": {"kind": "gp", "regression": {"calibrated": False}}}
        assert not set(entry(learned)) & set(absent)

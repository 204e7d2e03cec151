"""The plan's campaigns validate in every size, and every interpretation finds its case and filters in them."""

from pathlib import Path

import pytest
import yaml

from relnav_sim.campaign import load_campaign
from relnav_sim.runner.run import run_campaign
from replication import plan as plan_module
from replication.compose import RULES
from replication.kept import COLUMNS, CURVES
from replication.measured import case_with
from replication.plan import PLAN, TRIAL_RUNS, Planned, complete_in_full, of_size, planned_campaign
from replication.shi2025.adaptive_rules import future_rules
from replication.shi2025.interpretations import ALPHAS, TUNED_GAUSSIAN, TUNED_MIXTURE

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
NAMES = {planned.name for planned in PLAN}


@pytest.mark.parametrize("size", ["trial", "full"])
@pytest.mark.parametrize("planned", PLAN, ids=lambda planned: planned.name)
def test_every_planned_campaign_validates(planned, size):
    campaign = planned_campaign(planned, size, CAMPAIGNS)
    assert campaign.name == planned.name
    assert campaign.runs == (TRIAL_RUNS if size == "trial" else planned.full_runs)


@pytest.mark.slow
def test_every_interpretation_finds_its_cases_and_its_filters_and_their_columns():
    checked = 0
    for rule in (*RULES, *future_rules()):
        for item in (*rule.main, *rule.others):
            if item.campaign not in NAMES:
                continue
            campaign = load_campaign(CAMPAIGNS / f"{item.campaign}.yaml")
            cases = item.repeats or (case_with([case.variables for case in campaign.cases], item.case),)
            for case in cases:
                assert set(item.filters.values()) <= set(campaign.cases[case].config.filters)
            for part in rule.parts:
                column = item.columns.get(part.column, part.column)
                for role in (*part.of, *part.against):
                    assert column in _kept(item.campaign, item.filters[role]), (rule.claim, item.name, column)
            checked += 1
    assert checked > 60


def _kept(campaign, filter):
    groups = COLUMNS[campaign]
    return {name for group in groups if not group.filters or filter in group.filters for name in group.names}


def test_the_cases_of_the_tuned_campaign_are_those_of_the_rules():
    cases = load_campaign(CAMPAIGNS / "alpha_kf_tuned.yaml").cases
    noises = [case.variables["sensors.radar.noise"]["kind"] for case in cases]
    assert [noises[index] for index in TUNED_GAUSSIAN] == ["gaussian"] * 3
    assert [noises[index] for index in TUNED_MIXTURE] == ["mixture"] * 3
    assert set(TUNED_GAUSSIAN) | set(TUNED_MIXTURE) == set(range(len(cases)))
    assert len(load_campaign(CAMPAIGNS / "alpha_kf_sweep_tuned.yaml").cases) == 3


def test_a_sensitivity_case_is_the_one_that_is_meant():
    campaign = load_campaign(CAMPAIGNS / "alpha_kf_epsilon.yaml")
    wanted = {"sensors.radar.noise": {"kind": "mixture", "shared": False}}
    assert case_with([case.variables for case in campaign.cases], wanted) == 2


def test_every_campaign_says_what_is_kept_of_it():
    assert set(COLUMNS) == NAMES
    assert set(CURVES) <= NAMES


def test_the_subset_is_named_and_part_of_the_full_size():
    subset = of_size("subset")
    assert {planned.name for planned in subset} < NAMES
    assert of_size("full") == of_size("trial") == list(PLAN)
    for planned in subset:
        part, whole = (planned_campaign(planned, size, CAMPAIGNS) for size in ("subset", "full"))
        assert part.runs <= whole.runs
        assert part.content["filters"].items() <= whole.content["filters"].items()
        for key in ("seed", "clock", "truth", "sensors", "start", "statistics", "grid", "zip"):
            assert part.content.get(key) == whole.content.get(key)


@pytest.mark.slow
def test_only_complete_results_of_the_same_campaign_are_taken(tmp_path, monkeypatch):
    short = ("clock.duration_s=10", "statistics.settle_s=5")
    monkeypatch.setattr(plan_module, "PLAN", (Planned("two_step", 1, 2, always=short),))
    (planned,) = plan_module.PLAN
    path = tmp_path / "two_step.h5"
    assert complete_in_full(CAMPAIGNS, tmp_path) == {}
    run_campaign(planned_campaign(planned, "subset", CAMPAIGNS), path, backend="sequential")
    assert complete_in_full(CAMPAIGNS, tmp_path) == {}  # a run is missing
    run_campaign(planned_campaign(planned, "full", CAMPAIGNS), path, backend="sequential")
    assert complete_in_full(CAMPAIGNS, tmp_path) == {"two_step": path}
    monkeypatch.setattr(
        plan_module,
        "PLAN",
        (Planned("two_step", 1, 2, always=("clock.duration_s=20", "statistics.settle_s=5")),),
    )
    said = []
    assert complete_in_full(CAMPAIGNS, tmp_path, said.append) == {}  # another campaign now
    assert said == [f"{path} is not taken: it is of other settings, or of fewer runs, than the plan"]


def test_every_filter_is_tuned_with_the_same_budget_over_a_whole_revolution():
    tunes = {}
    for name, tuned, filters in (
        ("alpha_kf_gaussian", "alpha_kf_tuned", ("kf", "alpha_kf")),
        ("alpha_kf_mixture", "alpha_kf_tuned", ("kf", "alpha_kf")),
        (
            "alpha_kf_sweep",
            "alpha_kf_sweep_tuned",
            tuple(f"kf_{alpha:g}" for alpha in ALPHAS),
        ),
    ):
        campaign, flown = (load_campaign(CAMPAIGNS / f"{each}.yaml") for each in (name, tuned))
        assert campaign.content["clock"]["duration_s"] == flown.content["clock"]["duration_s"] == 6000
        entries = yaml.safe_load((CAMPAIGNS / f"{tuned}.yaml").read_text(encoding="utf-8"))["filters"]
        for filter in filters:
            # The search began at the common value, and nothing but the process noise may differ.
            assert entries[filter]["process_noise"]["acceleration_psd_m2_s3"] == 1e-6
            settings = campaign.content["filters"][filter]
            assert settings == {**flown.content["filters"][filter], **_changed(settings)}
            assert campaign.tune.free[f"filters.{filter}.process_noise.acceleration_psd_m2_s3"] == (1e-11, 1e-3)
        tunes[name] = campaign.tune.model_copy(update={"filters": (), "free": {}})
    assert len(set(map(repr, tunes.values()))) == 1


def _changed(settings):
    """What tuning changes, and how the noise that a filter assumes is spelt where the radar's is Gaussian."""
    return {key: settings[key] for key in ("process_noise", "assumed_noise") if key in settings}


def test_extended_and_unscented_filters_have_the_process_noise_of_the_kalman_filter():
    for case in load_campaign(CAMPAIGNS / "alpha_kf_tuned.yaml").cases:
        noise = {
            name: case.variables[f"filters.{name}.process_noise.acceleration_psd_m2_s3"]
            for name in ("kf", "ekf", "ukf", "kf_r2_equal")
        }
        assert noise["kf"] == noise["ekf"] == noise["ukf"] == pytest.approx(noise["kf_r2_equal"] / 2, rel=2e-3)


def test_filters_of_other_sizes_differ_by_their_particles_alone():
    many = load_campaign(CAMPAIGNS / "mf_upf_particles.yaml").content
    few = load_campaign(CAMPAIGNS / "mf_upf_size.yaml").content
    for name, entry in few["filters"].items():
        base, _, particles = name.rpartition("_")
        assert entry == {**many["filters"][base], "particles": int(particles)}
    assert {key: few[key] for key in ("seed", "truth", "sensors", "start")} == {
        key: many[key] for key in ("seed", "truth", "sensors", "start")
    }

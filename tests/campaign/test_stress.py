"""`stress:`: what it adds to a campaign, what it leaves alone, and what it refuses."""

from pathlib import Path

import pytest
import yaml

from relnav_sim.campaign.load import load_campaign, parse_campaign, parse_content
from relnav_sim.campaign.problems import CampaignError

FIELD = (
    "{truth.forces.gravity: {model: ggm05s, degree: 3, order: 3}, truth.forces.drag: none,"
    " truth.epoch: 2026-07-13T00:00:00 UTC}"
)


ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def base(demo):
    return demo.partition("grid:")[0]


def stressed(text, **stresses):
    lines = ["stress:", *(f"  {name}: {overrides}" for name, overrides in stresses.items())]
    return parse_campaign("\n".join([text, *lines]))


def test_a_stress_changes_neither_the_campaign_nor_what_filters_are_told(demo):
    plain = parse_campaign(demo)
    made = stressed(demo, noisy="{sensors.radar.range_sigma_m: 8}", field=FIELD)
    assert made.hash == plain.hash and [case.id for case in made.cases] == [case.id for case in plain.cases]
    assert [case.label for case in made.stressed[2:]] == [
        f"{plain.cases[1].label}, stress={n}" for n in ("noisy", "field")
    ]
    assert len({case.id for case in (*made.cases, *made.stressed)}) == 6
    whole = made.with_stress()
    assert whole.cases == (*made.cases, *made.stressed) and whole.with_stress() == whole
    for case in made.stressed:
        nominal = next(one for one in made.cases if one.id == case.nominal)
        assert case.config.model_dump() == nominal.config.model_dump() and case.filter_ids == nominal.filter_ids
        assert case.config.told == nominal.config and nominal.config.flown is nominal.config
        assert case.config.flown.filters == nominal.config.filters
    noisy, field = made.stressed[:2]
    assert noisy.config.flown.sensors["radar"].range_sigma_m == 8 and noisy.config.sensors["radar"].range_sigma_m == 2
    assert noisy.config.flown.truth == noisy.config.truth
    assert field.config.flown.truth.forces.gravity.degree == 3 and field.config.flown.truth.forces.drag == "none"
    assert field.config.flown.truth.constants.mu_m3_s2 == 3.986004415e14 != field.config.truth.constants.mu_m3_s2


def test_factors_multiply_what_filters_are_told_defaults_and_lists_included(base):
    made = stressed(
        base,
        drag="{truth.deputy.drag_coefficient: {times: 3}, truth.forces.atmosphere.density_kg_m3: {times: 2}}",
        far="{truth.deputy.relative.position_m: {times: 0.5}}",
        prior="{start.velocity_m_s: [0.1, 0, 0]}",
        sick="{sensors.gnss.noise: [{kind: gaussian}, {kind: outage, windows_s: [[5, 9]]}]}",
    )
    drag, far, prior, sick = (case.config for case in made.stressed)
    assert drag.flown.truth.deputy.drag_coefficient == pytest.approx(6.6)
    told = drag.truth.forces.atmosphere.density_kg_m3
    assert drag.flown.truth.forces.atmosphere.density_kg_m3 == pytest.approx(2 * told)
    assert far.flown.truth.deputy.relative.position_m == (0, -1000, 50)
    assert prior.flown.start.velocity_m_s == (0.1, 0, 0) and prior.start.velocity_m_s == (0, 0, 0)
    assert len(sick.flown.sensors["gnss"].noise) == 2


def test_content_is_the_campaign_again(demo):
    made = stressed(
        demo,
        noisy="{sensors.radar.range_sigma_m: {times: 2}}",
        field=FIELD,
        whole="{truth.forces: {zonals: 2, drag: none}}",
        prior="{start.velocity_m_s: [0.1, 0, 0]}",
    )
    again = parse_content(made.content)
    assert again.hash == made.hash and again.content == made.content
    assert [case.id for case in again.stressed] == [case.id for case in made.stressed]


def test_zonals_may_take_the_place_of_a_field(base):
    text = base.replace(
        "forces: {zonals: 4, drag",
        "epoch: 2026-07-13T00:00:00 UTC\n  forces: {gravity: {model: ggm05s, degree: 3, order: 3}, drag",
    )
    made = stressed(text, zonal="{truth.forces.zonals: 4}", flat="{truth.forces.gravity.order: 0}")
    zonal, flat = (case.config.flown.truth for case in made.stressed)
    assert zonal.forces.gravity is None and zonal.constants.mu_m3_s2 == 3.986004418e14
    assert flat.forces.gravity.order == 0 and flat.constants.mu_m3_s2 == 3.986004415e14
    assert [case.id for case in parse_content(made.content).stressed] == [case.id for case in made.stressed]


def test_an_override_of_the_command_line_reaches_one_value(base):
    text = f"{base}\nstress:\n  a.b: {{sensors.radar.range_sigma_m: 8}}\n"
    made = parse_campaign(
        text, ["stress.a.b.sensors.radar.range_sigma_m=9", "stress.c={start.velocity_m_s: [1, 0, 0]}"]
    )
    assert [case.stress for case in made.stressed] == ["a.b", "c"]
    assert made.stressed[0].config.flown.sensors["radar"].range_sigma_m == 9


REFUSED = {
    "[]": ("stress", "must be a section of names"),
    "{a: 3}": ("stress.a", "must be paths with values"),
    "{nominal: {sensors.radar.range_sigma_m: 8}}": ("stress.nominal", "take another name"),
    "{a: {filters.kf.kind: ekf}}": ("stress.a.filters.kf.kind", "a truth that filters are not told of"),
    "{a: {clock.step_s: 2}}": ("stress.a.clock.step_s", "filters know the time"),
    "{a: {trth.forces.zonals: 2}}": ("stress.a.trth.forces.zonals", "did you mean 'truth'?"),
    "{a: {sensors.radr.range_sigma_m: 8}}": ("stress.a.sensors.radr.range_sigma_m", "did you mean 'radar'?"),
    "{a: {sensors.radar.range_sigma: 8}}": ("stress.a.sensors.radar.range_sigma", "did you mean 'range_sigma_m'?"),
    "{a: {sensors.radar: {range_sigma_m: 8}}}": ("stress.a.sensors.radar", "give the path of what is different"),
    "{a: {sensors.radar.range_sigma_m: 2}}": ("stress.a.sensors.radar.range_sigma_m", "this is no stress"),
    "{a: {sensors.radar.range_sigma_m: {times: -2}}}": ("stress.a.sensors.radar.range_sigma_m", "greater than 0"),
    "{a: {sensors.radar.range_sigma_m: {times: two}}}": ("stress.a.sensors.radar.range_sigma_m", "one number"),
    "{a: {sensors.radar.noise: {times: 2}}}": ("stress.a.sensors.radar.noise", "no number here to multiply"),
    "{a: {sensors.radar.host: deputy}}": ("stress.a.sensors.radar.host", "not its kind, its host or its channels"),
    "{a: {truth.forces.third_bodies: [sun]}}": ("stress.a.truth.forces.third_bodies", "depends on the calendar"),
    "{a: {start.velocity_sigma_m_s: 3}}": ("stress.a.start.velocity_sigma_m_s", "stress start.velocity_m_s"),
    "{a: {sensors.radar.latency_s: 1}}": ("stress.a.sensors.radar.latency_s", "no fix to start from"),
    "{a: {sensors.radar.noise: [{kind: gaussian}, {kind: bias}], sensors.radar.noise.scale: 2}}": (
        "stress.a.sensors.radar.noise.scale", "overrides the same value",
    ),
    "{a: {sensors.radar.range_sigma_m: 8}, b: {sensors.radar.range_sigma_m: {times: 4}}}": ("stress.b", "the same"),
}  # fmt: skip


@pytest.mark.parametrize("section", REFUSED)
def test_refusals_say_where_and_why(base, section):
    line = base.count("\n") + 2
    place, said = REFUSED[section]
    with pytest.raises(CampaignError) as refused:
        parse_campaign(f"{base}\nstress: {section}\n")
    assert any(
        problem.startswith(f"campaign:{line}: {place}") and said in problem for problem in refused.value.problems
    )


def test_a_stress_that_changes_nothing_in_one_case_names_it(demo):
    with pytest.raises(CampaignError, match=r"this is no stress \(in the case sensors.radar.noise.kind=gaussian\)"):
        stressed(demo, same="{sensors.radar.noise: {kind: gaussian}}")


def test_the_page_shows_the_shipped_campaign():
    page = (ROOT / "docs" / "regret.md").read_text(encoding="utf-8")
    shown = yaml.safe_load(page.split("```yaml\n")[1].partition("```")[0])["stress"]
    shipped = load_campaign(ROOT / "campaigns" / "stress.yaml")
    assert list(shown) == list(shipped.content["stress"]) == [case.stress for case in shipped.stressed]
    assert all(list(shown[name]) == list(values) for name, values in shipped.content["stress"].items())
    for name in ("ekf_quiet", "ekf_loose", "student_t", "ekf_field"):
        assert name in shipped.cases[0].config.filters and name in page

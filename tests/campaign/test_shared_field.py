"""Campaigns whose truth has no more of the gravity field than a filter believes in are marked, before and after."""

import pytest

from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.campaign.shared_field import shared_field, shared_field_of_results, shared_field_warnings

CAMPAIGN = """
name: pair
seed: 1
runs: 2
clock: {duration_s: 1000, step_s: 1, store_every_s: 10}
truth:
  chief: {orbit: {a_km: 6978.137, e: 0, i_deg: 50}, mass_kg: 1, area_m2: 1}
  deputy: {relative: {position_m: [200, 0, 0], velocity_m_s: [0, 0, 0]}, mass_kg: 1, area_m2: 1}
  forces: {zonals: ZONALS, drag: none}
sensors:
  radar: {range_sigma_m: 1, angle_sigma_deg: 0.05}
filters:
  cw: {kind: ekf}
  averaged: {kind: ekf, dynamics: {kind: schweighart_sedwick}}
  kepler: {kind: ekf, dynamics: {kind: nonlinear}}
  j2: {kind: ekf, dynamics: {kind: nonlinear_j2}}
  j4.a: {kind: ekf, dynamics: {kind: nonlinear_j2, zonals: 4}}
  learned: {kind: gp_ukf, dynamics: {kind: gp}}
  on_j4: {kind: gp_ukf, dynamics: {kind: gp, base: {kind: nonlinear_j2, zonals: 4}}}
"""


def campaign(zonals, more=""):
    return parse_campaign(CAMPAIGN.replace("ZONALS", str(zonals)) + more)


@pytest.mark.parametrize(
    ("zonals", "named"),
    [(4, "j4.a and on_j4 believe in"), (2, "j2, j4.a and on_j4 believe in"), (0, "kepler, j2, j4.a and on_j4 believe")],
)
def test_the_filters_that_know_all_of_it_are_named(zonals, named):
    (sentence,) = shared_field_warnings(campaign(zonals))
    assert sentence.startswith(named) and "truth.forces.gravity" in sentence


def test_a_result_says_the_same_of_the_filters_it_has():
    many = campaign(4, "grid: {truth.forces.zonals: [3, 4], filters.j2.dynamics.zonals: [2, 4]}\n")
    cases = [(case.label, case.variables, tuple(case.config.filters)) for case in many.cases]
    assert shared_field_of_results(many.content, cases) == shared_field_warnings(many)
    assert "(J2 to J4)" in " ".join(shared_field_warnings(many))
    label, variables, _ = cases[-1]
    (sentence,) = shared_field_of_results(many.content, [(label, variables, ("cw", "j2"))])
    assert sentence.startswith("j2 believes in all of the gravity field that the truth has (J2 to J4), so its ANEES")


def test_what_another_version_wrote_is_not_marked():
    content = campaign(4).content
    stranger = {**content, "filters": {"j4.a": {"kind": "ekf", "dynamics": {"kind": "gone"}}, "odd": {"kind": "ekf"}}}
    assert shared_field_of_results(stranger, [("base", {}, ("j4.a", "odd"))]) == ()
    assert shared_field_of_results({**content, "truth": {"other": 1}}, [("base", {}, ("j4.a",))]) == ()
    assert shared_field_of_results({"seed": 1}, [("base", {}, ("j4.a",))]) == ()


def test_fields_with_tesserals():
    part, whole = FieldExtent(20, 20, "ggm05s"), FieldExtent(40, 40, "ggm05s")
    assert shared_field(part, {"a": whole, "b": part, "c": FieldExtent(4), "d": None})[0].startswith("a and b believe")
    assert shared_field(whole, {"b": part, "c": FieldExtent(4)}) == []
    assert shared_field(part, {"other": FieldExtent(40, 40, "mine"), "order 4": FieldExtent(40, 4, "ggm05s")}) == []
    assert shared_field(FieldExtent(4), {"a": part})[0].startswith("a believes")
    assert shared_field(None, {"a": whole}) == []


@pytest.mark.parametrize(
    ("truth", "left_out"),
    [
        (FieldExtent(0), "200 m"),
        (FieldExtent(4), "2 m"),
        (FieldExtent(60, 0, "ggm05s"), "2 m"),
        (FieldExtent(4, 4, "ggm05s"), "2 m"),
        (FieldExtent(20, 20, "ggm05s"), "0.2 m"),
        (FieldExtent(40, 40, "ggm05s"), "centimetres"),
    ],
)
def test_the_sentence_says_how_much_the_truth_leaves_out(truth, left_out):
    assert f"10 km by some {left_out} in a revolution" in shared_field(truth, {"a": truth})[0]

"""Dynamics learned from the truth are told apart in a report."""

from types import SimpleNamespace

from relnav_sim.report.campaign_facts import leakage


def results(filters, *variables):
    headers = tuple(SimpleNamespace(variables=values) for values in variables)
    return SimpleNamespace(campaign_content={"filters": filters}, headers=headers, filters=tuple(filters))


def learning(training):
    return {"kind": "gp_ukf", "dynamics": {"kind": "gp", "training": training}}


def test_filters_that_learn_the_truth_are_named():
    entries = {
        "a": learning("truth"),
        "b": learning("smoothed_radar"),
        "c": {"kind": "ekf", "dynamics": {"kind": "cw"}},
    }
    (sentence,) = leakage(results(entries, {}))
    assert sentence.startswith("Leakage: the dynamics of a are learned from the truth")
    assert leakage(results({"b": entries["b"], "c": entries["c"]}, {})) == ()


def test_a_source_that_differs_between_cases():
    entries = {"a": learning("smoothed_radar"), "b": learning("smoothed_radar")}
    swept = ({"filters.a.dynamics.training": "smoothed_radar"}, {"filters.a.dynamics.training": "truth"})
    assert "dynamics of a are" in leakage(results(entries, *swept))[0]
    assert "dynamics of b are" in leakage(results(entries, {"filters.b.dynamics": learning("truth")["dynamics"]}))[0]

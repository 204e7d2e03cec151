"""Dynamics learned from the truth are told apart in a report."""

from types import SimpleNamespace

from relnav_sim.report.campaign_facts import leakage, shared_field


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


def test_filters_that_know_the_truths_field_are_named():
    exact = {"kind": "ekf", "dynamics": {"kind": "nonlinear_j2", "zonals": 4}}
    found = results({"a": exact, "b": exact, "c": {"kind": "ekf", "dynamics": {"kind": "cw"}}})
    spacecraft = {"mass_kg": 1.0, "area_m2": 1.0}
    chief = {"orbit": {"a_km": 7000.0, "e": 0.0, "i_deg": 50.0}} | spacecraft
    deputy = {"relative": {"position_m": [0.0, 100.0, 0.0], "velocity_m_s": [0.0, 0.0, 0.0]}} | spacecraft
    found.campaign_content["truth"] = {"chief": chief, "deputy": deputy}
    found.nominal = (0,)
    found.headers = (SimpleNamespace(label="base", variables={}, filters=("a", "b", "c")),)
    found.case_runs = lambda index, name: [] if name == "b" else [0]  # b has not run yet
    (sentence,) = shared_field(found)
    assert sentence.startswith("a believes in all of the gravity field that the truth has (J2 to J4)")

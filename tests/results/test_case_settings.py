"""Settings of cases, as they were flown."""

from types import SimpleNamespace

from relnav_sim.results.settings import case_setting

CAMPAIGN = {
    "sensors": {"radar": {"noise": {"kind": "gaussian"}, "range_sigma_m": 4.0}},
    "stress": {
        "glint": {"sensors.radar.noise": {"kind": "mixture", "scale": 5, "fraction": 0.1}},
        "worse": {"sensors.radar.range_sigma_m": {"times": 5}},
    },
}


def setting(path, stress="", variables=None):
    header = SimpleNamespace(variables=variables or {}, stress=stress)
    return case_setting(SimpleNamespace(headers=[header], campaign_content=CAMPAIGN), 0, path, None)


def test_what_a_stress_replaces_counts():
    assert setting("sensors.radar.noise.kind") == "gaussian"
    assert setting("sensors.radar.noise.kind", "glint") == "mixture"
    assert setting("sensors.radar.noise.kind", "glint", {"sensors.radar.noise": {"kind": "outage"}}) == "mixture"
    assert setting("sensors.radar.range_sigma_m", "glint", {"sensors.radar.range_sigma_m": 8.0}) == 8.0


def test_what_a_stress_multiplies_is_as_without_it():
    assert setting("sensors.radar.range_sigma_m", "worse") == 4.0
    assert setting("sensors.radar.range_sigma_m", "worse", {"sensors.radar.range_sigma_m": 8.0}) == 8.0

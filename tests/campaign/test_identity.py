import json
import pickle
import random
from pathlib import Path

import pytest
import yaml

from relnav_sim.campaign import CampaignError, load_campaign, parse_campaign

ROOT = Path(__file__).parents[2]


def identity(text, *overrides):
    campaign = parse_campaign(text, overrides)
    return campaign.hash, tuple(case.id for case in campaign.cases)


def shuffled(value, rng):
    if isinstance(value, dict):
        keys = list(value)
        rng.shuffle(keys)
        return {key: shuffled(value[key], rng) for key in keys}
    return [shuffled(inner, rng) for inner in value] if isinstance(value, list) else value


COSMETIC = {
    "a comment": lambda text: text + "\n# the end\n",
    "numbers spelt otherwise": lambda text: text.replace("duration_s: 600", "duration_s: 6.0e2").replace(
        "1.0e-7", "0.0000001"
    ),
    "a default written out": lambda text: text.replace(
        "kind: first_fix,", "kind: first_fix, velocity_m_s: [0, 0, -0.0],"
    ),
    "one sigma for three axes": lambda text: text.replace(
        "velocity_sigma_m_s: 0.5}", "velocity_sigma_m_s: [0.5, 0.5, 0.5]}"
    ),
    "a default in a varied value": lambda text: text.replace("- {kind: gaussian}", "- {kind: gaussian, scale: 1}"),
    "a key by its former name": lambda text: text.replace(
        "radar: {range_sigma_m", "radar: {carrier: chief, range_sigma_m"
    ),
    "a key by its name now": lambda text: text.replace("radar: {range_sigma_m", "radar: {host: chief, range_sigma_m"),
    "a word by its former name": lambda text: text.replace("kind: ekf", "kind: ekf\n    measurement: polar"),
    "a word by its name now": lambda text: text.replace("kind: ekf", "kind: ekf\n    measurement: spherical"),
    "a kind that is the name": lambda text: text.replace("radar: {range_sigma_m", "radar: {kind: radar, range_sigma_m"),
    "a default that came later": lambda text: text.replace("gnss: {", "gnss: {offset_s: 0, "),
    "a default of the clock that came later": lambda text: text.replace(
        "  duration_s: 600", "  store_covariance: false\n  duration_s: 600"
    ),
    "quotes": lambda text: text.replace("kind: ekf", 'kind: "ekf"'),
    "other line ends": lambda text: text.replace("\n", "\r\n"),
    "another order": lambda text: yaml.safe_dump(shuffled(yaml.safe_load(text), random.Random(3)), sort_keys=False),
    "more runs": lambda text: text.replace("runs: 40", "runs: 41"),
    "how it is tuned": lambda text: text.replace("runs: 40", "tune: {objective: position}\nruns: 40"),
    "other blocks": lambda text: text.replace("runs: 40", "runs: 40\nblock_runs: 7"),
}


@pytest.mark.parametrize("name", COSMETIC)
def test_a_cosmetic_edit_leaves_hash_and_cases(demo, name):
    edited = COSMETIC[name](demo)
    assert edited != demo
    assert identity(edited) == identity(demo)


@pytest.mark.parametrize(
    ("told", "sensors"), [("planned", ""), ("measured", "  accelerometer: {velocity_random_walk_m_s_sqrt_s: 1e-4}\n")]
)
def test_a_default_that_depends_on_the_sensors_written_out(demo, told, sensors):
    text = demo.replace("sensors:\n", f"sensors:\n{sensors}")
    one, other, third = (
        parse_campaign(text.replace("filters:\n", f"filters:\n  told: {{kind: kf{known}}}\n"))
        for known in ("", f", known_thrust: {told}", ", known_thrust: none")
    )
    assert (one.hash, one.cases, one.content) == (other.hash, other.cases, other.content)
    assert third.hash != one.hash


def test_what_is_the_default_in_some_cases_only_stays(demo):
    swept = ("grid={sensors.accelerometer: [null, {velocity_random_walk_m_s_sqrt_s: 1e-4}]}",)
    text = demo.replace("filters:\n", "filters:\n  told: {kind: kf, known_thrust: planned}\n")
    assert identity(text, *swept)[0] != identity(text.replace(", known_thrust: planned", ""), *swept)[0]
    assert [case.config.filters["told"].known_thrust for case in parse_campaign(text, swept).cases] == ["planned"] * 2


@pytest.mark.parametrize(
    ("name", "hash"),
    [
        ("demo", "a06e1e15b06a"),
        ("rendezvous", "a1c409217852"),  # with an accelerometer, latency and known thrust
        ("alpha_kf_bias", "f1995ccf24bd"),  # with augmented states
    ],
)
def test_results_of_relnav_0_1_can_be_extended(name, hash):
    """Hashes that relnav 0.1.1 gave, before keys had other names and sensors had names of one's choice."""
    assert load_campaign(ROOT / "campaigns" / f"{name}.yaml").hash.startswith(hash)


REAL = {
    "another seed": ("seed: 20251030", "seed: 20251031"),
    "another seed beyond a double": ("seed: 20251030", "seed: 9007199254740993"),
    "another name": ("name: demo", "name: demonstration"),
    "another step": ("step_s: 1 ", "step_s: 0.5 "),
    "another drag": ("drag: exponential", "drag: none"),
    "another noise": ("angle_sigma_deg: 0.1", "angle_sigma_deg: 0.11"),
    "another value of the grid": ("fraction: 0.1", "fraction: 0.2"),
    "another process noise": ("1.0e-7} # what", "1.1e-7} # what"),
    "covariances stored": ("  duration_s: 600", "  store_covariance: true\n  duration_s: 600"),
    "another settling time": ("settle_s: 120", "settle_s: 121"),
}


@pytest.mark.parametrize("name", REAL)
def test_a_real_edit_changes_the_hash(demo, name):
    old, new = REAL[name]
    assert old in demo
    assert identity(demo.replace(old, new))[0] != identity(demo)[0]


def test_seeds_beyond_a_double_stay_apart(demo):
    one, other = (demo.replace("20251030", str(2**53 + offset)) for offset in (0, 1))
    assert identity(one)[0] != identity(other)[0]


def test_filters_are_no_part_of_a_case(demo):
    more = demo.replace("filters:\n", "filters:\n  ekf_loud: {kind: ekf, process_noise: {acceleration_psd_m2_s3: 1}}\n")
    assert identity(more)[0] != identity(demo)[0]
    assert identity(more)[1] == identity(demo)[1]


def test_a_filter_without_a_value_is_left_out(demo):
    first, *others = parse_campaign(demo).cases[0].config.filters
    without = parse_campaign(demo, [f"filters.{first}=null"])
    assert list(without.cases[0].config.filters) == others
    assert without.content["filters"] == {
        k: v for k, v in parse_campaign(demo).content["filters"].items() if k != first
    }
    with pytest.raises(CampaignError, match="at least one filter"):
        parse_campaign(demo, [f"filters.{name}=null" for name in (first, *others)])


def test_a_varied_filter_option_makes_cases(demo):
    varied = demo + "  filters.ukf.alpha: [0.5, 1]\n"
    assert len(set(identity(varied)[1])) == 4


def test_added_cases_leave_the_others(demo):
    more = demo + "    - {kind: mixture, scale: 10, fraction: 0.1}\n"
    assert identity(more)[1][:2] == identity(demo)[1]


def test_names_and_seeds_are_no_part_of_a_case(demo):
    other = demo.replace("name: demo", "name: other").replace("seed: 20251030", "seed: 1")
    assert identity(other)[1] == identity(demo)[1]


def test_content_is_the_file_with_defaults(demo):
    campaign = parse_campaign(demo)
    clock = {"duration_s": 600.0, "step_s": 1.0, "store_every_s": 5.0, "store_covariance": False}
    assert campaign.content["clock"] == clock
    assert campaign.content["start"]["velocity_sigma_m_s"] == [0.5, 0.5, 0.5]
    assert campaign.content["filters"]["ekf"]["measurement"] == "spherical"
    assert [value["kind"] for value in campaign.content["grid"]["sensors.radar.noise"]] == ["gaussian", "mixture"]
    assert campaign.content["zip"] == {}


def test_a_campaign_survives_pickling(demo):
    campaign = parse_campaign(demo)
    copy = pickle.loads(pickle.dumps(campaign))
    assert copy == campaign
    assert type(copy.cases[0].config.filters["ekf"]) is type(campaign.cases[0].config.filters["ekf"])


def test_a_campaign_error_survives_pickling():
    error = pickle.loads(pickle.dumps(CampaignError(["a:1: b", "a:2: c"])))
    assert error.problems == ["a:1: b", "a:2: c"]
    assert str(error) == "a:1: b\na:2: c"


def test_load_remembers_the_file(demo, tmp_path):
    file = tmp_path / "my.yaml"
    file.write_text(demo, encoding="utf-8")
    campaign = load_campaign(file)
    assert campaign.path == file
    assert campaign.text == demo
    with pytest.raises(FileNotFoundError):
        load_campaign(tmp_path / "missing.yaml")


def test_a_filter_registered_later_is_accepted_with_its_options(demo, monkeypatch):
    from pydantic import Field

    from relnav_sim.filters import registry
    from relnav_sim.options import Options

    class OwnOptions(Options):
        gain: float = Field(gt=0, description="Its gain")

    text = demo.replace("  kf:\n", "  own: {kind: own, gain: 2}\n  kf:\n")
    with pytest.raises(CampaignError, match="there is no kind 'own'"):
        parse_campaign(text)
    monkeypatch.setattr(registry, "_KINDS", dict(registry.filter_kinds()))
    registry.register_filter("own", OwnOptions, measurement="cartesian")(type("OwnFilter", (), {}))
    entry = parse_campaign(text).cases[0].config.filters["own"]
    assert isinstance(entry, OwnOptions)
    assert (entry.kind, entry.gain, entry.measurement) == ("own", 2.0, "cartesian")
    with pytest.raises(CampaignError, match=r"filters.own.gain: must be greater than 0, not -2"):
        parse_campaign(text.replace("gain: 2", "gain: -2"))


def test_a_filter_entry_is_its_kinds_own_options(demo):
    from relnav_sim.filters.registry import filter_kinds

    for entry in parse_campaign(demo).cases[0].config.filters.values():
        assert isinstance(entry, filter_kinds()[entry.kind].options_model)


@pytest.mark.parametrize("section", ["grid", "zip"])
def test_cases_that_differ_in_all_their_filters_are_told_apart(demo, section):
    """A case that is given its filters as a whole is another case for every other set of them."""
    data = yaml.safe_load(demo)
    data["grid"] = {}
    del data["filters"]
    entries = [{"ekf": {"kind": "ekf"}}, {"ekf": {"kind": "ukf"}}, {"ekf": {"kind": "ekf"}, "b": {"kind": "kf"}}]

    def ids(filters):
        return [case.id for case in parse_campaign(json.dumps({**data, section: {"filters": filters}})).cases]

    found = ids(entries)
    assert len(set(found)) == 3
    assert ids(entries[::-1]) == found[::-1], "the id does not depend on the place in the list"
    for one, same in ((entries[0], {"ekf": {"kind": "ekf", "gate_probability": None}}), (entries[2], dict(entries[2]))):
        with pytest.raises(CampaignError, match="the same"):
            ids([one, same])

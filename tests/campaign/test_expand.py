import pytest

from relnav_sim.campaign import CampaignError, parse_campaign
from relnav_sim.campaign.paths import PathError, parse_path, replaced, value_at


@pytest.fixture
def base(demo):
    """The demo campaign without what it varies."""
    return demo[: demo.index("# A case for every combination")]


def labels(text, *overrides):
    return [case.label for case in parse_campaign(text, overrides).cases]


def problems(text, *overrides):
    with pytest.raises(CampaignError) as refusal:
        parse_campaign(text, overrides)
    return refusal.value.problems


def test_without_variables_there_is_one_case(base):
    campaign = parse_campaign(base)
    assert [(case.label, dict(case.variables)) for case in campaign.cases] == [("base", {})]


def test_grid_is_a_product_with_the_first_path_slowest(base):
    text = base + "grid:\n  clock.step_s: [1, 2]\n  sensors.radar.range_sigma_m: [3, 4.5]\n"
    campaign = parse_campaign(text, ["clock.store_every_s=10"])
    assert [case.label for case in campaign.cases] == [
        "clock.step_s=1, sensors.radar.range_sigma_m=3",
        "clock.step_s=1, sensors.radar.range_sigma_m=4.5",
        "clock.step_s=2, sensors.radar.range_sigma_m=3",
        "clock.step_s=2, sensors.radar.range_sigma_m=4.5",
    ]
    last = campaign.cases[-1]
    assert last.variables == {"clock.step_s": 2.0, "sensors.radar.range_sigma_m": 4.5}
    assert (last.config.clock.step_s, last.config.sensors["radar"].range_sigma_m) == (2.0, 4.5)


def test_zip_moves_lists_together(base):
    text = base + "zip:\n  clock.step_s: [1, 2, 2]\n  sensors.radar.range_sigma_m: [4, 4, 3]\n"
    cases = parse_campaign(text, ["clock.store_every_s=10"]).cases
    values = [(case.config.clock.step_s, case.config.sensors["radar"].range_sigma_m) for case in cases]
    assert values == [(1.0, 4.0), (2.0, 4.0), (2.0, 3.0)]


def test_grid_and_zip_together(base):
    text = base + "grid:\n  runs_none: []\n"
    assert "cannot be varied" in problems(text)[0]
    text = (
        base
        + "grid:\n  sensors.radar.noise: [{kind: gaussian}, {kind: mixture, scale: 2, fraction: random}]\n"
        + "zip:\n  clock.duration_s: [300, 600]\n  statistics.settle_s: [100, 200]\n"
    )
    assert labels(text) == [
        f"sensors.radar.noise.kind={kind}, clock.duration_s={duration}, statistics.settle_s={settle}"
        for kind in ("gaussian", "mixture")
        for duration, settle in ((300, 100), (600, 200))
    ]


def test_a_label_names_every_key_that_differs_between_values(base):
    both = "[{kind: mixture, scale: 2, fraction: 0.1}, {kind: mixture, scale: 5, fraction: 0.3}]"
    assert labels(base + f"grid:\n  sensors.radar.noise: {both}\n") == [
        "sensors.radar.noise.scale=2,fraction=0.1",
        "sensors.radar.noise.scale=5,fraction=0.3",
    ]
    parts = "[{kind: mixture, scale: 2, fraction: 0.1}, {kind: mixture, scale: 5, fraction: 0.1}]"
    assert labels(base + f"grid:\n  sensors.radar.noise: {parts}\n") == [
        "sensors.radar.noise.scale=2",
        "sensors.radar.noise.scale=5",
    ]
    mixed = "[{kind: gaussian}, {kind: gaussian, scale: 2}]"
    assert labels(base + f"grid:\n  sensors.radar.noise: {mixed}\n") == [
        "sensors.radar.noise.scale=default",
        "sensors.radar.noise.scale=2",
    ]


def test_labels_keep_close_numbers_apart(base):
    close = labels(base + "grid:\n  sensors.radar.range_sigma_m: [1.0000001, 1.0000002]\n")
    assert close == ["sensors.radar.range_sigma_m=1.0000001", "sensors.radar.range_sigma_m=1.0000002"]


def test_a_path_may_lead_into_a_filter_whose_name_has_points(base):
    text = base.replace("  ukf:\n", "  ukf_0.5:\n") + "grid:\n  filters.ukf_0.5.alpha: [0.5, 1]\n"
    cases = parse_campaign(text).cases
    assert [case.config.filters["ukf_0.5"].alpha for case in cases] == [0.5, 1.0]
    assert cases[0].id != cases[1].id


@pytest.mark.parametrize(
    ("varied", "sentence"),
    [
        ("truth.manoeuvres.hop.time_s", "truth.manoeuvres; truth.manoeuvres.hop: give exactly one of delta_v_m_s"),
        ("filters.nosuch.alpha", "filters.nosuch; filters.nosuch.kind: this key is missing"),
    ],
)
def test_what_only_the_grid_makes_is_blamed_on_the_grid(base, varied, sentence):
    text = base + f"grid:\n  {varied}: [10, 20]\n"
    (problem,) = problems(text)
    assert problem.startswith(
        f"campaign:{len(text.splitlines())}: grid.{varied}: nothing but this list gives {sentence}"
    )


def test_a_path_may_make_a_section(base):
    text = base.replace("start: {kind", "#") + "grid:\n  start.velocity_sigma_m_s: [0.5, 1]\n"
    cases = parse_campaign(text, ["start.kind=first_fix"]).cases
    assert [case.config.start.velocity_sigma_m_s for case in cases] == [(0.5,) * 3, (1.0,) * 3]


@pytest.mark.parametrize(
    ("varied", "words"),
    [
        ("grid:\n  sensor.radar.range_sigma_m: [1]", "'sensor' cannot be varied; did you mean 'sensors'?"),
        ("grid:\n  runs: [1, 2]", "'runs' cannot be varied"),
        ("grid:\n  sensors..radar: [1]", "is not a path"),
        ("grid:\n  clock.step_s: 1", "must be a list of at least one value"),
        ("grid:\n  clock.step_s: []", "must be a list of at least one value"),
        ("grid:\n  clock.step_s: [1, 1.0]", "values 1 and 2 of the list are the same"),
        ("grid:\n  clock.step_s.x: [1]", "clock.step_s is a single value, so it cannot have the key 'x'"),
        ("grid:\n  truth.deputy.relative.position_m[3]: [1]", "[3] is not there: a list of 3"),
        ("grid:\n  sensors.radar: [1]\n  sensors.radar.noise: [{kind: gaussian}]", "varies the same value"),
        ("grid: [1]", "must be a section of paths"),
        (
            "zip:\n  clock.step_s: [1, 2]\n  statistics.settle_s: [1]",
            "equally long: clock.step_s has 2, statistics.set",
        ),
        (
            "grid:\n" + "".join(f"  clock.k{n}: [1, 2, 3, 4]\n" for n in range(20)),
            "1099511627776 cases; a campaign has",
        ),
        ("grid:\n  sensors.radar.range_sigma_m: [2, -1]", "sensors.radar.range_sigma_m[1]: must be greater than 0"),
        (
            "grid:\n  sensors.radar.noise: [{kind: mix}]",
            "noise[0].kind: there is no kind 'mix'; did you mean 'mixture'?",
        ),
        ("grid:\n  sensors.radar.nose: [1]", "unknown key; did you mean 'noise'?"),
        ("grid:\n  sensors.radar.noise: [{kind: gaussian}, {kind: gaussian, scale: 1}]", "mean the same"),
    ],
)
def test_what_cannot_be_varied_is_said(base, varied, words):
    found = problems(base + varied + "\n")
    assert any(words in problem for problem in found)


def test_a_problem_of_some_cases_names_their_values(base):
    text = base + "grid:\n  clock.step_s: [1, 0.7]\n  sensors.radar.range_sigma_m: [1, 2]\n"
    found = problems(text)
    assert found[0].endswith("take 599.9 or 600.6 (in the case clock.step_s=0.7)")
    line = text.partition("duration_s")[0].count("\n") + 1
    assert found[0].startswith(f"campaign:{line}: clock.duration_s: 600 s is no whole number of steps of 0.7 s")


def test_a_problem_of_all_cases_is_said_once(demo):
    found = problems(demo.replace("duration_s: 600", "duration_s: 600.5"))
    assert len(found) == 1
    assert found[0].endswith("clock.duration_s: 600.5 s is no whole number of steps of 1 s; take 600 or 601")


class TestOverrides:
    def test_change_values(self, demo):
        campaign = parse_campaign(demo, ["runs=3", "clock.step_s=0.5", "filters.ukf={kind: ukf, alpha: 0.5}"])
        assert campaign.runs == 3
        assert campaign.cases[0].config.clock.step_s == 0.5
        assert campaign.cases[0].config.filters["ukf"].alpha == 0.5

    def test_change_what_is_varied(self, demo):
        assert labels(demo, "grid.sensors.radar.noise=[{kind: gaussian}]") == ["sensors.radar.noise.kind=gaussian"]
        assert labels(demo, "grid={}") == ["base"]

    @pytest.mark.parametrize(
        ("change", "words"),
        [
            ("runs=010", "--set runs=010: runs: 010 has a leading zero"),
            ("runs", "write PATH=VALUE"),
            ("=3", "is not a path"),
            ("runs=[", "bracket"),
            ("clock.step=1", "clock.step: unknown key; did you mean 'step_s'?"),
            ("sensors.radar.nosuch=3", "sensors.radar.nosuch: unknown key; known here: kind, host, noise, "),
            ("grid.sensors.radar.nosuch=[3]", "nosuch[0]: unknown key; known here: kind, host, noise, "),
            ("nosuch=3", "nosuch: unknown key; known here: name, "),
            ("sensors.radar.noise.kind=bias", "grid varies this value; set grid.sensors.radar.noise=[VALUE]"),
            ("sensors={}", "grid varies this value"),
            ("name.x=1", "name is a single value, so it cannot have the key 'x'"),
        ],
    )
    def test_are_as_strict_as_the_file(self, demo, change, words):
        assert any(words in problem for problem in problems(demo, change))


def test_paths():
    data = {"a": [{"b": 1}], "f": {"x_0.5": {"y": 2}}}
    assert parse_path("a[0].b", data) == ("a", 0, "b")
    assert parse_path("f.x_0.5.y", data) == ("f", "x_0.5", "y")
    assert value_at(data, ("f", "x_0.5", "y")) == 2
    assert value_at(data, ("f", "none", "y")) is None
    changed = replaced(data, ("a", 0, "b"), 3)
    assert changed["a"] == [{"b": 3}]
    assert data["a"] == [{"b": 1}]
    assert changed["f"] is data["f"]
    with pytest.raises(PathError):
        parse_path("a..b", data)
    with pytest.raises(PathError):
        parse_path("a[x]", data)


NAMED = "grid:\n  sensors.radar.noise: {calm: {kind: gaussian}, glint: {kind: mixture, scale: 2, fraction: 0.1}}\n"
LISTED = "grid:\n  sensors.radar.noise: [{kind: gaussian}, {kind: mixture, scale: 2, fraction: 0.1}]\n"


def test_names_of_values_are_the_labels_and_nothing_else(base):
    named, listed = parse_campaign(base + NAMED), parse_campaign(base + LISTED)
    assert [case.label for case in named.cases] == ["calm", "glint"]
    assert [case.id for case in named.cases] == [case.id for case in listed.cases]
    assert [case.variables for case in named.cases] == [case.variables for case in listed.cases]
    assert (named.hash, named.content) == (listed.hash, listed.content)


def test_names_beside_lists_in_zip_and_under_stress(base):
    text = base + NAMED + "zip:\n  clock.duration_s: {short: 300, long: 600}\n  statistics.settle_s: [100, 200]\n"
    assert labels(text) == [
        f"{noise}, {span}, statistics.settle_s={settle}"
        for noise in ("calm", "glint")
        for span, settle in (("short", 100), ("long", 200))
    ]
    stressed = parse_campaign(base + NAMED + "stress:\n  noisy:\n    sensors.radar.range_sigma_m: {times: 3}\n")
    assert [case.label for case in stressed.stressed] == ["calm, stress=noisy", "glint, stress=noisy"]


def test_names_that_two_paths_share_have_their_paths_before_them(base):
    text = base + "grid:\n  clock.duration_s: {low: 300, high: 600}\n  sensors.radar.range_sigma_m: {low: 2, high: 4}\n"
    assert labels(text)[1] == "clock.duration_s=low, sensors.radar.range_sigma_m=high"


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ("{}", "must be a list of at least one value, or a section of values by name"),
        ("{'12': 2}", "the name 12 of a value would be taken for the number of a case"),
        ("{a/b: 2}", "the name 'a/b' of a value: a name has 1 to 64 letters"),
        ("{nan: 2}", "the name 'nan' of a value: pandas and R"),
        ("{base: 2}", "'base' is the case of a campaign that varies nothing; take another name, as nominal"),
        ("{a: 2, b: 2.0}", "values a and b are the same; keep one"),
        ("{a: 2, b: fast}", "sigma_m.b: must be a number, not the text 'fast'"),
    ],
)
def test_names_that_do_not_serve(base, values, sentence):
    (problem,) = problems(base + f"grid:\n  sensors.radar.range_sigma_m: {values}\n")
    assert sentence in problem
    assert problem.startswith("campaign:") and "grid.sensors.radar.range_sigma_m" in problem

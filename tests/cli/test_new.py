"""`relnav new` and `relnav list`: every campaign of the library flies, and the page about them says what they are."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from benchmarks.scenarios import choice_of, decision_of, decisions_on, page_of
from relnav_sim import load_campaign, simulate
from relnav_sim.campaign import loader
from relnav_sim.campaign.blocks import run_seconds
from relnav_sim.campaign.warnings import campaign_warnings
from relnav_sim.cli import library
from relnav_sim.cli.app import app
from relnav_sim.cli.library import campaigns_of, first_words, library_names, library_summaries, library_text
from relnav_sim.kernels.compiling import interpreted

NAMES = library_names()
PAGE = Path(__file__).parents[2] / "docs" / "scenarios.md"


def invoke(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_folder_list_and_page_name_the_same_scenarios():
    folder = files("relnav_sim.campaign").joinpath("templates")
    in_folder = sorted(Path(each.name).stem for each in folder.iterdir())
    listed = [line.split()[0] for line in invoke("list", "templates").stdout.splitlines() if not line.startswith(" ")]
    on_page = list(decisions_on(PAGE.read_text(encoding="utf-8")))
    assert listed == on_page == list(NAMES)
    assert sorted(listed) == in_folder
    assert listed[0] == "demo"
    helped = invoke("new", "--help").stdout
    assert all(name in helped for name in NAMES)


def test_the_page_says_of_each_scenario_what_its_file_says():
    page = PAGE.read_text(encoding="utf-8")
    assert page == page_of(decisions_on(page))


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_is_a_campaign_of_seconds(here, name):
    made = invoke("new", "mine.yaml", "--from", name)
    assert made.exit_code == 0, made.output
    campaign = load_campaign("mine.yaml")
    assert campaign.name == "mine"
    assert campaign.path == Path("mine.yaml")
    assert sum(campaign.runs * run_seconds(case.config) for case in campaign.cases) < 20
    text = Path("mine.yaml").read_text(encoding="utf-8")
    assert text.startswith("# yaml-language-server: $schema=schema.json\n# ")
    assert first_words(text).endswith("?")
    assert "relnav validate FILE" in text

    assert mentioned(decisions_on(PAGE.read_text(encoding="utf-8"))[name], campaign.cases[0].config.filters)


def mentioned(decision, filters):
    """Return the filters that a decision names."""
    return set(filters) & {word.strip(",.;:()") for word in decision.split()}


@pytest.mark.parametrize("name", [name for name in NAMES if name != "angles-only"])
def test_a_scenario_has_nothing_to_be_warned_of(here, name):
    """Of its geometry. Angles alone are not observable without a manoeuvre, and that scenario is there to show that."""
    invoke("new", "mine.yaml", "--from", name)
    with interpreted():
        assert campaign_warnings(load_campaign("mine.yaml")) == ()


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_page_has_the_choice_that_a_report_makes(tmp_path, name):
    """Flown again: which filter is chosen, not the digits, which another machine may round otherwise."""
    on_page = decisions_on(PAGE.read_text(encoding="utf-8"))[name]
    assert choice_of(decision_of(name, tmp_path)) == choice_of(on_page)


def test_the_rendezvous_arrives(here):
    """From 2000 m behind to 1000 m behind, by two radial impulses."""
    invoke("new", "mine.yaml", "--from", "rendezvous")
    campaign = load_campaign("mine.yaml", ["truth.execution_errors={}", "truth.forces.zonals=0"])
    flown = simulate(campaign).relative[0]
    assert abs(flown[0, 1] + 2000) < 1
    assert abs(flown[-1, 1] + 1000) < 10
    assert abs(flown[-1, 4]) < 0.02


def test_the_approach_arrives(here):
    """From 12 km behind along the arc to rest 200 m behind, without execution errors."""
    invoke("new", "mine.yaml", "--from", "approach")
    flown = simulate(load_campaign("mine.yaml", ["truth.execution_errors={}", "runs=1"])).relative[0]
    assert abs((flown[0, :3] ** 2).sum() ** 0.5 - 12000) < 1
    assert abs(flown[-1, 1] + 200) < 5


def test_eclipse_and_outage_are_one_gap(here):
    """The radio link of outage-eclipse is silent while the camera sees nothing for the second time.

    The Sun stands in the orbit plane at the start's direction: the shadow, a cylinder of radius R, begins asin(R / a)
    before half a revolution and ends as long after it. J2 shifts that by less than the 20 s between two pictures.
    """
    invoke("new", "mine.yaml", "--from", "outage-eclipse")
    flown = simulate(load_campaign("mine.yaml", ["runs=1"]))
    radius, a, mu = 6378137.0, 6828137.0, 3.986004415e14
    mean_motion = (mu / a**3) ** 0.5
    begin, end = ((3 * np.pi + sign * np.arcsin(radius / a)) / mean_motion for sign in (-1, 1))
    times = {name: flown.times_s[np.isfinite(flown.z[name][0, :, 0])] for name in ("camera", "crosslink")}
    for name, spacing in (("camera", 20), ("crosslink", 30)):
        before, after = times[name][times[name] < 8400].max(), times[name][times[name] > 8400].min()
        assert abs(before - begin) < 2 * spacing, name
        assert abs(after - end) < 2 * spacing, name


def test_an_unknown_template_has_a_near_name(here):
    result = invoke("new", "mine.yaml", "--from", "rendevous")
    assert result.exit_code == 2
    assert result.stderr == "relnav: no template is named 'rendevous'; did you mean 'rendezvous'?\n"
    assert not Path("mine.yaml").exists()


class TestCampaigns:
    def test_the_library_is_listed_from_any_folder(self, here):
        listed = invoke("list", "campaigns").stdout
        assert listed.startswith("In the library; to have one: relnav new my.yaml --from NAME\n")
        for name, question in library_summaries():
            assert name in listed
            assert question.split("?")[0][:60] in listed

    def test_what_looks_like_a_campaign_is_listed_before_it(self, here):
        Path("campaigns").mkdir()
        Path("mine.yaml").write_text("# Mine.\n" + library_text("demo", "mine"), encoding="utf-8")
        Path("campaigns/other.yml").write_text(library_text("geo", "other"), encoding="utf-8")
        wrong = library_text("demo").replace("sensors:", "sensor:")
        Path("wrong.yaml").write_text(wrong, encoding="utf-8")
        Path(".hidden.yaml").write_text(library_text("demo"), encoding="utf-8")
        Path("mkdocs.yml").write_text("site_name: mine\nnav: []\n", encoding="utf-8")
        Path("large.yaml").write_text(library_text("demo") + "#" * 250_000, encoding="utf-8")
        Path("folder.yaml").mkdir()
        Path("binary.yaml").write_bytes(b"\xff\xfe\x00")
        found = campaigns_of(Path())
        assert [str(path) for path, _ in found] == ["campaigns/other.yml", "mine.yaml", "wrong.yaml"]
        assert found[1][1] == "Mine."
        listed = invoke("list", "campaigns").stdout
        assert listed.index("mine.yaml") < listed.index("In the library")
        assert "mkdocs" not in listed


def test_no_larger_file_is_listed_than_the_loader_takes():
    """Two numbers, since a list must not wait for the loader to be imported."""
    assert library._MOST_BYTES == loader.MOST_BYTES

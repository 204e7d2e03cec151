"""`relnav new`: every template is a campaign that flies."""

from importlib.resources import files
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relnav_sim import load_campaign, simulate
from relnav_sim.campaign.blocks import run_seconds
from relnav_sim.campaign.warnings import campaign_warnings
from relnav_sim.cli.app import app
from relnav_sim.cli.new import TEMPLATES
from relnav_sim.kernels.compiling import interpreted


def invoke(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_templates_are_those_of_the_package():
    folder = files("relnav_sim.campaign").joinpath("templates")
    assert {Path(each.name).stem for each in folder.iterdir() if each.name.endswith(".yaml")} == TEMPLATES.keys()


@pytest.mark.parametrize("name", TEMPLATES)
def test_a_template_is_a_campaign_of_seconds(here, name):
    made = invoke("new", "mine.yaml", "--from", name)
    assert made.exit_code == 0, made.output
    campaign = load_campaign("mine.yaml")
    assert campaign.name == "mine"
    assert campaign.path == Path("mine.yaml")
    assert sum(campaign.runs * run_seconds(case.config) for case in campaign.cases) < 20
    text = Path("mine.yaml").read_text(encoding="utf-8")
    assert text.startswith("# yaml-language-server: $schema=schema.json\n# ")
    assert "relnav validate FILE" in text


@pytest.mark.parametrize("name", [name for name in TEMPLATES if name != "angles-only"])
def test_a_template_has_nothing_to_be_warned_of(here, name):
    """Of its geometry. Angles alone are not observable without a manoeuvre, and the template is there to show that."""
    invoke("new", "mine.yaml", "--from", name)
    with interpreted():
        assert campaign_warnings(load_campaign("mine.yaml")) == ()


def test_the_rendezvous_arrives(here):
    """From 2000 m behind to 1000 m behind, by two radial impulses."""
    invoke("new", "mine.yaml", "--from", "rendezvous")
    campaign = load_campaign("mine.yaml", ["truth.execution_errors={}", "truth.forces.zonals=0"])
    flown = simulate(campaign).relative[0]
    assert abs(flown[0, 1] + 2000) < 1
    assert abs(flown[-1, 1] + 1000) < 10
    assert abs(flown[-1, 4]) < 0.02


def test_an_unknown_template_has_a_near_name(here):
    result = invoke("new", "mine.yaml", "--from", "rendevous")
    assert result.exit_code == 2
    assert result.stderr == "relnav: no template is named 'rendevous'; did you mean 'rendezvous'?\n"
    assert not Path("mine.yaml").exists()


def test_templates_are_listed():
    assert all(name in invoke("new", "--help").stdout for name in TEMPLATES)
    listed = invoke("list", "templates").stdout
    assert [line.split()[0] for line in listed.splitlines() if not line.startswith(" ")] == list(TEMPLATES)

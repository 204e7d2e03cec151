"""The command that a hint or a report gives for a run names the campaign's file, whatever options were given."""

from types import SimpleNamespace

import pytest
import typer

from relnav_sim.cli.app import app
from relnav_sim.plots.commands import run_command

OPTIONS = [each for each in typer.main.get_command(app).commands["run"].params if each.param_type_name == "option"]


def hint(*words):
    recorded = " ".join(["relnav run", *words])
    return run_command(SimpleNamespace(campaign_name="demo", provenance=SimpleNamespace(command_line=recorded)))


@pytest.mark.parametrize(
    ("name", "is_switch"), [(name, bool(each.is_flag)) for each in OPTIONS for name in each.opts], ids=str
)
def test_any_option_may_stand_before_the_file_or_another_option(name, is_switch):
    given = [name] if is_switch else [name, "4"]
    kept = " --set 4" if name == "--set" else " --runs 4" if name == "--runs" else ""
    assert hint(*given, "my.yaml") == f"relnav run my.yaml{kept}"
    assert hint("my.yaml", *given, "--out", "there.h5") == f"relnav run my.yaml{kept}"


def test_the_command_has_switches_and_options_with_a_value():
    assert {bool(each.is_flag) for each in OPTIONS} == {True, False}

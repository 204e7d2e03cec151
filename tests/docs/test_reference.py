"""The Python reference: every public name is on the page, its docstring complete, and its example runs."""

import doctest
import inspect
import re

import pytest
from site_pages import ROOT

import relnav_sim

RESULTS = {  # whose examples read or write results, and wait for `make check-slow`
    "run_campaign", "open_results", "Results", "regret", "Regret", "error_budget", "Budget",
}  # fmt: skip
NO_ARGUMENTS = {"Results", "EphemerisError", "CampaignError"}  # made by relnav, not by its user


def example(name):
    thing = getattr(relnav_sim, name)
    (found,) = doctest.DocTestFinder(recurse=False).find(thing, name, globs={}) if inspect.getdoc(thing) else [None]
    return found


def run(name):
    failures = []
    doctest.DocTestRunner(verbose=False).run(example(name), out=failures.append)
    assert not failures, "".join(failures)


@pytest.fixture
def beside_campaigns(tmp_path, monkeypatch):
    (tmp_path / "campaigns").symlink_to(ROOT / "campaigns")
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", relnav_sim.__all__)
def test_every_name_has_an_example(name):
    assert example(name).examples
    assert "SKIP" not in example(name).docstring


@pytest.mark.parametrize("name", sorted(set(relnav_sim.__all__) - RESULTS))
def test_examples_run(name, beside_campaigns):
    run(name)


@pytest.mark.slow
def test_examples_that_read_results_run(beside_campaigns):
    for campaign, stress in (("demo", False), ("stress", True)):
        loaded = relnav_sim.load_campaign(f"campaigns/{campaign}.yaml", ["runs=6"])
        relnav_sim.run_campaign(loaded.with_stress() if stress else loaded, backend="sequential")
    for name in sorted(RESULTS):
        run(name)


@pytest.mark.parametrize("name", relnav_sim.__all__)
def test_docstrings_name_every_argument(name):
    thing = getattr(relnav_sim, name)
    if inspect.ismodule(thing) or name in NO_ARGUMENTS:
        return
    text = inspect.getdoc(thing)
    parameters = [p for p in inspect.signature(thing).parameters if p != "tai_ps"]
    assert [p for p in parameters if not re.search(rf"^\s+\**{p}: ", text, re.MULTILINE)] == []


def test_the_page_has_every_name():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    shown = re.findall(r"^::: ([\w.]+)\n    options: \{heading: (\w+)", page, re.MULTILINE)
    homes = {}
    for name in relnav_sim.__all__:
        thing = getattr(relnav_sim, name)
        homes[name] = thing.__name__ if inspect.ismodule(thing) else f"{thing.__module__}.{thing.__qualname__}"
    assert {heading: path for path, heading in shown} == homes

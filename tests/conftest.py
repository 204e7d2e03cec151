"""What tests of several rooms use."""

import functools
import gc
from collections.abc import Iterator

import pytest
import typer.main
from hypothesis import HealthCheck, settings

# Before `typer.testing` imports it. Made anew for each call, all commands cost more than most of what a test asks.
typer.main.get_command = functools.cache(typer.main.get_command)

# By the wall clock; that others use the machine too is no fault of what is tested.
settings.register_profile("shared machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shared machine")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Have Python look for no garbage among thousands of tests and all that they import, then or later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(10_000)  # a figure is thousands of objects; by default each is looked at several times
        gc.enable()


def pytest_unconfigure() -> None:
    """Leave all that is in memory to the system, which frees it at once; Python would search it for garbage first."""
    gc.freeze()


@pytest.fixture
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a report's figures with all their words, but no pixels of them: for tests of words and tables."""
    for name, start in (("png", b"\x89PNG"), ("pdf", b"%PDF")):
        monkeypatch.setattr(f"relnav_sim.plots.style.{name}", lambda *_, start=start: start)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave a report's figures out: for tests of what it says beside them."""
    monkeypatch.setattr("relnav_sim.report.pictures._drawn", lambda *_: iter(()))

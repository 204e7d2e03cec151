"""What tests of several rooms use."""

import pytest


@pytest.fixture
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a report's figures with all their words, but no pixels of them: for tests of words and tables."""
    for name, start in (("png", b"\x89PNG"), ("pdf", b"%PDF"), ("webp", b"RIFF")):
        monkeypatch.setattr(f"relnav_sim.plots.style.{name}", lambda *_, start=start: start)

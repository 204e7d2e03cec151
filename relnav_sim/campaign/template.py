"""The campaign that `relnav new` writes."""

from __future__ import annotations

from importlib.resources import files


def template_text(name: str) -> str:
    """Return a small commented campaign.

    Args:
        name: Its name.
    """
    text = files("relnav_sim.campaign").joinpath("template.yaml").read_text(encoding="utf-8")
    return text.replace("name: my_campaign", f"name: {name}", 1)

"""The campaigns that `relnav new` writes."""

from __future__ import annotations

from importlib.resources import files

DEFAULT = "demo"


def template_text(name: str, template: str = DEFAULT) -> str:
    """Return a small commented campaign.

    Args:
        name: Its name.
        template: Which one: the name of a file in `templates`.
    """
    text = files("relnav_sim.campaign").joinpath("templates", f"{template}.yaml").read_text(encoding="utf-8")
    return text.replace("name: my_campaign", f"name: {name}", 1)

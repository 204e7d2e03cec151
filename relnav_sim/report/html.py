"""A report as one HTML file that asks for nothing from anywhere: style, script and figures are inside."""

from __future__ import annotations

import functools
from importlib.resources import files
from typing import TYPE_CHECKING

from relnav_sim.report.glossary import TERMS, Definitions
from relnav_sim.report.page import Page, shortened

if TYPE_CHECKING:
    from jinja2 import Template

    from relnav_sim.report.replay.page import ReplayPage


def render(page: Page) -> str:
    """Return the report as HTML; every text in it is escaped."""
    from markupsafe import Markup

    script = _asset("page.js") + (_asset("chart.js") if page.curves else "")
    return _template("page").render(
        page=shortened(page),
        style=Markup(_asset("page.css")),
        script=Markup(script),
        curves=Markup(page.curves),
        defined=Definitions(),
        terms=TERMS,
    )


def render_replay(page: ReplayPage) -> str:
    """Return the page of a replay as HTML; every text in it is escaped."""
    from markupsafe import Markup

    return _template("replay").render(page=page, style=Markup(_asset("page.css")), defined=Definitions())


@functools.cache
def _template(name: str) -> Template:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(_asset("parts.html.j2") + _asset(f"{name}.html.j2"))


def _asset(name: str) -> str:
    return (files("relnav_sim.report") / "assets" / name).read_text(encoding="utf-8")

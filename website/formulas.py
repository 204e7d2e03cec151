"""Formulas of the pages as MathML, which browsers draw by themselves: no script, no font from elsewhere.

A page has a formula in a line as $`x`$ and one by itself in a fence ```math, both in LaTeX.
"""

import re
from typing import Any

from latex2mathml.converter import convert

INLINE = re.compile(r"\$`([^`]+)`\$")


def fence(source: str, *_: Any, **__: Any) -> str:
    """Return a fence of formulas, one a line, as MathML blocks."""
    lines = [line.strip() for line in source.splitlines() if line.strip()]
    return "".join(f'<div class="formula">{convert(line, display="block")}</div>' for line in lines)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put MathML in the place of the formulas within lines (a hook of MkDocs)."""
    return INLINE.sub(lambda found: convert(found[1]), markdown)

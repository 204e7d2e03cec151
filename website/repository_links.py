"""Links from a page to files of the repository that are no pages: the site names the file instead."""

import re
from typing import Any

OUTSIDE = re.compile(r"\[([^\]]+)\]\((?:\.\./)+([^)#]+)(?:#[^)]*)?\)")
SCRIPT = re.compile(r"\[([^\]]+)\]\(([\w-]+\.(?:py|json))\)")


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Replace links that leave docs/ by their words and the file's path (a hook of MkDocs)."""
    if "/" in page.file.src_uri:  # there one `..` stays within docs/
        return markdown
    return SCRIPT.sub(_named, OUTSIDE.sub(_named, markdown))


def _named(found: re.Match[str]) -> str:
    words, path = found[1], found[2]
    return words if path.rstrip("/") in words else f"{words} (`{path}` of the repository)"

"""Check that a built site fetches nothing from elsewhere: python -m website.self_contained build/site."""

import argparse
import re
import sys
from html.parser import HTMLParser
from pathlib import Path

FETCHING = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href", "object": "data"}
ELSEWHERE = re.compile(r"^(?:[a-z]+:)?//", re.IGNORECASE)
STYLE = re.compile(r"""(?:@import\s*|url\()\s*["']?((?:https?:)?//[^"')\s]+)""", re.IGNORECASE)


class _Fetched(HTMLParser):
    """What a browser fetches for a page without being asked; links that a reader may follow do not count."""

    def __init__(self) -> None:
        super().__init__()
        self.outside: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep the addresses of a tag that lead elsewhere."""
        given = dict(attrs)
        if tag == "link" and given.get("rel") in ("canonical", "next", "prev"):
            return
        address = given.get(FETCHING.get(tag, "")) or ""
        self.outside += [address] if ELSEWHERE.match(address) else []
        self.outside += STYLE.findall(given.get("style") or "")


def fetched_from_elsewhere(site: Path) -> list[str]:
    """Return ``page: address`` of everything that the pages and style sheets of a site fetch from elsewhere."""
    found = []
    for path in sorted(site.rglob("*.html")):
        page = _Fetched()
        text = path.read_text(encoding="utf-8")
        page.feed(text)
        styles = "".join(re.findall(r"<style[^>]*>(.*?)</style>", text, re.DOTALL))
        found += [f"{path.relative_to(site)}: {address}" for address in [*page.outside, *STYLE.findall(styles)]]
    for path in sorted(site.rglob("*.css")):
        found += [f"{path.relative_to(site)}: {address}" for address in STYLE.findall(path.read_text(encoding="utf-8"))]
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser("python -m website.self_contained", description=__doc__)
    parser.add_argument("site", type=Path, help="the folder of the built site")
    outside = fetched_from_elsewhere(parser.parse_args().site)
    if outside:
        sys.exit("The site fetches from elsewhere:\n" + "\n".join(outside))

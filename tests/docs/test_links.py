"""Links between pages lead somewhere, and every page is in the navigation of the site."""

import re
from pathlib import Path
from urllib.parse import unquote

import pytest
from site_pages import PAGES, ROOT, anchors

LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")


def links(page):
    text = re.sub(r"^( *)(```+).*?^\1\2\s*$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"\$`[^`]*`\$|(?<!`)`[^`\n]+`(?!`)", "", text)
    return [link for link in LINK.findall(text) if not re.match(r"[a-z]+:", link)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files_and_headings_that_exist(page):
    dead = []
    for link in links(page):
        path, _, anchor = unquote(link).partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            dead.append(link)
    assert not dead


def test_every_page_is_in_the_navigation():
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    listed = re.findall(r"([\w/-]+\.md)\s*$", navigation, re.MULTILINE)
    pages = [str(page.relative_to(ROOT / "docs")) for page in PAGES if page.is_relative_to(ROOT / "docs")]
    assert sorted(listed) == sorted(pages)


def test_a_link_that_leads_nowhere_would_be_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# A b, c\n[x](other.md) [y](#a-b-c) [z](#nothing) `[code](gone.md)`\n", encoding="utf-8")
    assert links(page) == ["other.md", "#a-b-c", "#nothing"]
    assert anchors(page) == {"a-b-c"}
    assert not (Path(tmp_path) / "other.md").exists()

"""The site fetches nothing from elsewhere, and what checks that finds what would be fetched; `make docs` runs it."""

import re

from site_pages import PAGES, ROOT

from website.self_contained import fetched_from_elsewhere


def test_what_a_page_fetches_from_elsewhere_is_found(tmp_path):
    (tmp_path / "page.html").write_text(
        '<a href="https://a.example">a link is no fetching</a><link rel="canonical" href="https://b.example">'
        '<script src="https://c.example/x.js"></script><img src="//d.example/y.png"><img src="here.png">'
        '<p style="background: url(https://e.example/z.png)"></p><style>@import "https://f.example/w.css";</style>'
    )
    (tmp_path / "own.css").write_text("a { background: url('http://g.example/v.png') } b { background: url(own.png) }")
    found = [line.split("//")[1].split(".")[0] for line in fetched_from_elsewhere(tmp_path)]
    assert sorted(found) == ["c", "d", "e", "f", "g"]


def test_no_page_and_no_setting_asks_for_anything_from_elsewhere():
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert re.search(r"^  font: false$", settings, re.MULTILINE)
    assert "extra_javascript" not in settings and "://" not in settings
    for page in PAGES:
        assert not re.search(r"!\[[^\]]*\]\(\w+://|<(?:script|img|iframe)\b", page.read_text(encoding="utf-8")), (
            page.name
        )

"""The pages say what the summary holds, and the committed page is made of the committed data."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from relnav_sim.report.tables import Column, Number, Row, Table, Words
from replication import reproduce as reproduce_module
from replication.pages import claims_of, html_page, markdown_page, verdict_in_words, verdict_lines
from replication.papers import papers
from replication.reproduce import DOCS_FIGURES, write_docs
from replication.summary import (
    Claim,
    Experiment,
    PaperPart,
    Plot,
    Summary,
    as_stored,
    fingerprint,
    read_summary,
    written,
)

DOCS = Path(__file__).parents[2] / "docs"


def small_table(name):
    rows = (
        Row("row, paper", (Number(0.667, decimals=3), Words("no <b>"))),
        Row(
            "ours",
            (Number(1 / 3, 0.3, math.nan, decimals=4, note="of 4"), Words("", mark="best")),
            "m",
            opens_block=True,
        ),
        Row("never", (Number(math.inf, -math.inf, math.nan), Words("x"))),
    )
    return Table(name, f"Title of {name}", "caption", "row", (Column("r"), Column("words", numeric=False)), rows)


def small_summary(verdict="reproduced only if"):
    claim = Claim(
        "A1",
        "claimed | text",
        "the rule",
        verdict,
        ("with dice",),
        "found 3 %",
        7,
        ("because",),
        small_table("e"),
        ("draws",),
    )
    part = PaperPart(
        "alpha_kf", "Shi et al. 2025", "cited", "scene", ("Q",), ("a fact",), small_table("i"), (small_table("t"),),
        (Plot("Fig. 3", "fig", "caption", "alt"),),
        (Experiment("cause", ("A1",), ("first", "last"), small_table("x")),),
        (small_table("b"),),
    )  # fmt: skip
    return Summary("usual", (claim,), (part,), small_table("campaigns"))


def test_a_summary_comes_back_from_its_file(tmp_path):
    path = tmp_path / "summary.json"
    path.write_text(written(small_summary()), encoding="utf-8")
    back = read_summary(path)
    assert written(back) == path.read_text(encoding="utf-8")
    assert back == as_stored(small_summary()) or written(back) == written(as_stored(small_summary()))
    number = back.claims[0].evidence.rows[1].cells[0]
    assert number.value == 0.333333
    assert math.isnan(number.high)
    assert back.claims[0].evidence.rows[2].cells[0].value == math.inf
    json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)  # no NaN: plain JSON


def test_a_file_that_is_no_summary_is_refused(tmp_path):
    path = tmp_path / "summary.json"
    path.write_text('{"size": "usual"}', encoding="utf-8")
    with pytest.raises(ValueError, match="no summary"):
        read_summary(path)


def test_the_markdown_page_holds_verdict_rule_tables_and_figures():
    page = markdown_page(small_summary(), "images")
    for text in (
        "| A1 | claimed \\| text | **reproduced only with dice** | found 3 % | 7 |",
        "Rule: the rule",
        "- because",
        "![alt](images/fig.png)",
        "#### Title of t",
        "0.3333",
        "### Cause: cause (A1)",
        "Not run here, and counted as undecided: draws.",
    ):
        assert text in page
    assert page.index("## Verdicts") < page.index("## Shi et al. 2025")


def test_the_html_page_is_whole_and_escaped(tmp_path):
    (tmp_path / "fig.png").write_bytes(b"\x89PNG")
    page = html_page(small_summary(), tmp_path)
    assert "no &lt;b&gt;" in page
    assert "data:image/png;base64,iVBORw==" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert page.count('id="A1"') == 1


def test_verdicts_in_words():
    assert verdict_in_words(small_summary("reproduced").claims[0]) == "reproduced"
    assert verdict_in_words(small_summary("not reproduced").claims[0]) == "not reproduced"
    assert verdict_lines(small_summary()) == [("A1", "reproduced only with dice", "found 3 %")]


@pytest.mark.parametrize("larger", [{}, {"two_step": Path("full") / "two_step.h5"}])
def test_the_documentation_takes_the_full_size_where_it_is(tmp_path, monkeypatch, larger):
    asked = {}

    def summarised(measured, size, figures, in_full):
        asked.update(paths=measured._paths, size=size, in_full=set(in_full))
        (figures / "fig.png").write_bytes(b"\x89PNG")
        return replace(small_summary(), size=size)

    monkeypatch.setattr(reproduce_module, "summarised", summarised)
    usual = {name: Path("usual") / f"{name}.h5" for name in ("two_step", "limit")}
    write_docs(as_stored(small_summary()), usual, larger, tmp_path)
    assert asked == {"paths": usual | larger, "size": "mixed" if larger else "usual", "in_full": set(larger)}
    page = (tmp_path / "replication.md").read_text(encoding="utf-8")
    stored = read_summary(tmp_path / "replication.json")
    assert markdown_page(stored, DOCS_FIGURES) == page
    assert ("make reproduce-full" in page) == bool(larger)
    assert stored.usual_sha256 == (fingerprint(as_stored(small_summary())) if larger else "")
    assert (tmp_path / DOCS_FIGURES / "fig.png").exists()


def test_the_committed_page_is_made_of_the_committed_data():
    summary = read_summary(DOCS / "replication.json")
    assert markdown_page(summary, DOCS_FIGURES) == (DOCS / "replication.md").read_text(encoding="utf-8")
    for part in summary.papers:
        for plot in part.plots:
            assert (DOCS / DOCS_FIGURES / f"{plot.name}.png").exists()


def test_the_committed_page_judges_every_claim():
    summary = read_summary(DOCS / "replication.json")
    assert [claim.number for claim in summary.claims] == [c for paper in papers().values() for c in paper.claims]
    assert {number for part in summary.papers for number in claims_of(part)} == {c.number for c in summary.claims}
    for claim in summary.claims:
        assert claim.verdict in ("reproduced", "reproduced only if", "not reproduced")
        assert claim.why

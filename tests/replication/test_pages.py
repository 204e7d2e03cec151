"""The pages say what the summary holds, and the committed pages are made of the committed summaries."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from relnav_sim.report.tables import Column, Number, Row, Table, Words
from replication import findings as findings_module
from replication.committed import FOLDER, committed
from replication.compose import summarised
from replication.evidence_page import evidence_page
from replication.findings import possible, read_findings
from replication.html_page import html_page
from replication.listed import deviation_table, literal_text
from replication.measured import Measured
from replication.pages import markdown_page, verdict_in_words, verdict_lines
from replication.papers import papers
from replication.plan import PLAN
from replication.reproduce import DOCS_FIGURES
from replication.summary import Claim, Experiment, PaperPart, Plot, Summary, written

ROOT = Path(__file__).parents[2]
DOCS, CAMPAIGNS = ROOT / "docs", ROOT / "campaigns"
FORMER_WORDS = 23763


def small_table(name):
    rows = (
        Row("row, paper", (Number(0.667, decimals=3), Words("no <b>"))),
        Row(
            "ours",
            (Number(1 / 3, 0.3, math.nan, decimals=4, note="of 4"), Words("", mark="best")),
            "m",
            opens_block=True,
        ),
    )
    return Table(name, f"Title of {name}", "caption", "row", (Column("r"), Column("words", numeric=False)), rows)


def small_summary(verdict="reproduced only if", conditions=("with alpha",), findings=None):
    claim = Claim(
        "A1", "claimed | text.", "the rule", verdict, conditions, "found 3 %", "500 to 6000 s", 7, ("because",),
        small_table("e"), ("draws",),
    )  # fmt: skip
    part = PaperPart(
        "alpha_kf", "Shi et al. 2025", "cited", "scene", ("Q",), small_table("i"), (small_table("t"),),
        (Plot("Fig. 3", "fig", "caption", "alt", lambda: None),),
        (Experiment("cause", ("A1",), ("first", "last"), small_table("x")),),
        (small_table("b"),),
    )  # fmt: skip
    return Summary("full", (claim,), (part,), small_table("campaigns"), ("limit",), 1.25, findings or {})


FINDINGS = {
    "alpha_kf": {
        "bank": {"campaigns": 20000, "cpu_hours": 2.5, "seed": 7},
        "claims": {
            "A1": {
                "probability": 0.02,
                "interval": [0.01, 0.04],
                "sentence": "possible only if e > 0.01; mostly where i is at least 90 deg",
                "settings": [],
                "choices": [{"name": "e", "choices": ["> 0.01"], "excluded": ["0"]}],
                "conflicts": ["z mean of the EKF against r mean of the UKF"],
            }
        },
        "tables": {
            "table_2": {
                "columns": ["ekf"],
                "rows": [{"label": "x mean", "paper": [0.048], "best": [0.05], "residual": [None]}],
            }
        },
        "sentences": [{"text": "the same R and Q", "verdict": "no setting satisfies it", "p_value": 1e-4}],
        "checks": {},
    }
}


def test_the_page_of_verdicts():
    page = markdown_page(small_summary())
    row = "claimed \\| text | **reproduced only with alpha** | found 3 % | 500 to 6000 s | 7 |"
    for text in (
        row,
        "**cause** (A1). last",
        "1.2 CPU hours",
        "Not run yet: limit.",
        "has not been run",
        "#history-of-the-rules",
    ):
        assert text in page
    assert page.index("## Verdicts") < page.index("## Causes") < page.index("## How a claim is judged")


def test_the_page_of_evidence():
    page = evidence_page(small_summary(), "images")
    for text in (
        "### A1",
        "Rule: the rule",
        "![alt](images/fig.png)",
        "#### Title of t",
        "0.3333",
        "### cause (A1)",
        "Not run here, and counted as undecided: draws.",
    ):
        assert text in page


def test_findings_of_the_inference_are_shown():
    summary = small_summary(findings=FINDINGS)
    page = markdown_page(summary)
    assert "possible only if e &gt; 0.01 (2 % \\[1, 4\\])" in page
    assert "“the same R and Q”: no setting satisfies it (p = 0.0001)." in page
    assert "20000 (Shi et al. 2025)" in page and "(replication-settings.md)" in page
    assert "mostly where" not in page
    assert possible(FINDINGS, "B1") == ""
    anywhere = {"claims": {"B1": {"probability": 0.5, "interval": [0.4, 0.6], "sentence": "possible", "choices": []}}}
    assert possible({"mf_upf": anywhere}, "B1") == "50 % of settings [40, 60]"


def test_findings_may_be_missing_or_damaged(tmp_path):
    path = tmp_path / "findings.json"
    assert read_findings(path) == {}
    path.write_text(json.dumps({"papers": {"mf_upf": {}, "other": {}}}), encoding="utf-8")
    assert read_findings(path) == {"mf_upf": {}}
    assert markdown_page(small_summary(findings={"mf_upf": {}}))
    path.write_text('{"papers"', encoding="utf-8")
    with pytest.raises(ValueError, match="holds no findings"):
        read_findings(path)
    assert findings_module.FINDINGS.parent.name == "inverse"


def test_a_switch_is_shown_where_the_literal_campaign_sets_it():
    without = deviation_table("")
    assert "`" not in without.split("\n\n")[0] and "not here yet" in without
    with_one = deviation_table("filters: {alpha_kf: {sampling: random, samples: 10000}}")
    assert with_one.count("`sampling: random`") == 1 and "`covariance_correction: false`" not in with_one


def test_the_html_page_is_whole_and_escaped(tmp_path):
    (tmp_path / "fig.png").write_bytes(b"\x89PNG")
    page = html_page(small_summary(findings=FINDINGS), tmp_path)
    assert "no &lt;b&gt;" in page
    assert "possible only if e &gt; 0.01" in page
    assert "data:image/png;base64,iVBORw==" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert page.count('id="A1"') == 1


def test_verdicts_in_words():
    assert verdict_in_words(small_summary("reproduced", ()).claims[0]) == "reproduced"
    assert verdict_in_words(small_summary("not reproduced", ()).claims[0]) == "not reproduced"
    assert verdict_lines(small_summary()) == [("A1", "reproduced only with alpha", "found 3 %")]
    other = replace(small_summary().claims[0], conditions=("if a",), stated=False)
    assert verdict_in_words(other) == "not reproduced as stated, only if a"
    many = replace(small_summary().claims[0], conditions=("if a", "if b", "if c", "if d"))
    assert verdict_in_words(many) == "reproduced only if a; or if b; or if c; or in 1 more"


def test_the_summary_is_plain_json():
    content = json.loads(written(small_summary(findings=FINDINGS)), parse_constant=pytest.fail)
    assert content["claims"][0]["window"] == "500 to 6000 s"
    assert "draw" not in content["papers"][0]["plots"][0]


@pytest.fixture(scope="module")
def of_committed():
    return summarised(Measured(committed(CAMPAIGNS)), "full", read_findings())


def test_the_committed_pages_are_made_of_the_committed_summaries(of_committed):
    page = (DOCS / "replication.md").read_text(encoding="utf-8")
    assert page == markdown_page(of_committed)
    evidence = (DOCS / "replication-evidence.md").read_text(encoding="utf-8")
    assert evidence == evidence_page(of_committed, DOCS_FIGURES, literal_text(CAMPAIGNS))
    for part in of_committed.papers:
        for plot in part.plots:
            assert (DOCS / DOCS_FIGURES / f"{plot.name}.png").exists()
    assert len(page.split()) <= FORMER_WORDS / 10


def test_every_committed_summary_is_of_its_campaign_as_it_is_now():
    told = []
    held = committed(CAMPAIGNS, say=told.append)
    assert not told
    assert set(held) == {path.stem for path in FOLDER.glob("*.json")}
    assert sum(path.stat().st_size for path in FOLDER.glob("*.json")) < 3e6
    runs = {planned.name: planned.full_runs for planned in PLAN}
    for name, extract in held.items():
        assert extract.runs == tuple(range(runs[name]))


def test_every_claim_is_judged(of_committed):
    claims = [claim for paper in papers().values() for claim in paper.claims]
    assert [claim.number for claim in of_committed.claims] == claims
    for claim in of_committed.claims:
        assert claim.verdict in ("reproduced", "reproduced only if", "not reproduced")
        if claim.evidence.rows:
            assert claim.window


def test_the_pages_speak_plainly():
    """Words that the pages must not use, since a reader who knows the field would stop at them."""
    for name in ("replication.md", "replication-evidence.md"):
        text = (DOCS / name).read_text(encoding="utf-8").lower()
        for word in (" dice", " dies", "believes", "settled", "alternative reading", "leaves over"):
            assert word not in text, (name, word)


def test_no_figure_is_left_that_no_page_shows(of_committed):
    shown = {f"{plot.name}.png" for part in of_committed.papers for plot in part.plots}
    if not of_committed.missing:
        assert {path.name for path in (DOCS / DOCS_FIGURES).glob("*.png")} == shown

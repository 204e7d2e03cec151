"""The pages say what the summary holds, and the committed pages are made of the committed summaries."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relnav_sim.report.tables import Column, Number, Row, Table, Words
from relnav_sim.statistics.intervals import Interval
from relnav_sim.statistics.verdicts import judged
from replication import findings as findings_module
from replication.committed import FOLDER, committed
from replication.compose import RULES, summarised
from replication.effects import Effect, Evidence, Judgement, _margin
from replication.evidence import as_told, found_in_words
from replication.evidence_page import evidence_page
from replication.findings import only_if, possible, read_findings, share_of_settings
from replication.html_page import html_page
from replication.listed import deviation_table, literal_text
from replication.measured import Measured
from replication.pages import either, markdown_page, verdict_in_words, verdict_lines
from replication.papers import papers
from replication.plan import PLAN
from replication.reproduce import DOCS_FIGURES
from replication.rules import Interpretation, Part, Rule
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
                "settings": [{"name": "i", "interval": [90.2, 179.0], "side": "at least", "prior": 0.5, "unit": "deg"}],
                "choices": [{"name": "e", "choices": ["> 0.01", "1"], "excluded": ["0"]}],
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
    assert "2.0 % \\[1.0, 4.0\\] of settings, nearly all where e is &gt; 0.01 or 1 |" in page
    assert "the same R and Q: no setting satisfies it (p = 0.0001)." in page
    assert "20000 (Shi et al. 2025)" in page and "(replication-settings.md)" in page
    assert "mostly where" not in page
    assert possible(FINDINGS, "B1") == ""
    anywhere = {"claims": {"B1": {"probability": 0.5, "interval": [0.4, 0.6], "choices": []}}}
    assert possible({"mf_upf": anywhere}, "B1") == "50 % [40, 60] of settings"
    nowhere = {"B1": {"probability": 0.0, "interval": [0.0, 0.0012], "choices": []}}
    bank = {"bank": {"campaigns": 3000}, "claims": nowhere}
    assert possible({"mf_upf": bank}, "B1") == "impossible: none of 3000 settings (at most 0.1 %)"
    nowhere["B1"]["sentence"] = "impossible: of its own numbers"
    assert possible({"mf_upf": bank}, "B1") == "impossible: of its own numbers"


def test_a_condition_has_plain_words():
    choices = [{"name": "the process noise", "choices": ["one for each filter"], "excluded": ["one for all"]}]
    assert only_if({"choices": choices}) == "process noises differ between filters"


def test_digits_of_a_share_follow_its_interval():
    assert share_of_settings({"probability": 0.083727, "interval": [0.08014, 0.08746]}) == "8.4 % [8.0, 8.7]"
    assert share_of_settings({"probability": 0.9955, "interval": [0.99452, 0.9963]}) == "99.55 % [99.45, 99.63]"


def test_what_is_many_times_larger_is_told_as_a_ratio():
    """Thirty times as many outliers are no -2900 %; up to fourfold the percentage stays."""
    part = Part("outliers, below that of b", "margin", ("a",), "r", "%", ("b",), published=50.0, at_least=25.0)
    told, ratio = as_told(Effect(part, Interval(-2900.0, -5900.0, 120.0, 0.95, 100), "open"))
    assert (told.what, told.unit) == ("outliers, over that of b", "\N{MULTIPLICATION SIGN}")
    assert (told.published, told.at_most) == (0.5, 0.75)
    assert told.at_least == -math.inf
    assert (ratio.estimate, ratio.low, ratio.high, ratio.runs) == (30.0, 0.0, 60.0, 100)
    near = Effect(part, Interval(-100.0, -300.0, 10.0, 0.95, 100), "fails")
    assert as_told(near) == (part, near.interval)


def test_no_percentage_of_the_pages_is_beyond_300():
    for name in ("replication.md", "replication-evidence.md"):
        for number in re.findall(r"(\d+(?:\.\d+)?) ?%", (DOCS / name).read_text(encoding="utf-8")):
            assert float(number) <= 300, (name, number)


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
    assert "nearly all where e is &gt; 0.01" in page
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
    only = replace(small_summary().claims[0], conditions=("with a start error of 1 m", "with a start error of 2 m"))
    assert verdict_in_words(only) == "reproduced only with a start error of 1 m or 2 m"
    assert verdict_in_words(replace(only, fails=False)) == "reproduced with a start error of 1 m or 2 m; else undecided"
    formula = ("against a start of covariance P + R", "against a start of covariance P + 2 R")
    assert either(formula) == "against a start of covariance P + R or P + 2 R"


def test_only_names_what_others_fail_without():
    """Three interpretations of known figures: both that hold name one condition; the third fails or is undecided."""
    rule = next(rule for rule in RULES if rule.claim == "B5")
    holds, wider, third = rule.main[0], rule.others[1], rule.main[1]
    assert wider.words.endswith(f", {holds.words}")
    evidence = [Evidence(each, True, (), "holds", "") for each in (holds, wider)]
    for outcome in ("fails", "open"):
        found = (*evidence, Evidence(third, True, (), outcome, ""))
        assert Judgement(rule, found, "reproduced only if", ()).conditions == (holds.words,)


def test_a_ratio_to_what_may_be_nought_has_no_upper_end():
    part = Part("outliers, below that of b", "margin", ("a",), "r", "%", ("b",), at_least=0.0)
    rule = Rule("A10", "", (part,), (Interpretation("one", "as one"),))
    for high, told in (
        (-1340.0, "29.8 \N{MULTIPLICATION SIGN} [14.4 or more]"),
        (math.inf, "29.8 \N{MULTIPLICATION SIGN} [no bound]"),
    ):
        effect = Effect(part, Interval(-2880.0, -math.inf, high, 0.95, 100), "open")
        item = Evidence(rule.main[0], True, (effect,), "open", "")
        words = found_in_words(Judgement(rule, (item,), "not reproduced", ()))
        assert words == f"Outliers, over that of b {told}"


def test_a_margin_is_that_to_the_hardest_to_beat_in_whatever_order():
    """30 runs: `rare` has outliers in few runs and far fewer than `best`, `many` has more, `none` has none at all."""
    rng = np.random.default_rng(5)
    best, many = rng.uniform(4, 6, 30), rng.uniform(7, 9, 30)
    rare, none = np.where(np.arange(30) < 2, 0.3, 0.0), np.zeros(30)
    part = Part("outliers, below that of the best other", "margin", ("a",), "r", "%", ("b", "c"), at_least=0.0)
    for outer, outcome in (((many, rare), "fails"), ((none, rare), "fails"), ((many, none), "open")):
        for others in (outer, outer[::-1]):
            found = _margin([best, *others], part, 0.95)
            assert judged(found, at_least=part.at_least) == outcome


def test_what_a_paper_gives_word_for_word_stands_with_the_verdict(of_committed):
    (row,) = [line for line in markdown_page(of_committed).splitlines() if line.startswith("| [B1]")]
    assert "[word for word](filters.md#as-published) the listed steps diverge" in row


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
    for name in ("replication.md", "replication-evidence.md", "replication-settings.md"):
        text = (DOCS / name).read_text(encoding="utf-8").lower()
        for word in (" dice", " dies", "believes", "settled", "alternative reading", "leaves over", "honest", "forge"):
            assert word not in text, (name, word)


def test_no_figure_is_left_that_no_page_shows(of_committed):
    shown = {f"{plot.name}.png" for part in of_committed.papers for plot in part.plots}
    if not of_committed.missing:
        assert {path.name for path in (DOCS / DOCS_FIGURES).glob("*.png")} == shown


def test_a_space_stands_before_every_per_cent_sign():
    pages = sorted(DOCS.glob("replication*"))
    assert len(pages) == 5
    for page in pages:
        assert not re.search(r"\d%", page.read_text(encoding="utf-8")), page.name

"""A replication of one short campaign: full size, committed summary, subset that is compared with it, pages."""

from pathlib import Path

import pytest

from replication import committed as committed_module
from replication import compose, plan
from replication.plan import Planned
from replication.reproduce import reproduce, write_docs

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
SHORT = ("clock.duration_s=30", "statistics.settle_s=10", "bound=false")


@pytest.mark.slow
def test_a_subset_agrees_with_the_summary_of_the_full_size(tmp_path, monkeypatch):
    planned = (Planned("two_step", 2, 4, always=SHORT),)
    for module in (plan, compose, committed_module):
        monkeypatch.setattr(module, "PLAN", planned)
    summaries = tmp_path / "full"
    whole = reproduce("full", CAMPAIGNS, tmp_path / "large", 1, backend="sequential", summaries=summaries)
    assert [path.name for path in summaries.iterdir()] == ["two_step.json"]
    assert whole.missing == ()
    told = []
    again = reproduce(
        "subset", CAMPAIGNS, tmp_path / "small", 1, say=told.append, backend="sequential", summaries=summaries
    )
    (comparison,) = [sentence for sentence in told if "two_step: agrees" in sentence]
    # 11 filters in 5 cases, 3 columns, 2 runs.
    assert comparison == "two_step: agrees with the committed summary, 330 numbers of 2 runs"
    assert [claim.verdict for claim in again.claims] == [claim.verdict for claim in whole.claims]
    assert (tmp_path / "small" / "index.html").exists() and (tmp_path / "small" / "summary.json").exists()

    docs = tmp_path / "docs"
    docs.mkdir()
    before = (summaries / "two_step.json").read_bytes()
    write_docs(CAMPAIGNS, docs, tmp_path / "large", summaries=summaries)
    assert (summaries / "two_step.json").read_bytes() == before
    assert "C1" in (docs / "replication.md").read_text(encoding="utf-8")
    assert (docs / "images" / "replication" / "two_step_start.png").exists()

"""`requirements:` in a campaign file: strict, and outside the hash."""

import pytest

from relnav_sim.campaign import CampaignError
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.results.changes import changed_keys

RULES = """
requirements:
  docking: {kind: errors, below_m: 1, share: 0.997, inside_m: 500}
  honest: {kind: nees, filters: [ukf]}
  quick: {kind: converged, within_s: 60, share: 0.95, below_m: 5}
"""


def test_they_are_read_and_change_no_hash(demo: str) -> None:
    plain, judged = parse_campaign(demo), parse_campaign(demo + RULES)
    assert list(judged.requirements) == ["docking", "honest", "quick"]
    assert judged.hash == plain.hash
    assert [case.id for case in judged.cases] == [case.id for case in plain.cases]
    assert changed_keys(plain.content, judged.content) == []
    assert judged.content["requirements"]["docking"]["share"] == 0.997


@pytest.mark.parametrize(
    ("rule", "words"),
    [
        ("{kind: errors, below: 1, share: 0.9}", "unknown key; did you mean 'below_m'?"),
        ("{kind: errors, below_m: 1}", "requirements.wanted.share: this key is missing"),
        ("{kind: errors, quantity: v, below_m: 1, share: 0.9}", "the limit of v is below_m_s, and only that"),
        ("{kind: rms, below_m: 1, below_m_s: 1}", "the limit of r is below_m, and only that"),
        ("{kind: errors, below_m: 1, share: 99.7}", "must be less than 1, not 99.7"),
        ("{kind: converged, within_s: 60, share: 0.9, below_m: 7}", "must be 1, 2, 5, 10, 20, 50 or 100, not 7"),
        ("{kind: nees, filters: [pf]}", "no filter is named 'pf'"),
        ("{kind: nis, sensor: rader}", "no sensor is named 'rader'"),
        ("{kind: nis, sigma_margin: 1}", "must be less than 1, not 1"),
        ("{kind: nes}", "there is no kind 'nes'; did you mean 'nees'?"),
        (
            "{kind: errors, below_m: 1, share: 0.9, from_s: 600}",
            "requirements.wanted.from_s: 600 s leaves nothing of a run",
        ),
        (
            "{kind: errors, interpretation: ensemble, below_m: 1, share: 0.9, of_runs: 0.9}",
            "of_runs belongs to the temporal interpretation, not to ensemble",
        ),
        ("{kind: errors, interpretation: ensembel, below_m: 1, share: 0.9}", "did you mean 'ensemble'?"),
        ("{below_m: 1}", "requirements.wanted.kind: this key is missing"),
    ],
)
def test_mistakes_are_sentences(demo: str, rule: str, words: str) -> None:
    with pytest.raises(CampaignError) as refusal:
        parse_campaign(f"{demo}\nrequirements:\n  wanted: {rule}\n")
    assert any(words in problem for problem in refusal.value.problems), refusal.value.problems

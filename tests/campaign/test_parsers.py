"""libyaml's parser, which reads most files, and Python's, which reads the others: the same documents by either."""

import random
from pathlib import Path

import pytest
import yaml

from relnav_sim.campaign import loader
from relnav_sim.campaign.loader import MOST_BYTES, load_document

ROOT = Path(__file__).parents[2]
CAMPAIGNS = sorted(path for folder in ("campaigns", "docs", "examples") for path in (ROOT / folder).rglob("*.yaml"))

pytestmark = pytest.mark.skipif(not yaml.__with_libyaml__, reason="PyYAML was built without libyaml")


@pytest.fixture
def by_python(monkeypatch):
    """Return how Python's parser alone reads a text."""

    def read(text):
        with monkeypatch.context() as without:
            without.setattr(loader, "_FAST", None)
            return load_document(text)

    return read


def test_every_campaign_is_read_by_libyaml_to_the_same_values_on_the_same_lines(by_python, monkeypatch):
    expected = [by_python(path.read_text(encoding="utf-8")) for path in CAMPAIGNS]
    monkeypatch.setattr(yaml, "SafeLoader", None)
    assert [load_document(path.read_text(encoding="utf-8")) for path in CAMPAIGNS] == expected
    assert len(expected) > 30


PIECES = [
    *" \n\r\x85\u2028\xa0é\U0001d4b3:,[]{}#\"'|>\\-?%@`&*!~\t\ufeff\x00\x0b\x7f\ud800\ufffe",
    *("\r\n", "  ", ": ", "- ", "? ", " #", "|-\n", ">+2\n", ">#", "---", "---\n", "...\n", "%YAML 1.2\n---\n"),
    *("&a ", "*a", "!x ", "<<", "0x1", "a: 1\n", '"a": ', "[a?]", "{? a}", "a?", "::", "\\x41", "\\U00110000"),
]
TEXTS = [
    *("a: 1\nb:\n  c: [1, 2]\n  d: {e: f}\n", "- a\n- b: c\n  d: e\n", "a: |\n  text\n  more\nb: 'x y'\n", "x", ""),
    *('k: "a b"\nl: >\n  f\n\n  g\n', "[a, {b: c}, d: e]\n", "a:\n- 1\n- 2\n", "? a\n: b\n"),
    "é: \U0001d4b3 # ü\nb: [ß,\n ö]\n",
]


def test_any_text_is_read_or_refused_in_the_same_words(by_python):
    rng = random.Random(7)
    accepted = 0
    for _ in range(1500):
        text = rng.choice(TEXTS)
        for _ in range(rng.randrange(1, 4)):
            place, end = (rng.randrange(len(text) + 1) for _ in range(2))
            piece = rng.choice(PIECES) if rng.random() < 0.8 else text[place:end]
            text = text[:place] + piece + text[place + rng.choice((0, 0, 1)) :]
        found, expected = load_document(text), by_python(text)
        # As text, where True and 1.0 are not 1.
        assert repr(found) == repr(expected), text
        accepted += not found.problems
    assert 300 < accepted < 1200


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? ", "a:\n ", '"', "&a ", "!", "#", "[a, "])
def test_a_long_text_of_one_kind_ends_in_the_same_sentence(by_python, opening):
    text = opening * (MOST_BYTES // len(opening) // 40)
    assert load_document(text) == by_python(text)

import json
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relnav_sim.campaign import CampaignError, parse_campaign
from relnav_sim.campaign.loader import DEEPEST, MOST_BYTES, load_document, read_text


def sentences(text):
    return [problem.sentence for problem in load_document(text).problems]


def test_mappings_lists_and_lines():
    text = "a:\n  b:\n  - 1\n  - {c: 1,\n d: 2}\ne: x\n"
    document = load_document(text)
    assert document.data == {"a": {"b": [1, {"c": 1, "d": 2}]}, "e": "x"}
    assert not document.problems
    lines = {("a",): 1, ("a", "b"): 2, ("a", "b", 0): 3, ("a", "b", 1): 4, ("a", "b", 1, "c"): 4, ("a", "b", 1, "d"): 5}
    assert document.lines.items() >= lines.items()
    assert document.line(("a", "b", 1, "missing", "deeper")) == 4


def test_block_text_and_empty_values():
    text = "note: |\n  two\n  lines\nfolded: >-\n  one\n  line\nnothing:\n"
    assert load_document(text).data == {"note": "two\nlines\n", "folded": "one line", "nothing": None}


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_any_line_ends(ends):
    document = load_document(ends.join(["a: 1", "b: 010", "c: [1,", "  2]"]))
    assert document.data == {"a": 1, "b": None, "c": [1, 2]}
    assert [problem.line for problem in document.problems] == [2]


@pytest.mark.parametrize("content", [b"\xef\xbb\xbfa: 1\n", b"a: 1\n", b"a: 1"])
def test_utf8_with_and_without_mark(content):
    assert load_document(read_text(content)).data == {"a": 1}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("a: 1".encode("utf-16"), "UTF-16"),
        ("a: 1".encode("utf-16-le"), "UTF-16"),
        ("a: 1".encode("utf-32"), "UTF-16 or UTF-32"),
        ("a: 1\nb: é".encode("latin-1"), "byte 0xe9 in line 2 is not UTF-8"),
        (b"\x89HDF\r\n\x1a\n\0\0\0", "results file"),
        (b"a" * (MOST_BYTES + 1), "larger than the 250 kB"),
        (b"\x89HDF\r\n\x1a\n" + b"\0" * MOST_BYTES, "this is a results file"),
    ],
)
def test_other_files_are_named(content, words):
    with pytest.raises(ValueError, match=words):
        read_text(content)


@pytest.mark.parametrize(
    ("text", "words", "line"),
    [
        ("a: 1\nb: 2\na: 3", "given twice, first in line 1", 3),
        ("a: {b: 1, b: 2}", "given twice", 1),
        ("a: &x 1", "anchors (&x)", 1),
        ("a: *x", "aliases (*x)", 1),
        ("a: !!str 1", "tags", 1),
        ("a: !mine {b: 1}", "tags (!mine)", 1),
        ("a: 1\n---\nb: 1", "second document", 2),
        ("%YAML 1.1\n---\na: 1", "YAML 1.2", 1),
        ("%TAG ! tag:x\n---\na: 1", "%TAG", 1),
        ("a: 1\n1: 2", "key 1 is not text", 2),
        ("true: 2", "key true is not text", 1),
        ("? [a, b]\n: 1", "key must be plain text", 1),
        ("? {a: b}\n: 1", "key must be plain text", 1),
        (": 1", "", 1),
        ("a:\n\tb: 1", "a tab", 2),
        ("a: b: c", "indentation", 1),
        ("a: 1\n b: 2", "indentation", 2),
        ("a: 1\nb\nc: 2", "':' is missing", 2),
        ("a: 'x", "never closed", 1),
        ("a: [1,\n  2\nb: 3", "bracket opened in line 1", 3),
        ("a: {b: 1", "bracket opened in line 1", 1),
        ("a: - 1", "list position", 1),
        ("a: @x", "needs quotes", 1),
        ("a: `x`", "needs quotes", 1),
        ("a: x\x07", "U+0007", 1),
        ("a: \ud800", "U+D800", 1),
        ('a: "\\UFFFFFFFF"', "not valid YAML", 1),
        ('a: "\\ud800"', "surrogate", 1),
        ('a: "\\0"', "control characters", 1),
        ("[" * 3000, f"more than {DEEPEST} levels", 1),
        ("- " * 3000, f"more than {DEEPEST} levels", 1),
        ("{a: " * 3000, f"more than {DEEPEST} levels", 1),
        ("- 1\n" * 60000, "more than 10000 values", 19999),
    ],
)
def test_strict_rules(text, words, line):
    problem = load_document(text).problems[0]
    assert words in problem.sentence
    assert abs(problem.line - line) <= (2 if line > 1000 else 0)


def test_the_deepest_level_is_read():
    assert load_document("[" * DEEPEST + "]" * DEEPEST).problems == ()


def test_every_problem_is_found_not_only_the_first():
    assert len(sentences("a: 010\nb: 1_000\na: 2\nc: &x 3\nd: !!int 4\ne: *x\n")) == 6


def test_an_alias_bomb_stays_small():
    bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{after}: &{after} [*{before}, *{before}, *{before}, *{before}]\n"
        for before, after in zip("abcdefgh", "bcdefghi", strict=True)
    )
    document = load_document(bomb)
    assert any("aliases" in problem.sentence for problem in document.problems)
    assert len(json.dumps(document.data)) < 1000


SLOW = {
    "comments": "# a b\n" * (MOST_BYTES // 6),
    "blank lines": "\n" * MOST_BYTES,
    "a long text": "a: " + "b " * (MOST_BYTES // 2 - 2),
    "text over many lines": "a: b\n" + "  c\n" * (MOST_BYTES // 4 - 2),
    "quoted lines": 'a: "' + "b\n  " * (MOST_BYTES // 4 - 2) + '"',
    "numbers": "[" + "1," * (MOST_BYTES // 2 - 2) + "]",
    "digits": "a: " + "1" * (MOST_BYTES - 3),
    "underscores": "a: 1" + "_" * (MOST_BYTES - 5),
    "brackets": "[" * MOST_BYTES,
    "question marks": "? " * (MOST_BYTES // 2),
    "keys": "".join(f"k{number}: 1\n" for number in range(MOST_BYTES // 12)),
    "one section of many keys": "clock:\n" + "".join(f"  k{number}: 1\n" for number in range(9000)),
    "many filters": "filters:\n" + "".join(f"  k{number}: {{}}\n" for number in range(4000)),
    "a long list": "name: [" + "1," * 9500 + "]",
    "a product": "grid:\n" + "".join(f"  clock.k{number}: [{'1,' * 20}]\n" for number in range(400)),
    "a wide grid": "clock: {" + "".join(f"k{n}: {n}, " for n in range(4000)) + "}\ngrid:\n  clock.a: "
    + str(list(range(1000))),
}  # fmt: skip


# One of each kind: a scalar, a collection, nesting, mistakes by the thousand, a large product.
QUICK = (
    "comments",
    "a long text",
    "numbers",
    "digits",
    "underscores",
    "brackets",
    "question marks",
    "keys",
    "a wide grid",
)


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in SLOW])
def test_any_text_is_answered_within_two_seconds(name):
    began = time.process_time()
    with pytest.raises(CampaignError) as refusal:
        parse_campaign(SLOW[name])
    assert time.process_time() - began < 2
    assert 0 < len(refusal.value.problems) <= 101


FRAGMENTS = [
    *["name", "seed", "runs", "clock", "truth", "sensors", "filters", "grid", "zip", "kind", "ekf", "radar", "step_s"],
    *["clock.step_s", "duration_s", "noise", "1", "0.5", "010", "1e-3", "true", "~", "a b", "é", "x" * 70],
    *[
        ":",
        ": ",
        "\n",
        "\n  ",
        "\n    ",
        "- ",
        "[",
        "]",
        "{",
        "}",
        ", ",
        "'",
        '"',
        "&a",
        "*a",
        "!t",
        "#",
        "|",
        ">",
        "?",
    ],
    *["---", "...", "%", "@", "\t", "\r\n", "\x00", "\u2028", "\ufeff"],
]


# All that UTF-8 can hold. By the codec's name, which is also the default, each of a million signs is tried.
ENCODABLE = st.characters(exclude_categories=["Cs"])


@settings(max_examples=100, deadline=None)
@given(st.one_of(st.text(ENCODABLE, max_size=200), st.lists(st.sampled_from(FRAGMENTS), max_size=60).map("".join)))
def test_a_text_is_a_campaign_or_refused_in_sentences(text):
    try:
        parse_campaign(text)
    except CampaignError as error:
        assert error.problems
        assert all(problem.startswith("campaign:") and "\n" not in problem for problem in error.problems)


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_are_text_or_refused_in_a_sentence(content):
    try:
        assert isinstance(read_text(content), str)
    except UnicodeDecodeError:
        raise
    except ValueError as error:
        assert str(error)


plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cc", "Cf", "Cs", "Zl", "Zp"]), max_size=20),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text("abcdefgh_", min_size=1, max_size=8), inner, max_size=4)
    ),
    max_leaves=20,
)


@settings(max_examples=100, deadline=None)
@given(plain)
def test_json_is_read_as_json(data):
    document = load_document(json.dumps(data, ensure_ascii=False))
    assert document.problems == ()
    assert document.data == data


@settings(max_examples=50, deadline=None)
@given(st.dictionaries(st.sampled_from(["name", "seed", "runs", "clock", "truth", "start", "filters", "grid"]), plain))
def test_any_data_is_a_campaign_or_refused_in_sentences(data):
    try:
        parse_campaign(json.dumps(data))
    except CampaignError as error:
        assert all(problem.startswith("campaign:") for problem in error.problems)


@pytest.mark.parametrize("kind", ["[]", "{}", "1", "null"])
def test_a_kind_that_is_no_text_is_refused_in_a_sentence(kind):
    text = (Path(__file__).parents[2] / "campaigns" / "demo.yaml").read_text(encoding="utf-8")
    with pytest.raises(CampaignError, match=r"sensors\.odd\.kind: there is no kind"):
        parse_campaign(text, [f"sensors.odd={{kind: {kind}}}"])

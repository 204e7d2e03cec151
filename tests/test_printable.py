"""Text of strangers made fit to be shown."""

import pytest

from relnav_sim.printable import message_of, printable


@pytest.mark.parametrize(
    "text, expected",
    [
        ("plain words, Cramér-Rao, 中文, µ", "plain words, Cramér-Rao, 中文, µ"),
        ("a\x00b\x1b[2J\x7f\x9b", r"a\x00b\x1b[2J\x7f\x9b"),
        ("caf\udce9", r"caf\udce9"),
        ("\u202egnp\u2066\u200f\u200b\ufeff", r"\u202egnp\u2066\u200f\u200b\ufeff"),
        ("\U000e0041\U0010ffff", r"\U000e0041\U0010ffff"),
        (" two\r\n\tlines\xa0\u2028here ", "two lines here"),
        ("", ""),
    ],
)
def test_what_does_something_is_spelled_out(text, expected):
    assert printable(text) == expected
    assert printable(expected) == expected


@pytest.mark.parametrize("letter", ["x", "\x1b", "\udcff"])
def test_long_text_keeps_its_ends(letter):
    text = printable("begin" + letter * 5_000_000 + "end")
    assert len(text) <= 500
    assert text.startswith("begin") and text.endswith("end") and " [...] " in text


def test_an_exception_that_can_not_be_put_in_words():
    class RudeError(Exception):
        def __str__(self):
            raise RuntimeError

    assert message_of(RudeError()) == "RudeError: (its message can't be shown)"
    assert message_of(ValueError()) == "ValueError"
    assert message_of(ValueError("a\nb")) == "ValueError: a b"

"""Flags decide how a figure reads; its note does not."""

import pytest

from vgyro.report.figure_cells import figure_cell, says_limited
from vgyro.report.model import Value
from vgyro.report.tables import Notes

WORDS = "not significant; band-limited: 0.88; not shown to exist: < 2; the low-pass takes part in it"


def cell(note="", *flags):
    return figure_cell(Value(1.5, 1.0, 2.0, "1", note, frozenset(flags)), "if_sigma", Notes())


def test_words_alone_decide_nothing():
    plain = cell(WORDS)
    assert (plain.tone, plain.mark) == ("", "")
    assert "<" not in plain.text
    assert not says_limited(Value(1.5, 1.0, 2.0, "1", WORDS))


@pytest.mark.parametrize("flag", ["band_limited", "takes_part"])
def test_what_a_low_pass_lowers_is_marked(flag):
    assert cell("", flag).mark == "band-limited"
    assert says_limited(Value(1.5, 1.0, 2.0, "1", "", frozenset({flag})))


def test_what_is_not_significant_is_grey_and_what_is_not_shown_is_a_limit():
    assert cell("", "not_significant").tone == "muted"
    assert cell("", "not_shown").text == "< 2.0"
    assert cell("", "upper_limit").tone == ""

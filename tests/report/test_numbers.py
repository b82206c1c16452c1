"""Numbers for people. Expected texts follow from the rule that each docstring states."""

import math

import pytest

from vgyro.report.figure_cells import remarks
from vgyro.report.numbers import duration, percent, plain, probability, significant, with_interval

NAN = math.nan


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (1234.5, "1234"), (12345.6, "12\u2009346"), (0.001234, "0.00123"), (-2.0, "−2.00"), (9.999, "10.0"),
     (1.2e-7, "1.20·10⁻⁷"), (3e9, "3.00·10⁹"), (NAN, "—"), (math.inf, "∞")],
)  # fmt: skip
def test_three_significant_digits(value: float, text: str) -> None:
    assert significant(value) == text


def test_the_uncertainty_decides_how_many_digits_a_figure_has() -> None:
    # Half the interval is 0.13: two digits of it are hundredths.
    assert with_interval(6.1734, 6.05, 6.31) == ("6.17", "6.05 … 6.31")
    assert with_interval(54.11, 40.0, 68.0) == ("54", "40 … 68")
    assert with_interval(0.01001234, 0.01001194, 0.01001274) == ("0.01001234", "0.01001194 … 0.01001274")


def test_a_figure_without_an_interval_has_three_digits_and_a_missing_one_a_dash() -> None:
    assert with_interval(6.1734, NAN, NAN) == ("6.17", "")
    assert with_interval(NAN, 1.0, 2.0) == ("—", "")


def test_almost_all_never_reads_as_all() -> None:
    assert percent(1.0) == "100\u2009%"
    assert percent(0.99999) == ">\u200999.9\u2009%"


def test_probabilities_and_lengths_of_time() -> None:
    assert probability(1e-20) == "< 0.001"
    assert probability(0.0523) == "0.052"
    assert [duration(value) for value in (20, 1200, 10_000)] == ["20.0 s", "20.0 min", "2.78 h"]
    assert plain(62.5) == "62.5"


def test_a_footnote_leaves_out_how_such_a_figure_is_always_found():
    assert remarks("gain 1.0003; the reference is no sinusoid") == "the reference is no sinusoid"
    assert remarks("bootstrap of blocks of 5 s") == ""
    assert remarks("") == ""

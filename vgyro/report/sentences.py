"""Pieces of the sentences that a page concludes with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.report.model import Record, Value
from vgyro.report.numbers import percent, plain, significant
from vgyro.report.tables import Tone

MOST_NAMED = 6
MOST_STRETCHES = 3


@dataclass(frozen=True)
class Conclusion:
    """One sentence. anchor : part of the page that it rests on"""

    text: str
    tone: Tone = ""
    anchor: str = ""


def moved_words(kind: str, moved: Record) -> str:
    """Where a board moved that was to stand still, what its figures are then from, and what to do.

    kind : as declared;  moved : share of the recording, stretches [[start s, stop s], …]
    """
    spans = [f"from {plain(start)} s to {plain(stop)} s" for start, stop in moved["stretches"]]
    more = f" and {len(spans) - MOST_STRETCHES} times more" if len(spans) > MOST_STRETCHES else ""
    times = ", ".join(spans[:MOST_STRETCHES])
    from_what = "come from its rests alone" if moved["share"] < 1 else "are not known"
    return (
        f"is declared {kind}, but the board moved {times}{more} ({percent(moved['share'], 2)} of it): its figures at "
        f"rest {from_what}; set kind: free"
    )


def named(gyros: Sequence[str]) -> str:
    """Names, or how many where they are too many to read."""
    return ", ".join(gyros) if len(gyros) <= MOST_NAMED else f"{len(gyros)} gyros"


def interval(value: Value) -> str:
    """A figure and its interval in one line."""
    text = significant(value.value)
    if np.isfinite(value.low) and np.isfinite(value.high):
        text += f" ({significant(value.low)} … {significant(value.high)})"
    return text


def factor(value: Value) -> str:
    """An improvement factor, and whether it is significant."""
    holds_one = value.low <= 1 <= value.high
    return interval(value) + (", not significant: the interval holds 1" if holds_one else "")

"""Pieces of the sentences that a page concludes with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.report.model import Value
from vgyro.report.numbers import significant
from vgyro.report.tables import Tone

MOST_NAMED = 6


@dataclass(frozen=True)
class Conclusion:
    """One sentence. anchor : part of the page that it rests on"""

    text: str
    tone: Tone = ""
    anchor: str = ""


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

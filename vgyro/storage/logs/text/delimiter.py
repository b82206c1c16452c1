"""Which sign stands between the columns of a text, and which before the decimals."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import NamedTuple

from vgyro.storage.logs.text.cells import LABEL, is_value, is_word, missing, split

DELIMITERS = ("\t", ";", ",", "|", " ")
"""In the order in which they are preferred among equals."""
NEAR = 0.02


class Signs(NamedTuple):
    """delimiter : one sign, " ": any blanks;  decimal : "." or ",";  score : 1: every line and cell fits"""

    delimiter: str
    decimal: str
    score: float


def find_signs(lines: Sequence[str], delimiter: str | None, decimal: str | None) -> Signs:
    """The signs that make the most of the lines: as many cells in each, and numbers in them.

    delimiter, decimal : given ones; None: found
    """
    tried = [
        Signs(between, point, _score(lines, between, point))
        for between in ([delimiter] if delimiter else DELIMITERS)
        for point in ([decimal] if decimal else ".,")
        if between != point
    ]
    if not tried:
        return Signs(delimiter or ",", "." if delimiter == "," else ",", 0.0)
    best = max(one.score for one in tried)
    return next(one for one in tried if one.score >= best - NEAR)


def _score(lines: Sequence[str], delimiter: str, decimal: str) -> float:
    """Share of lines that have as many cells as most of their kind, times the share of cells that hold a value."""
    counts: dict[str, Counter[int]] = defaultdict(Counter)
    good = cells = 0
    several = 0
    for line in lines:
        found = split(line, delimiter)
        kind = found[0] if found and is_word(found[0]) else ""
        counts[kind][len(found)] += 1
        several += len(found) > 1
        rest = found[bool(kind) :]
        cells += len(rest)
        good += sum(holds_value(cell, decimal) for cell in rest)
    if not lines or not cells:
        return 0.0
    regular = sum(count.most_common(1)[0][1] for count in counts.values()) / len(lines)
    # Many kinds of lines, each seen once, would be regular without meaning anything.
    regular -= max(0, len(counts) - 1) / len(lines)
    # One column is possible, but two are likelier.
    return regular * (0.5 + 0.5 * several / len(lines)) * good / cells


def holds_value(cell: str, decimal: str) -> bool:
    """Does a cell hold a number or a stamp, a label with one, a label alone, or nothing?"""
    if missing(cell) or is_value(cell, decimal):
        return True
    label = LABEL.fullmatch(cell)
    return label is not None and (not label[2] or is_value(label[2].strip(), decimal))

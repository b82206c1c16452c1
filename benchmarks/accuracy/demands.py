"""What must hold of `recommended` and its unsmoothed form, and on which lines it does not."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from benchmarks.accuracy.summary import JUDGED, RECOMMENDED, WITHIN, Line, ranked_on

CALLED = {"full": "full rate", "means": "1 s means"}
MOST_OVER_AVERAGE = 1.02
MOST_OVER_ORACLE = 1.06
NEES = (0.8, 1.25)
SHARE = 0.9
EXACT = 1.0 + 1e-9


@dataclass(frozen=True)
class Demand:
    """text : what must hold;  lines : on how many it was looked at;  misses : where it does not, and the figure

    needed : share of the lines on which it must hold
    """

    text: str
    lines: int
    misses: tuple[str, ...]
    needed: float = 1.0

    @property
    def holds(self) -> bool:
        """Are the misses few enough?"""
        return len(self.misses) <= (1.0 - self.needed) * self.lines * EXACT


def demands(lines: Sequence[Line]) -> list[Demand]:
    """Everything that must hold, with the misses."""
    fair = ranked_on(lines)
    exact = [line for line in lines if line.exact and line.part == "motion"]
    faulty = [line for line in lines if line.faults["true"] or line.faults["excused"]]
    per_line = len(JUDGED)
    return [
        Demand(
            f"both forms: no more than {MOST_OVER_AVERAGE:g} × the plain average",
            len(fair) * per_line * len(RECOMMENDED), tuple(_over_average(fair)),
        ),
        Demand(
            f"the better form: best, or within {WITHIN - 1:.0%} of the best row", len(fair) * per_line,
            tuple(_behind(fair)), SHARE,
        ),
        Demand(
            f"recommended: no more than {MOST_OVER_ORACLE:g} × the oracle, in motion, where its assumptions hold",
            len(exact) * per_line, tuple(_over_oracle(exact)),
        ),
        Demand(f"NEES of recommended between {NEES[0]:g} and {NEES[1]:g}", len(lines), tuple(_nees(lines)), SHARE),
        Demand("the right gyro is named, once", len(faulty), tuple(_faults(faulty))),
        Demand("no healthy gyro is accused", len(lines), tuple(_invented(lines))),
    ]  # fmt: skip


def _over_average(lines: Sequence[Line]) -> Iterator[str]:
    for line in lines:
        for name in RECOMMENDED:
            for kind in JUDGED:
                found = line.ratio(name, kind)
                if not found <= MOST_OVER_AVERAGE:
                    yield f"{line.label}: {name} {figure(found)} ({CALLED[kind]})"


def _behind(lines: Sequence[Line]) -> Iterator[str]:
    for line in lines:
        for kind in JUDGED:
            other = line.other(kind)
            if not other:
                continue
            mine, theirs = line.ratio(line.ours(kind), kind), line.ratio(other, kind)
            if not mine <= WITHIN * theirs:
                yield f"{line.label}: {figure(mine / theirs)} × {other} ({CALLED[kind]})"


def _over_oracle(lines: Sequence[Line]) -> Iterator[str]:
    for line in lines:
        for kind in JUDGED:
            found = line.ratio("recommended", kind, "oracle")
            if not found <= MOST_OVER_ORACLE:
                yield f"{line.label}: {figure(found)} ({CALLED[kind]})"


def _nees(lines: Sequence[Line]) -> Iterator[str]:
    for line in lines:
        cell = line.cells.get("recommended")
        found = cell.nees.value if cell and cell.whole else math.nan
        if not NEES[0] <= found <= NEES[1]:
            yield f"{line.label}: {figure(found)}"


def _faults(lines: Sequence[Line]) -> Iterator[str]:
    for line in lines:
        if line.faults["right"] < line.seeds:
            yield (
                f"{line.label}: right in {line.faults['right']} of {line.seeds} trials, found {line.faults['found']} of"
                f" {line.faults['true']} in {line.faults['events']} events"
            )


def _invented(lines: Sequence[Line]) -> Iterator[str]:
    for line in lines:
        if line.faults["invented"]:
            yield f"{line.label}: {line.faults['invented']} in {line.seeds} trials"


def figure(value: float) -> str:
    """Three digits."""
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "did not run"
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"

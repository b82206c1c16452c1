"""What each part of `recommended` brings: every part left out in turn, on the same seeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.accuracy.summary import COLUMNS, RECOMMENDED, TINY, Interval, Row, geometric

WORTH = 1.02
"""A part brings something on a line where leaving it out costs this much."""
HONEST = 1.25
"""It makes the s.d. honest where without it the NEES is this factor farther from 1."""


@dataclass(frozen=True)
class Change:
    """One method on one line, with and without a part.

    ratio : kind of JUDGED → error without the part over that with it;  nees : with, without
    cpu : seconds without / with
    """

    part: str
    line: str
    method: str
    ratio: dict[str, Interval]
    nees: tuple[float, float]
    cpu: float

    @property
    def most(self) -> float:
        """The ratio, full rate or 1 s means, that is farther from 1."""
        return max((one.value for one in self.ratio.values()), key=lambda value: abs(value - 1.0))

    @property
    def matters(self) -> bool:
        """Does the part change the error by 2 % or more, to either side?"""
        return not 1 / WORTH < self.most < WORTH

    @property
    def honesty(self) -> float:
        """How much farther from 1 the NEES is without the part, a factor; below 1: nearer. 1 where there is no s.d."""
        usual, without = (abs(math.log(one)) if one > 0 else math.nan for one in self.nees)
        return math.exp(without - usual) if math.isfinite(without - usual) else 1.0


def changes(rows_with: Sequence[Row], rows_without: Sequence[Row]) -> list[Change]:
    """All changes.  rows_without : their `without` names the part"""
    usual = {_key(row): row for row in rows_with if row["state"] == "ran"}
    pairs: dict[tuple[str, str, str], list[tuple[Row, Row]]] = {}
    for row in rows_without:
        if row["method"] not in RECOMMENDED or row["state"] != "ran" or _key(row) not in usual:
            continue
        line = row["scenario"] if row["part"] == "motion" else f"{row['scenario']}, at rest"
        pairs.setdefault((row["without"], line, row["method"]), []).append((usual[_key(row)], row))
    return [_change(*names, found) for names, found in pairs.items()]


def _key(row: Row) -> tuple[str, int, str, str]:
    return row["scenario"], row["seed"], row["part"], row["method"]


def _change(part: str, line: str, method: str, pairs: Sequence[tuple[Row, Row]]) -> Change:
    columns = COLUMNS[pairs[0][0]["part"]]
    ratio = {
        kind: geometric([without[name] / max(usual[name], TINY) for usual, without in pairs])
        for kind, name in columns.items()
    }
    nees = tuple(sum(pair[place]["nees"] for pair in pairs) / len(pairs) for place in (0, 1))
    cpu = sum(pair[1]["cpu_s"] for pair in pairs) / max(sum(pair[0]["cpu_s"] for pair in pairs), 1e-9)
    return Change(part, line, method, ratio, (nees[0], nees[1]), cpu)


@dataclass(frozen=True)
class PartSummary:
    """A part over all lines.

    brings, costs : the changes of the error that matter, largest first;  honest, not_honest : those of the NEES
    cpu : seconds without / with;  lines : on how many both runs came out
    """

    part: str
    brings: list[Change]
    costs: list[Change]
    honest: list[Change]
    not_honest: list[Change]
    cpu: float
    lines: int


def by_part(found: Sequence[Change]) -> list[PartSummary]:
    """Parts in their order."""
    summaries = []
    for part in dict.fromkeys(one.part for one in found):
        own = [one for one in found if one.part == part]
        brings = sorted((one for one in own if one.matters and one.most > 1), key=lambda one: -one.most)
        costs = sorted((one for one in own if one.matters and one.most < 1), key=lambda one: one.most)
        honest = sorted((one for one in own if one.honesty >= HONEST), key=lambda one: -one.honesty)
        not_honest = sorted((one for one in own if one.honesty <= 1 / HONEST), key=lambda one: one.honesty)
        cpu = geometric([one.cpu for one in own if one.method == "recommended" and one.cpu > 0]).value
        summaries.append(PartSummary(part, brings, costs, honest, not_honest, cpu, len({one.line for one in own})))
    return summaries

"""Two runs on the same seeds, before and after a change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.accuracy.summary import COLUMNS, TINY, Interval, Row, geometric


@dataclass(frozen=True)
class Difference:
    """One method on one line. ratio : kind of JUDGED → error after over before, on common seeds;  nees : before, after

    gained, lost : seeds on which it ran only after, only before;  invented : healthy gyros accused, before and after
    """

    line: str
    method: str
    ratio: dict[str, Interval]
    nees: tuple[float, float]
    cpu: float
    gained: int
    lost: int
    invented: tuple[int, int]


def differences(before: Sequence[Row], after: Sequence[Row]) -> list[Difference]:
    """For every line and method that both have."""
    old = {_key(row): row for row in before if "method" in row}
    pairs: dict[tuple[str, str], list[tuple[Row, Row]]] = {}
    for row in after:
        if _key(row) in old:
            line = row["scenario"] if row["part"] == "motion" else f"{row['scenario']}, at rest"
            pairs.setdefault((line, row["method"]), []).append((old[_key(row)], row))
    return [_difference(line, method, found) for (line, method), found in pairs.items()]


def _key(row: Row) -> tuple[str, int, str, str]:
    return row["scenario"], row["seed"], row["part"], row["method"]


def _difference(line: str, method: str, pairs: Sequence[tuple[Row, Row]]) -> Difference:
    both = [pair for pair in pairs if pair[0]["state"] == pair[1]["state"] == "ran"]
    columns = COLUMNS[pairs[0][1]["part"]]
    ratio = {kind: geometric([new[name] / max(old[name], TINY) for old, new in both]) for kind, name in columns.items()}
    nees = tuple(sum(pair[place]["nees"] for pair in both) / max(len(both), 1) for place in (0, 1))
    cpu = sum(new["cpu_s"] for _, new in both) / max(sum(old["cpu_s"] for old, _ in both), 1e-9)
    ran = [(old["state"] == "ran", new["state"] == "ran") for old, new in pairs]
    invented = tuple(sum(int(pair[place].get("faults_invented") or 0) for pair in pairs) for place in (0, 1))
    return Difference(
        line, method, ratio, (nees[0], nees[1]), cpu, ran.count((False, True)), ran.count((True, False)),
        (invented[0], invented[1]),
    )  # fmt: skip

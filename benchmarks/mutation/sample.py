"""The sample of mutants that is run: a file, so that it is the same one from day to day.

A line names its mutant by module, function, source line and change, not by line number: code may move. A line that is
edited is lost, which a test says; `python -m benchmarks.mutation sample` then draws another of its kind.
"""

from __future__ import annotations

import csv
import random
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.mutation.modules import deciding
from benchmarks.mutation.sites import Mutant, mutants

SAMPLE = Path(__file__).with_name("sample.csv")
SEED = 20
SHARES = {
    "named": 40, "comparison": 40, "constant": 30, "condition": 30, "arithmetic": 20, "boolean": 15, "not": 10,
    "extreme": 10, "returned": 5,
}  # fmt: skip
"""How many of each kind: more of those that make a rule (a bound, a price, a condition) than of the formulas."""
COLUMNS = ("mutant", "module", "function", "kind", "change", "number", "line", "equivalent")


@dataclass(frozen=True)
class Entry:
    """A line of the sample.

    mutant     : its number in the sample, from 1;  name : Mutant.name
    equivalent : why no test could tell it from the original; "" if one could
    """

    mutant: int
    name: tuple[str, str, str, str, str, int]
    equivalent: str = ""


def all_mutants(root: Path) -> list[Mutant]:
    """Of every deciding module."""
    return [one for module in deciding(root) for one in mutants(module, (root / module).read_text(encoding="utf-8"))]


def drawn(
    candidates: Sequence[Mutant], old: Sequence[Entry] = (), shares: dict[str, int] | None = None, seed: int = SEED
) -> list[Entry]:
    """A sample by SHARES: each place of a kind is equally likely, then each change of the place; in random order.

    old : a sample of which all that is still there is kept, with its number
    """
    known = {one.name for one in candidates}
    kept = {one.mutant: one for one in old if one.name in known}
    shares = SHARES if shares is None else shares
    if not old:
        kinds = [kind for kind, many in shares.items() for _ in range(many)]
        random.Random(seed).shuffle(kinds)
    else:
        kinds = [one.name[2] for one in old]
    places: defaultdict[str, dict[object, list[Mutant]]] = defaultdict(dict)
    taken = {one.name for one in kept.values()}
    for one in candidates:
        places[one.kind].setdefault(one.site, []).append(one)
    for number, kind in enumerate(kinds, 1):
        if number in kept:
            continue
        rng = random.Random(f"{seed} {number}")
        free = [group for group in places[kind].values() if not any(one.name in taken for one in group)]
        if not free:
            continue
        one = rng.choice(rng.choice(free))
        taken.add(one.name)
        kept[number] = Entry(number, one.name)
    return [kept[number] for number in sorted(kept)]


def write_sample(entries: Sequence[Entry], path: Path = SAMPLE) -> None:
    """As CSV; see COLUMNS."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for one in entries:
            module, function, kind, line, change, number = one.name
            writer.writerow([one.mutant, module, function, kind, change, number, line, one.equivalent])


def read_sample(path: Path = SAMPLE) -> list[Entry]:
    """What write_sample wrote."""
    with path.open(newline="", encoding="utf-8") as file:
        return [
            Entry(
                int(row["mutant"]),
                (row["module"], row["function"], row["kind"], row["line"], row["change"], int(row["number"])),
                row["equivalent"],
            )
            for row in csv.DictReader(file)
        ]

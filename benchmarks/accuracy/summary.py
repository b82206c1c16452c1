"""Rows of single trials → a cell for each line (scenario and recording) and method, ranks, and what must hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from scipy.stats import t as student

Row = dict[str, Any]
MEASURES = ("sd", "sd_1s", "rms", "rms_1s")
YARDSTICKS = ("average", "best_gyro", "oracle")
CONFIDENCE = 0.95
JUDGED = ("full", "means")
"""Errors by which methods are judged: at the full rate, of 1 s means."""
COLUMNS = {"motion": {"full": "sd", "means": "sd_1s"}, "rest": {"full": "rms", "means": "rms_1s"}}
"""In motion the s.d.: the common bias of an array, which no method can see, is left out. At rest the r.m.s. error: a
gyro that repeats one value has no s.d."""
RECOMMENDED = ("recommended", "recommended_unsmoothed")
TINY = 1e-12


@dataclass(frozen=True)
class Interval:
    """value, and its limits at 95 % over the seeds; NaN with one seed"""

    value: float
    low: float = math.nan
    high: float = math.nan


@dataclass(frozen=True)
class Cell:
    """One method on one line.

    over : (yardstick, measure) → ratio of the errors, r.m.s. over the seeds;  nees : mean, of those that
    ran;  ran : of `seeds`;  note : why it did not run
    """

    method: str
    over: dict[tuple[str, str], Interval]
    nees: Interval
    coverage: float
    cpu_s: float
    ran: int
    seeds: int
    state: str
    note: str

    @property
    def whole(self) -> bool:
        """Did it run on every seed?"""
        return self.ran == self.seeds


@dataclass(frozen=True)
class Line:
    """One recording of one scenario.

    oracle : its errors over those of the average, measure by measure, and under "nees" its NEES;  exact : see Scenario
    best_gyro : the same of the best gyro by itself
    faults : sums over the seeds: those of scores.FaultScore, and right: trials;  average_counts : false where a
    gyro without a rate brings the average nearer to the truth
    """

    scenario: str
    part: str
    seeds: int
    exact: bool
    average_counts: bool
    oracle: dict[str, float]
    best_gyro: dict[str, float]
    faults: dict[str, int]
    cells: dict[str, Cell]

    @property
    def label(self) -> str:
        """Name in tables."""
        return self.scenario if self.part == "motion" else f"{self.scenario}, at rest"

    def ratio(self, method: str, kind: str, yardstick: str = "average") -> float:
        """Error of a method over a yardstick's, of a kind in JUDGED; infinite where it did not run on every seed."""
        cell = self.cells.get(method)
        return math.inf if cell is None or not cell.whole else self.interval(cell, kind, yardstick).value

    def interval(self, cell: Cell, kind: str, yardstick: str = "average") -> Interval:
        """The same with its limits, of the seeds on which it ran."""
        return cell.over[yardstick, COLUMNS[self.part][kind]]

    def yardstick(self, errors: dict[str, float], kind: str) -> float:
        """One of `oracle` and `best_gyro`."""
        return errors[COLUMNS[self.part][kind]]

    def best(self, kind: str, among: Callable[[str], bool]) -> str:
        """The method of least error of those that ran on every seed; "": none."""
        known = [name for name in self.cells if among(name) and math.isfinite(self.ratio(name, kind))]
        return min(known, key=lambda name: self.ratio(name, kind), default="")

    def ours(self, kind: str) -> str:
        """Recommended or its unsmoothed form, whichever is better."""
        return self.best(kind, lambda name: name in RECOMMENDED)

    def other(self, kind: str) -> str:
        """The best of all other methods."""
        return self.best(kind, lambda name: name not in RECOMMENDED)


def summarised(rows: Iterable[Row]) -> list[Line]:
    """Lines in the order of the rows."""
    lines: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        lines.setdefault((row["scenario"], row["part"]), []).append(row)
    return [_line(scenario, part, found) for (scenario, part), found in lines.items()]


def _line(scenario: str, part: str, rows: list[Row]) -> Line:
    methods: dict[str, list[Row]] = {}
    for row in rows:
        methods.setdefault(row["method"], []).append(row)
    trials = list({row["seed"]: row for row in rows}.values())
    oracle, single = (
        {name: pooled(trials, f"{who}_{name}", f"average_{name}").value for name in MEASURES}
        for who in ("oracle", "best_gyro")
    )
    oracle["nees"] = float(np.mean([one["oracle_nees"] for one in trials]))
    names = ("true", "found", "named", "stray", "invented", "excused", "events", "right")
    faults = {name: sum(int(one.get(f"faults_{name}") or 0) for one in trials) for name in names}
    cells = {name: _cell(name, found) for name, found in methods.items() if found[0]["state"] != "left out"}
    exact, fair = trials[0]["oracle_kind"] == "exact", not trials[0]["spoilt_average"]
    return Line(scenario, part, len(trials), exact, fair, oracle, single, faults, cells)


def _cell(method: str, rows: list[Row]) -> Cell:
    ran = [row for row in rows if row["state"] == "ran"]
    broken = next((row for row in rows if row["state"] != "ran"), None)
    over = {(who, name): pooled(ran, name, f"{who}_{name}") for who in YARDSTICKS for name in MEASURES}
    mean = arithmetic([row["nees"] for row in ran])
    nees = Interval(mean.value, mean.low if math.isnan(mean.low) else max(mean.low, 0.0), mean.high)
    coverage, cpu = (float(np.mean([row[name] for row in ran])) if ran else math.nan for name in ("coverage", "cpu_s"))
    state, note = (broken["state"], broken["note"]) if broken else ("ran", "")
    return Cell(method, over, nees, coverage, cpu, len(ran), len(rows), state, note)


def pooled(rows: Sequence[Row], error: str, yardstick: str) -> Interval:
    """Root of Σ error² over Σ yardstick² over the seeds, and its limits: jackknife of the logarithm, Student's t.

    At rest an error is about one number a seed, the common bias: a mean of the ratios would be ruled by the seeds on
    which that of the yardstick is nothing by chance.
    """
    if not rows:
        return Interval(math.nan)
    sums = np.array([[row[error], row[yardstick]] for row in rows]) ** 2
    logs = 0.5 * np.log(np.maximum(sums.sum(axis=0), TINY**2))
    value, seeds = float(np.exp(logs[0] - logs[1])), len(rows)
    if seeds < 2:
        return Interval(value)
    without = 0.5 * np.log(np.maximum(sums.sum(axis=0) - sums, TINY**2)) @ [1.0, -1.0]
    error_of_log = math.sqrt((seeds - 1) / seeds * float(np.sum((without - without.mean()) ** 2)))
    half = float(student.ppf(0.5 + CONFIDENCE / 2, seeds - 1)) * error_of_log
    return Interval(value, value * math.exp(-half), value * math.exp(half))


def geometric(values: Sequence[float]) -> Interval:
    """Geometric mean and its limits, from Student's t of the logarithms."""
    if not values:
        return Interval(math.nan)
    logs = arithmetic(np.log(np.maximum(values, TINY)).tolist())
    return Interval(*(math.exp(one) for one in (logs.value, logs.low, logs.high)))


def arithmetic(values: Sequence[float]) -> Interval:
    """Mean and its limits, from Student's t."""
    if not values:
        return Interval(math.nan)
    mean = float(np.mean(values))
    if len(values) < 2:
        return Interval(mean)
    half = float(student.ppf(0.5 + CONFIDENCE / 2, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values)))
    return Interval(mean, mean - half, mean + half)


@dataclass(frozen=True)
class Rank:
    """A method over all lines. mean : of its ranks;  first : lines on which it is best or within 3 % of it

    typical, worst : geometric mean and largest of its errors over the average's;  ran : lines;  cpu_s : mean of a trial
    """

    method: str
    mean: float
    first: int
    typical: float
    worst: float
    worst_on: str
    ran: int
    cpu_s: float


WITHIN = 1.03


def ranked_on(lines: Sequence[Line]) -> list[Line]:
    """The lines that ranks are made of: not those on which a gyro without a rate flatters the average."""
    return [line for line in lines if line.average_counts]


def ranks(lines: Sequence[Line], kind: str) -> list[Rank]:
    """Methods by their mean rank over ranked_on(lines). Equal errors share a rank; who did not run is last."""
    lines = ranked_on(lines)
    names = list(dict.fromkeys(name for line in lines for name in line.cells))
    places: dict[str, list[float]] = {name: [] for name in names}
    first = dict.fromkeys(names, 0)
    for line in lines:
        ratio = {name: line.ratio(name, kind) for name in names}
        least = min(ratio.values())
        ordered = sorted(names, key=lambda name: ratio[name])
        before = 0
        for _, tied in groupby(ordered, key=lambda name: ratio[name]):
            group = list(tied)
            for name in group:
                places[name].append(before + (len(group) + 1) / 2)
                first[name] += bool(ratio[name] <= WITHIN * least)
            before += len(group)
    found = [_rank(name, lines, kind, float(np.mean(places[name])), first[name]) for name in names]
    return sorted(found, key=lambda one: one.mean)


def _rank(name: str, lines: Sequence[Line], kind: str, mean: float, first: int) -> Rank:
    there = [line for line in lines if name in line.cells and line.cells[name].whole]
    ratio = {line.label: line.ratio(name, kind) for line in there}
    worst = max(ratio, key=lambda label: ratio[label], default="")
    cpu = float(np.mean([line.cells[name].cpu_s for line in there])) if there else math.nan
    return Rank(
        name, mean, first, geometric(list(ratio.values())).value, ratio.get(worst, math.nan), worst, len(there), cpu
    )

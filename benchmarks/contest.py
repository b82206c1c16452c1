"""A contest: one task, our way and the others', timed in turn in the same process."""

from __future__ import annotations

import resource
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

LEAST_SECONDS = 0.05
"""A run that is shorter is repeated: the clock of the process and the noise of the machine need so much."""


@dataclass(frozen=True)
class Side:
    """One way to do the task. run : does `units` units of work;  library : with its version, as the table names it"""

    name: str
    run: Callable[[], object]
    units: float


@dataclass(frozen=True)
class Rival:
    """A side that ours is held against. target : see Contest; None: shown, not judged"""

    side: Side
    target: float | None = None


@dataclass(frozen=True)
class Accuracy:
    """A figure that must hold before a time means anything. limit : largest value that passes; None: shown only"""

    name: str
    value: float
    limit: float | None = None

    @property
    def passed(self) -> bool:
        return self.limit is None or self.value <= self.limit


@dataclass(frozen=True)
class Contest:
    """One task. unit : of work, "fit", "sample" …

    limit_s    : seconds a unit at the arithmetic limit (benchmarks.limits)
    difference : false: the figure is their time over ours, and a target the least that passes; true: the figure is our
                 time minus theirs, s, and a target the most that passes
    """

    name: str
    title: str
    unit: str
    ours: Side
    rivals: tuple[Rival, ...]
    limit_s: float
    accuracy: Callable[[], list[Accuracy]]
    note: str = ""
    difference: bool = False


@dataclass(frozen=True)
class Against:
    """One rival. seconds : a unit, median over the rounds;  figure, low, high : median, least and greatest of them"""

    name: str
    seconds: float
    figure: float
    low: float
    high: float
    target: float | None
    passed: bool


@dataclass(frozen=True)
class Result:
    """What came of a contest. seconds : ours, a unit, median over the rounds"""

    name: str
    title: str
    unit: str
    difference: bool
    rounds: int
    seconds: float
    limit_s: float
    against: tuple[Against, ...]
    accuracy: tuple[Accuracy, ...]
    note: str

    @property
    def accurate(self) -> bool:
        return all(figure.passed for figure in self.accuracy)


def play(contest: Contest, rounds: int) -> Result:
    """Check the figures once (which warms everything up), then time all sides in turn, `rounds` times."""
    accuracy = tuple(contest.accuracy())
    sides = [contest.ours, *(rival.side for rival in contest.rivals)]
    repeats = [_repeats(side) for side in sides]
    times = [[_seconds(side, count) for side, count in zip(sides, repeats, strict=True)] for _ in range(rounds)]
    against = tuple(_against(contest, rival, times, place) for place, rival in enumerate(contest.rivals, start=1))
    seconds = statistics.median(row[0] for row in times)
    return Result(
        contest.name, contest.title, contest.unit, contest.difference, rounds, seconds, contest.limit_s, against,
        accuracy, contest.note,
    )  # fmt: skip


def _against(contest: Contest, rival: Rival, times: list[list[float]], place: int) -> Against:
    """One rival's figures; times [round][side], ours first."""
    figures = [row[0] - row[place] if contest.difference else row[place] / row[0] for row in times]
    figure, target = statistics.median(figures), rival.target
    passed = target is None or (figure <= target if contest.difference else figure >= target)
    seconds = statistics.median(row[place] for row in times)
    return Against(rival.side.name, seconds, figure, min(figures), max(figures), target, passed)


def _repeats(side: Side) -> int:
    """Runs in a row that take long enough to be timed; the first one is the warm-up."""
    side.run()
    taken = _seconds(side, 1) * side.units
    return max(1, round(LEAST_SECONDS / max(taken, 1e-6)))


def _seconds(side: Side, repeats: int) -> float:
    """CPU seconds a unit, user and system, of this process and of the interpreters that it started."""
    before, children = time.process_time(), _children()
    for _ in range(repeats):
        side.run()
    return (time.process_time() - before + _children() - children) / (repeats * side.units)


def _children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime

"""python -m benchmarks.mimu: the methods on real captures of eight gyros an axis, without a rate reference.

The captures (mimu4444-array; folder named by VGYRO_SHARED_DATA) hold some twenty poses at rest, a short turn between
each two, and a hand rotation that reaches ±2000 deg/s. What is judged, and how, is in docs/real-data.md:

rest  : the noise record is made of every second pose, the methods run on the others, where the rate is zero; and the
        other way round. Standard deviation about the mean of each pose, of samples and of means over 1 s.
turns, hand : each gyro in turn is left out, and the other seven predict it. What every method gets alike is taken off:
        the scale factor, alignment and bias of the gyro left out, by regression on the prediction, on the averages of
        the two other axes and on a constant; and its own noise, as the differences of all eight gyros show it in the
        same samples. What is left is the error of the virtual gyro.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from vgyro.calibration import find_rest
from vgyro.config import FaultOptions, FusionOptions, MetricsOptions
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters, Fused, Method
from vgyro.fusion.faults import search_faults
from vgyro.fusion.registry import run_methods, select
from vgyro.metrics import Sampling
from vgyro.tasks.fusion.noise import noise_at_rest, record_of
from vgyro.tasks.fusion.noise_record import noise_of_record
from vgyro.tasks.rates.rates_file import FileColumns

SHARED_DATA = "VGYRO_SHARED_DATA"
ABSENT = 3
"""Exit code without the captures."""
RATE_HZ, SCALE = 62.5, 1 / 16.4
LONG_S = 15.0
"""A pose that lasts longer counts."""
CLIPPED = 1990.0
"""deg/s, from which the rate may be cut off."""
# SOURCE.md of the data: IMUs 1, 3, 5, 7 have the board's axes; on 2, 4, 6, 8 (x', y', z') = (-y, -x, -z).
ODD, EVEN = (1, 3, 5, 7), (2, 4, 6, 8)
OTHER = {"x": "y", "y": "x", "z": "z"}
AXES = {
    axis: [*(f"imu{n}_g{axis}" for n in ODD), *(f"imu{n}_g{OTHER[axis]}" for n in EVEN)] for axis in ("x", "y", "z")
}
CAPTURES = ("exp_1", "exp_2")
PARTS = ("rest", "turns", "hand")
# Rows that need nothing but rates and the noise record; not DCC, whose forecasts begin after six minutes at rest.
NOT_HERE = ("ccc_in_sample", "ccc_causal", "dcc_in_sample", "dcc_causal", "dcc_smoothed")
OURS = ("recommended", "recommended_unsmoothed")
AVERAGE = "average"
WITHIN = 1.03


@dataclass(frozen=True)
class Capture:
    """rates : axis → [T, 8] deg/s, less the mean at rest;  still [T];  poses : the long ones;  hand : its samples"""

    rates: dict[str, np.ndarray]
    still: np.ndarray
    poses: list[slice]
    hand: slice

    def part(self, name: str) -> slice:
        """`turns`: from the first pose to the end of the last; `hand`: the last pose and the hand rotation."""
        if name == "turns":
            return slice(self.poses[0].start, self.poses[-1].stop)
        return slice(self.poses[-1].start, self.hand.stop)

    def whole_samples(self) -> np.ndarray:
        """bool [T]: in motion, and no gyro of any axis is near the end of its range."""
        return ~self.still & np.all([np.abs(rate).max(axis=1) <= CLIPPED for rate in self.rates.values()], axis=0)


@dataclass
class Column:
    """One column of the tables: row → mean squares, (deg/s)², one a case (capture; at rest capture and half).

    filters : rows that limit the bandwidth;  failed : row → why it did not run
    """

    cases: dict[str, list[float]] = field(default_factory=dict)
    filters: set[str] = field(default_factory=set)
    failed: dict[str, str] = field(default_factory=dict)

    def of(self, rows: Iterable[str]) -> dict[str, float]:
        """Row → r.m.s. error over the cases, deg/s; rows that ran in every case alone."""
        number = max((len(one) for one in self.cases.values()), default=0)
        whole = {row: self.cases[row] for row in rows if len(self.cases.get(row, ())) == number > 0}
        return {row: math.sqrt(max(float(np.mean(values)), 0.0)) for row, values in whole.items()}


@cache
def capture(folder: Path, name: str) -> Capture:
    """A capture, in the board's axes."""
    table = pq.read_table(folder / f"{name}.parquet")
    columns = {one: table.column(one).to_numpy() * SCALE for one in table.column_names if "_g" in one}
    still = find_rest(np.column_stack(list(columns.values())), RATE_HZ)
    edges = [0, *(np.flatnonzero(np.diff(still)) + 1).tolist(), len(still)]
    runs = [slice(start, stop) for start, stop in pairwise(edges)]
    poses = [run for run in runs if still[run.start] and run.stop - run.start > LONG_S * RATE_HZ]
    hand = max((run for run in runs if not still[run.start]), key=lambda run: run.stop - run.start)
    rates = {
        axis: np.column_stack([columns[gyro] * (1.0 if int(gyro[3]) % 2 else -1.0) for gyro in gyros])
        for axis, gyros in AXES.items()
    }
    return Capture({axis: one - one[still].mean(axis=0) for axis, one in rates.items()}, still, poses, hand)


def noise_of(poses: Sequence[np.ndarray]) -> ArrayNoise:
    """Noise of an array at rest, a stretch a pose [n, N], as the noise stage finds it."""
    rate = np.concatenate(poses)
    gyros = [f"gyro {number + 1}" for number in range(rate.shape[1])]
    held = {(Path(), gyro): column for gyro, column in zip(gyros, rate.T, strict=True)}
    columns = FileColumns([(Path(), gyro) for gyro in gyros], held=held)
    found = noise_at_rest(columns, Sampling.of(RATE_HZ, _segments(poses)), MetricsOptions(bootstrap=50), "native")
    return noise_of_record(record_of(found, gyros, "", ""), gyros)


def _segments(poses: Sequence[np.ndarray]) -> np.ndarray:
    return np.repeat(np.arange(len(poses), dtype=np.int32), [len(pose) for pose in poses])


def fused(array: ArrayRates, methods: Sequence[Method], moves: bool, column: Column) -> Iterator[tuple[str, Fused]]:
    """Row and virtual gyro of every method that runs, in its turn; faults are found first, as the fault stage does."""
    zero = np.zeros((array.rate.shape[1], 2))
    search = search_faults(array, FaultOptions(), zero, in_hand=moves)
    array = replace(array, faults=tuple(search.events))
    for outcome in run_methods(array, FilterParameters.of(FusionOptions(), moves), methods, ()):
        if outcome.fused is None:
            column.failed[outcome.method.name] = outcome.note
            continue
        if math.isnan(outcome.fused.dc_gain) or not math.isnan(outcome.fused.bandwidth_hz):
            column.filters.add(outcome.column)
        yield outcome.column, outcome.fused


def at_rest(one: Capture, axis: str, methods: Sequence[Method], samples: Column, seconds: Column) -> None:
    """Two cases, a half each: variance of samples and of means over 1 s."""
    poses = [one.rates[axis][pose] for pose in one.poses]
    for known, unseen in ((poses[::2], poses[1::2]), (poses[1::2], poses[::2])):
        rate = np.asfortranarray(np.concatenate(unseen))
        # The poses between are as if never recorded.
        begins = np.cumsum([0.0, *(2.0 * len(pose) / RATE_HZ for pose in unseen[:-1])])
        still = np.ones(len(rate), dtype=bool)
        array = ArrayRates(rate, RATE_HZ, _segments(unseen), still, noise_of(known), stretch_time=begins)
        edges = np.cumsum([len(pose) for pose in unseen])[:-1]
        for row, out in fused(array, methods, False, samples):
            pieces = np.split(out.rate, edges)
            samples.cases.setdefault(row, []).append(scatter(pieces, 0.0))
            seconds.cases.setdefault(row, []).append(scatter(pieces, 1.0))
    seconds.filters |= samples.filters


def scatter(pieces: Sequence[np.ndarray], seconds: float) -> float:
    """Variance about the mean of each piece, (deg/s)²; seconds > 0: of its means over so long."""
    size = max(1, round(seconds * RATE_HZ))
    squares, freedom = 0.0, 0
    for piece in pieces:
        means = piece[: len(piece) // size * size].reshape(-1, size).mean(axis=1)
        squares += float(((means - means.mean()) ** 2).sum())
        freedom += len(means) - 1
    return squares / freedom


def in_motion(
    one: Capture, axis: str, part: str, methods: Sequence[Method], column: Column, left_out: Sequence[int] = range(8)
) -> None:
    """One case: the mean over the gyros left out of the square of their prediction's error, less their own noise."""
    chosen = one.part(part)
    whole, still, used = one.rates[axis][chosen], one.still[chosen], one.whole_samples()[chosen]
    others = np.column_stack([one.rates[other][chosen].mean(axis=1) for other in AXES if other != axis])[used]
    noise = noise_of([one.rates[axis][pose] for pose in one.poses])
    own = own_noise(whole[used], others)
    found: dict[str, list[float]] = {}
    for gyro in left_out:
        rest = [place for place in range(whole.shape[1]) if place != gyro]
        rate, segment = np.asfortranarray(whole[:, rest]), np.zeros(len(whole), dtype=np.int32)
        array = ArrayRates(rate, RATE_HZ, segment, still, noise.of(rest), stretch_time=np.zeros(1))
        for row, out in fused(array, methods, True, column):
            left = unexplained(whole[used, gyro][:, None], out.rate[used], others)
            found.setdefault(row, []).append(float(np.mean(np.square(left))) - own[gyro])
    for row, values in found.items():
        if len(values) == len(left_out):
            column.cases.setdefault(row, []).append(float(np.mean(values)))


def unexplained(gyros: np.ndarray, rate: np.ndarray, others: np.ndarray) -> np.ndarray:
    """What is left of gyros [T, N] after the regression on a rate [T], the other axes [T, 2] and a constant."""
    known = np.column_stack([rate, others, np.ones(len(rate))])
    return gyros - known @ np.linalg.lstsq(known, gyros, rcond=None)[0]


def own_noise(gyros: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Variance [N] of each gyro's own noise, (deg/s)², from its difference from the mean of all [T, N].

    With independent noise of variance v_i the variance of that difference is (1 - 2/N)v_i + Σv/N².
    """
    number = gyros.shape[1]
    seen = np.mean(np.square(unexplained(gyros, gyros.mean(axis=1), others)), axis=0)
    total = seen.sum() * number / (number - 1)
    return (seen - total / number**2) / (1.0 - 2.0 / number)


def measured(
    folder: Path, axes: Sequence[str], captures: Sequence[str], parts: Sequence[str], methods: Sequence[Method]
) -> dict[tuple[str, str], Column]:
    """(kind, axis) → column; kinds: rest; rest, 1 s; turns; hand.  folder : of the captures"""
    columns: dict[tuple[str, str], Column] = {}
    for part in parts:
        for axis in axes:
            own = columns[part, axis] = Column()
            for name in captures:
                if part == "rest":
                    seconds = columns.setdefault(("rest, 1 s", axis), Column())
                    at_rest(capture(folder, name), axis, methods, own, seconds)
                else:
                    in_motion(capture(folder, name), axis, part, methods, own)
    return columns


def ratio(columns: Iterable[Column], row: str, to: str = AVERAGE) -> tuple[float, float, float]:
    """Error of a row over that of another, geometric mean over the cases of all columns, and its 95 % interval.

    NaN where it did not run in every case.
    """
    from scipy.stats import t as student

    pairs: list[tuple[float, float]] = []
    for one in columns:
        mine, theirs = one.cases.get(row, []), one.cases[to]
        if len(mine) != len(theirs) or min(*mine, *theirs) <= 0.0:
            return math.nan, math.nan, math.nan
        pairs += zip(mine, theirs, strict=True)
    logs = np.array([0.5 * math.log(mine / theirs) for mine, theirs in pairs])
    half = math.nan
    if len(logs) > 1:
        half = float(student.ppf(0.975, len(logs) - 1)) * float(logs.std(ddof=1)) / math.sqrt(len(logs))
    middle = float(logs.mean())
    return math.exp(middle), math.exp(middle - half), math.exp(middle + half)


def ours_over_best(column: Column, filters: bool) -> tuple[str, str, float]:
    """The better of ours, the best of all other rows, and the first one's error over the other's.

    filters : rows that limit the bandwidth take part; else neither they nor our smoothed row
    """
    rows = [row for row in column.cases if filters or row not in column.filters]
    errors = column.of(rows)
    mine = min((row for row in errors if row in OURS), key=lambda row: errors[row])
    best = min((row for row in errors if row not in OURS), key=lambda row: errors[row])
    return mine, best, errors[mine] / errors[best] if errors[best] > 0 else math.inf


def tables(columns: dict[tuple[str, str], Column]) -> str:
    """Three tables: errors by axis, ratios to the average over everything, and ours against the best."""
    rows = list(dict.fromkeys(row for one in columns.values() for row in one.cases))
    kinds = list(dict.fromkeys(kind for kind, _ in columns))
    lines = _header("10⁻³ deg/s", [f"{kind} {axis}" for kind, axis in columns])
    errors = [one.of(rows) for one in columns.values()]
    lines += [_line(row, [f"{1e3 * one[row]:.3g}" if row in one else "–" for one in errors]) for row in rows]
    lines += ["", *_header("error over that of the average", kinds)]
    for row in rows:
        found = [ratio([one for (of, _), one in columns.items() if of == kind], row) for kind in kinds]
        lines.append(_line(row, [_interval(*one) for one in found]))
    lines += ["", *_header("ours over the best other row", ["all rows", "rows of full bandwidth"])]
    for (kind, axis), one in columns.items():
        cells = []
        for filters in (True, False):
            mine, best, over = ours_over_best(one, filters)
            cells.append(f"{over:.3g}{'' if over <= WITHIN else ' **over**'} ({mine} / {best})")
        lines.append(_line(f"{kind} {axis}", cells))
    failed = {f"{row}: {why}": None for one in columns.values() for row, why in one.failed.items()}
    return "\n".join([*lines, *(["", "Did not run everywhere:", *failed] if failed else [])])


def _header(corner: str, names: Sequence[str]) -> list[str]:
    return [_line(corner, names), "|" + " --- |" * (len(names) + 1)]


def _interval(value: float, low: float, high: float) -> str:
    if math.isnan(value):
        return "–"
    return f"{value:.3g}" if math.isnan(low) else f"{value:.3g} [{low:.3g}, {high:.3g}]"


def _line(row: str, cells: Sequence[str]) -> str:
    return f"| {row} | " + " | ".join(cells) + " |"


def main(arguments: list[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser("python -m benchmarks.mimu", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", action="append", metavar="METHOD", help="row; ours and the average come along")
    parser.add_argument("--axis", action="append", choices=tuple(AXES))
    parser.add_argument("--capture", action="append", choices=CAPTURES)
    parser.add_argument("--part", action="append", choices=PARTS)
    given = parser.parse_args(arguments)
    folder = Path(os.environ.get(SHARED_DATA, "../shared/data")) / "mimu4444-array"
    if not folder.is_dir():
        print(f"no captures at {folder}: set {SHARED_DATA} to the folder that holds mimu4444-array", file=sys.stderr)
        return ABSENT
    chosen = select([*given.only, *OURS, AVERAGE] if given.only else "all")
    methods = [one for one in chosen if one.name not in NOT_HERE]
    print(tables(measured(folder, given.axis or list(AXES), given.capture or CAPTURES, given.part or PARTS, methods)))
    return 0


if __name__ == "__main__":
    sys.exit(main())

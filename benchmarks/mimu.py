"""python -m benchmarks.mimu: the methods on real captures of eight gyros an axis, without a rate reference.

The captures (mimu4444-array; folder named by VGYRO_SHARED_DATA) hold some twenty poses at rest, a short turn between each
two, and a hand rotation that reaches ±2000 deg/s. Two tables:

at rest   : the noise record is made of every second pose, the methods run on the others, where the rate is zero; and the
            other way round. Standard deviation about the mean of each pose, of samples and of means over 1 s.
in motion : each gyro in turn is left out, and the other seven predict it. What every method gets alike is taken off: the
            scale factor, alignment and bias of the gyro left out, by regression on the prediction, on the averages of the
            two other axes and on a constant; and its own noise, as the differences of all eight gyros show it in the same
            samples. What is left is the error of the virtual gyro.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from vgyro.calibration import find_rest
from vgyro.config import FusionOptions, MetricsOptions
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.registry import Method, run_methods, select
from vgyro.metrics import Sampling
from vgyro.tasks.fusion_inputs import noise_of_record
from vgyro.tasks.noise import noise_at_rest, record_of

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
PARTS = ("turns", "hand")
# The rows that need nothing but rates and the noise record; not DCC, whose forecasts begin after six minutes at rest.
NOT_HERE = ("ccc_in_sample", "ccc_causal", "dcc_in_sample", "dcc_causal", "dcc_smoothed")
OURS = ("recommended", "recommended_unsmoothed")


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


@cache
def capture(folder: Path, name: str) -> Capture:
    """A capture, in the board's axes."""
    table = pq.read_table(folder / "mimu4444-array" / f"{name}.parquet")
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
    sampling = Sampling.of(RATE_HZ, np.repeat(np.arange(len(poses), dtype=np.int32), [len(pose) for pose in poses]))
    columns = _Columns(rate)
    found = noise_at_rest(columns, sampling, MetricsOptions(bootstrap=50), "native")
    return noise_of_record(record_of(found, gyros, "", ""), gyros)


@dataclass(frozen=True)
class _Columns(Sequence[np.ndarray]):
    """The gyros one by one, as the noise stage reads them from a file."""

    values: np.ndarray
    cleaned: Callable[[np.ndarray], np.ndarray] | None = None

    def __len__(self) -> int:
        return self.values.shape[1]

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        values = np.array(self.values[:, index])
        return values if self.cleaned is None else self.cleaned(values)


def fused(array: ArrayRates, methods: Sequence[Method], in_motion: bool) -> Iterator[tuple[str, np.ndarray]]:
    """Row and rate [T] of every method that runs; faults are found first, as the fault stage does."""
    from vgyro.fusion.faults import find_faults

    array = replace(array, faults=tuple(find_faults(array)))
    parameters = FilterParameters.of(FusionOptions(), in_motion)
    for outcome in run_methods(array, parameters, methods, ()):
        if outcome.fused is not None:
            yield outcome.column, outcome.fused.rate


def at_rest(folder: Path, axis: str, names: Sequence[str], methods: Sequence[Method]) -> dict[str, np.ndarray]:
    """Row → r.m.s. over captures and halves of the s.d. of samples and of means over 1 s, deg/s."""
    found: dict[str, list[list[float]]] = {}
    for name in names:
        one = capture(folder, name)
        poses = [one.rates[axis][pose] for pose in one.poses]
        for known, unseen in ((poses[::2], poses[1::2]), (poses[1::2], poses[::2])):
            rate = np.asfortranarray(np.concatenate(unseen))
            segment = np.repeat(np.arange(len(unseen), dtype=np.int32), [len(pose) for pose in unseen])
            begins = np.cumsum([0.0, *(len(pose) / RATE_HZ + 5.0 for pose in unseen[:-1])])
            still = np.ones(len(rate), dtype=bool)
            array = ArrayRates(rate, RATE_HZ, segment, still, noise_of(known), stretch_time=begins)
            edges = np.flatnonzero(np.diff(segment)) + 1
            for row, out in fused(array, methods, in_motion=False):
                pieces = np.split(out, edges)
                found.setdefault(row, []).append([scatter(pieces, seconds) for seconds in (0.0, 1.0)])
    return {row: np.sqrt(np.mean(np.square(values), axis=0)) for row, values in found.items()}


def scatter(pieces: Sequence[np.ndarray], seconds: float) -> float:
    """S.d. about the mean of each piece, deg/s; seconds > 0: of its means over so long."""
    size = max(1, round(seconds * RATE_HZ))
    squares, freedom = 0.0, 0
    for piece in pieces:
        means = piece[: len(piece) // size * size].reshape(-1, size).mean(axis=1)
        squares += float(((means - means.mean()) ** 2).sum())
        freedom += len(means) - 1
    return float(np.sqrt(squares / freedom))


def in_motion(
    folder: Path, axis: str, name: str, part: str, methods: Sequence[Method], left_out: Sequence[int] = range(8)
) -> dict[str, np.ndarray]:
    """Row → of each gyro that was left out the mean square of its prediction, less its own noise, (deg/s)²."""
    one = capture(folder, name)
    chosen = one.part(part)
    whole, still = one.rates[axis][chosen], one.still[chosen]
    others = np.column_stack([one.rates[other][chosen].mean(axis=1) for other in AXES if other != axis])
    used = ~still & ~np.any([np.abs(rate[chosen]).max(axis=1) > CLIPPED for rate in one.rates.values()], axis=0)
    noise = noise_of([one.rates[axis][pose] for pose in one.poses])
    own = own_noise(whole[used], others[used])
    found: dict[str, list[float]] = {}
    for gyro in left_out:
        rest = [place for place in range(whole.shape[1]) if place != gyro]
        array = ArrayRates(
            np.asfortranarray(whole[:, rest]), RATE_HZ, np.zeros(len(whole), dtype=np.int32), still, noise.of(rest),
            stretch_time=np.zeros(1),
        )  # fmt: skip
        for row, out in fused(array, methods, in_motion=True):
            left = unexplained(whole[used, gyro][:, None], out[used], others[used])
            found.setdefault(row, []).append(float(np.mean(np.square(left))) - own[gyro])
    return {row: np.array(values) for row, values in found.items()}


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


def error(values: Sequence[np.ndarray]) -> float:
    """R.m.s. error, deg/s, of mean squares of several captures."""
    return float(np.sqrt(max(np.mean(np.concatenate(values)), 0.0)))


def main(arguments: list[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser("python -m benchmarks.mimu", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", action="append", metavar="METHOD", help="rows; all that need no DCC weights otherwise")
    parser.add_argument("--axis", action="append", choices=tuple(AXES))
    parser.add_argument("--capture", action="append", choices=CAPTURES)
    parser.add_argument("--part", action="append", choices=("rest", *PARTS))
    given = parser.parse_args(arguments)
    folder = Path(os.environ.get("VGYRO_SHARED_DATA", "../shared/data"))
    if not (folder / "mimu4444-array").is_dir():
        print(f"no captures in {folder}; set VGYRO_SHARED_DATA", file=sys.stderr)
        return 1
    methods = [one for one in select(given.only or "all") if one.name not in NOT_HERE]
    axes, names = given.axis or tuple(AXES), given.capture or CAPTURES
    table: dict[str, dict[str, float]] = {}
    for part in given.part or ("rest", *PARTS):
        for axis in axes:
            if part == "rest":
                for row, (sample, second) in at_rest(folder, axis, names, methods).items():
                    table.setdefault(row, {}).update({f"rest {axis}": sample, f"rest {axis}, 1 s": second})
                continue
            found = [in_motion(folder, axis, name, part, methods) for name in names]
            for row in found[0]:
                table.setdefault(row, {})[f"{part} {axis}"] = error([one[row] for one in found])
    print(as_markdown(table))
    return 0


def as_markdown(table: dict[str, dict[str, float]]) -> str:
    """Rows and columns of the table, in 1/1000 deg/s."""
    columns = list(dict.fromkeys(column for row in table.values() for column in row))
    lines = ["| 10⁻³ deg/s | " + " | ".join(columns) + " |", "|" + " --- |" * (len(columns) + 1)]
    for row, cells in table.items():
        values = [f"{1e3 * cells[column]:.1f}" if column in cells else "" for column in columns]
        lines.append(f"| {row} | " + " | ".join(values) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())

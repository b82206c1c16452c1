"""The true rate between its samples: what the errors of all series need of it, computed once."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from vgyro.runs import runs

STILL = 1e-9
PART = 1 << 16
MOST_SAMPLES = 1 << 20
FEWEST_PERIODS, SINUSOID = 2, 0.99
"""A reference is a sinusoid if so many periods of one make up so much of its variance."""
STEPS = 6
FORGOTTEN = 64  # samples after which a cubic spline has forgotten its end: 0.27^64


@dataclass(frozen=True)
class Truth:
    """A reference [T] in deg/s without NaN, and its cubic spline.

    cuts   : stretches without a gap;  runs : those long enough for a delay;  margin : samples left out at their ends
    swing  : standard deviation, deg/s;  centre : deg/s, near its mean
    slopes : [T] derivative of the spline at the samples, per sample, within runs
    spread : [2·margin + 1] Σ of squares about the mean of the part that the inner rate meets, by its first sample
    frequency : of a reference that is a sinusoid, Hz; NaN: it is none
    note   : why no delay can be fitted; "" where it can
    """

    reference: np.ndarray
    rate_hz: float
    cuts: list[tuple[int, int]]
    margin: int
    swing: float = math.nan
    runs: list[slice] = field(default_factory=list)
    centre: float = math.nan
    slopes: np.ndarray = field(default_factory=lambda: np.empty(0))
    spread: np.ndarray = field(default_factory=lambda: np.empty(0))
    frequency: float = math.nan
    note: str = ""

    @classmethod
    def of(cls, reference: np.ndarray, rate_hz: float, cuts: list[tuple[int, int]], most_delay_s: float) -> Truth:
        """most_delay_s : largest delay that will be asked for, s"""
        margin = max(round(most_delay_s * rate_hz), 1)
        if reference.size < 2:
            return cls(reference, rate_hz, cuts, margin, note="fewer than 2 samples with a reference")
        swing = float(np.std(reference))
        if swing <= STILL * max(float(reference.max()), -float(reference.min()), 1.0):
            note = "the reference does not change: no delay, gain or amplitude"
            return cls(reference, rate_hz, cuts, margin, swing, note=note)
        runs = [slice(start, stop) for start, stop in cuts if stop - start > 4 * margin]
        if not runs:
            note = f"no gap-free stretch is longer than {4 * most_delay_s:g} s"
            return cls(reference, rate_hz, cuts, margin, swing, note=note)
        slopes = np.zeros(reference.size)
        for run in runs:
            slopes[run] = spline_slopes(reference[run])
        centre = float(np.mean(reference[runs[0]]))
        spread = _spread(reference, runs, margin, centre)
        longest = max(runs, key=lambda run: run.stop - run.start)
        frequency = sinusoid_frequency(reference[longest], rate_hz)
        return cls(reference, rate_hz, cuts, margin, swing, runs, centre, slopes, spread, frequency)

    @property
    def most_lag(self) -> int:
        """Samples that a series may lag or lead: of a sinusoid half a period, beyond which it begins again."""
        return self.margin if math.isnan(self.frequency) else min(self.margin, int(self.rate_hz / 2 / self.frequency))

    def inner(self) -> list[tuple[int, int]]:
        """Where the runs without their margins lie, in the series of inner samples alone."""
        ends = np.cumsum([0, *(run.stop - run.start - 2 * self.margin for run in self.runs)]).tolist()
        return list(itertools.pairwise(ends))

    def parts(self) -> Iterator[tuple[slice, int, int]]:
        """Run, first and last + 1 sample of it, of pieces that make up all inner samples."""
        for run in self.runs:
            stop = run.stop - run.start - self.margin
            for first in range(self.margin, stop, PART):
                yield run, first, min(first + PART, stop)

    def moved(self, run: slice, first: int, last: int, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """The reference `delay` s earlier, deg/s, and its derivative, deg/s², at samples first … last - 1 of a run."""
        whole = min(math.floor(-delay * self.rate_hz), self.margin - 1)
        u = -delay * self.rate_hz - whole
        left = slice(run.start + first + whole, run.start + last + whole)
        right = slice(left.start + 1, left.stop + 1)
        # Hermite's form: the values and the slopes at both ends.
        value, rise = self.reference[left], self.reference[right] - self.reference[left]
        slope, end = self.slopes[left], self.slopes[right]
        square, cube = 3 * rise - 2 * slope - end, slope + end - 2 * rise
        moved = value + u * (slope + u * (square + u * cube))
        return moved, self.rate_hz * (slope + u * (2 * square + 3 * u * cube))


def known_stretches(known: np.ndarray, segment: np.ndarray | None) -> list[tuple[int, int]]:
    """Stretches without a gap among the samples where `known` [T]: first and last + 1, counted in these alone."""
    found = runs(known) if segment is None else runs(known, segment)
    lengths = [stop - start for start, stop in found.tolist() if known[start]]
    return list(itertools.pairwise(np.cumsum([0, *lengths]).tolist()))


def sinusoid_frequency(values: np.ndarray, rate_hz: float) -> float:
    """Frequency of a gap-free series [T] that is a sinusoid about a constant, Hz; NaN if it is none.

    The peak of the spectrum, refined by Gauss-Newton steps on offset + a·cos + b·sin of MOST_SAMPLES at most.
    """
    from scipy.fft import next_fast_len, rfft

    values = values[:MOST_SAMPLES] - values[:MOST_SAMPLES].mean()
    size = next_fast_len(2 * len(values), real=True)
    peak = int(np.argmax(np.abs(rfft(values * np.hanning(len(values)), size))))
    # Counted from the middle, the frequency is found apart from the phase.
    time = np.arange(len(values)) - (len(values) - 1) / 2
    angular, left = 2 * math.pi * peak / size, values
    for _ in range(STEPS):
        cosine, sine = np.cos(angular * time), np.sin(angular * time)
        rows = np.stack([np.ones(len(values)), cosine, sine])
        size_of = np.linalg.lstsq(rows @ rows.T, rows @ values, rcond=None)[0]
        left = values - size_of @ rows
        slope = time * (size_of[2] * cosine - size_of[1] * sine)
        steepness = float(slope @ slope)
        angular += float(slope @ left) / steepness if steepness > 0 else 0.0
    frequency = angular * rate_hz / (2 * math.pi)
    periods = len(values) / rate_hz * frequency
    pure = float(left @ left) <= (1 - SINUSOID) * float(values @ values)
    return frequency if pure and periods >= FEWEST_PERIODS else math.nan


def spline_slopes(values: np.ndarray) -> np.ndarray:
    """Derivative [T] at the samples of the cubic spline through values [T], T >= 5; not-a-knot ends, a piece at a time.

    s[k-1] + 4 s[k] + s[k+1] = 3 (y[k+1] - y[k-1]), de Boor (1978), ch. IV.
    """
    from scipy.linalg import solve_banded

    slopes = np.empty(values.size)
    for first in range(0, values.size, PART):
        start, stop = max(first - FORGOTTEN, 0), min(first + PART + FORGOTTEN, values.size)
        rise = np.diff(values[start:stop])
        band, right = np.ones((3, stop - start)), np.empty(stop - start)
        band[1, 1:-1] = 4.0
        band[0, 1] = band[2, -2] = 2.0
        right[1:-1] = 3 * (rise[1:] + rise[:-1])
        right[0], right[-1] = (5 * rise[0] + rise[1]) / 2, (5 * rise[-1] + rise[-2]) / 2
        slopes[first : first + PART] = solve_banded((1, 1), band, right)[first - start : first - start + PART]
    return slopes


def _spread(reference: np.ndarray, runs: list[slice], margin: int, centre: float) -> np.ndarray:
    sums, squares, count = np.zeros(2 * margin + 1), np.zeros(2 * margin + 1), 0
    for run in runs:
        moving = reference[run] - centre
        for total, values in ((sums, moving), (squares, moving * moving)):
            head, tail = values[: 2 * margin], values[-2 * margin :]
            total += values.sum() - np.append(0.0, np.cumsum(head)) - np.append(np.cumsum(tail[::-1])[::-1], 0.0)
        count += moving.size - 2 * margin
    return np.maximum(squares - sums**2 / count, np.finfo(float).tiny)

"""One stream laid over another: time shift and drift by which they differ least."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vgyro.alignment.blocks import SHORTEST_S, SampleBlocks, independent_values, score_covariance
from vgyro.alignment.interpolation import interpolate
from vgyro.alignment.streams import Band
from vgyro.arrays import Bools, Floats
from vgyro.units import Quantity

MOST_STEPS = 15
SMALL_STEP = 0.01  # of a standard error: the search has ended
NOT_SETTLED = 3.0  # standard errors: it has not, after the last step
FEWEST_POINTS = 16
QUIET_QUANTILE = 0.1
STANDS_OUT = 2.0  # power of a block in motion over that of the quiet ones
AGREED = 0.5  # correlation of two streams in which the motion has the power of the noise


class ClockRelation(NamedTuple):
    """Readings of the other clock: reading = t + lag_s + drift · (t - centre_s), t on the reference's clock."""

    centre_s: float
    lag_s: float
    drift: float

    def at(self, time: Quantity) -> Quantity:
        """Readings of the other clock at times of the reference's, s: a float or [M]."""
        return time + self.lag_s + self.drift * (time - self.centre_s)

    def about(self, centre_s: float) -> ClockRelation:
        """The same line with another centre."""
        return ClockRelation(centre_s, self.lag_s + self.drift * (centre_s - self.centre_s), self.drift)


class PairFit(NamedTuple):
    """A line and how well the streams agree on it.

    line        : about the centre of the information, where lag and drift are nearly independent
    covariance  : [2, 2] of (lag s, drift); drift infinite if it was not fitted
    correlation : of the two, slow drift removed
    scale       : the other's scale factor over the reference's
    seconds     : time that was compared
    independent : pairs of independent values that this is worth
    reach       : one standard deviation of the information to each side of the centre, s
    cutoff_hz   : band of the fit
    """

    line: ClockRelation
    covariance: np.ndarray
    correlation: float
    scale: float
    seconds: float
    independent: float
    reach: tuple[float, float]
    cutoff_hz: float


class _Overlap(NamedTuple):
    blocks: SampleBlocks
    time: np.ndarray
    columns: np.ndarray  # reference, its derivative, other, its derivative: [4, K], detrended
    raw: np.ndarray


def fit_line(
    reference: Band, other: Band, rows: np.ndarray, number: np.ndarray, start: ClockRelation, drift: bool = True
) -> PairFit | None:
    """Least residual of other(line(t)) - scale · reference(t), with a level and a slope for each block.

    rows   : int [K], samples of the reference to use; number : int [K], their blocks
    drift  : false: keep the drift of `start`
    returns: None if there is too little overlap, no information, or the search runs away
    Gauss-Newton. The slope along which the residual is read is the mean of both derivatives, and the information is
    the product of the two: their noise, being independent, adds nothing to it, and being stationary it is orthogonal
    to the residual (noise and its derivative are uncorrelated). So noise in both series biases neither the estimate
    nor its standard error.
    """
    line, farthest = start, 0.5 / reference.cutoff_hz
    overlap: _Overlap | None = None
    for _ in range(MOST_STEPS):
        overlap = _overlap(reference, other, rows, number, line)
        if overlap is None:
            return None
        one, one_slope, two, two_slope = overlap.columns
        sign = math.copysign(1.0, float(one @ two))
        scale = sign * math.sqrt(float(two @ two) / float(one @ one))
        information = scale * one_slope * two_slope
        if not information.sum() > 0:
            return None
        line = line.about(float(np.clip((information @ overlap.time) / information.sum(), *overlap.time[[0, -1]])))
        lever = overlap.time - line.centre_s
        bread = _bread(overlap, lever, scale)
        slopes = 0.5 * (two_slope + scale * one_slope) * np.stack([np.ones_like(lever), lever])
        used = 2 if drift else 1
        bread, slopes = bread[:used, :used], slopes[:used]
        if np.linalg.det(bread) <= 0 or bread[-1, -1] <= 0:
            return None
        residual = two - scale * one
        inverse = np.linalg.inv(bread)
        step = -inverse @ (slopes @ residual)
        error = np.sqrt(np.diag(inverse) * float(residual @ residual) / len(residual))
        step *= min(1.0, farthest / max(abs(step[0]), 1e-30))
        line = ClockRelation(line.centre_s, line.lag_s + step[0], line.drift + (step[1] if drift else 0.0))
        if abs(line.lag_s - start.about(line.centre_s).lag_s) > 4 * farthest:
            return None
        if (np.abs(step) < SMALL_STEP * error).all():
            break
    if overlap is None or (np.abs(step) > NOT_SETTLED * error).any():
        return None
    covariance = np.zeros((2, 2))
    covariance[1, 1] = np.inf
    covariance[:used, :used] = inverse @ score_covariance(overlap.blocks, slopes, residual) @ inverse.T
    correlation = float(one @ two) / math.sqrt(float(one @ one) * float(two @ two))
    seconds = len(lever) * reference.step_s
    worth = independent_values(overlap.blocks, one, two)
    width = math.sqrt(max(float(information @ lever**2) / float(information.sum()), 0.0))
    reach = (line.centre_s - width, line.centre_s + width)
    return PairFit(line, covariance, correlation, scale, seconds, worth, reach, reference.cutoff_hz)


def agreement(
    reference: Band, other: Band, rows: np.ndarray, number: np.ndarray, lines: list[ClockRelation]
) -> np.ndarray:
    """Correlation of the two, without its sign, for each line: [n].

    Read along straight lines between samples, which is near enough to choose.
    """
    time = reference.time[rows]
    known = np.concatenate((np.diff(other.segment) == 0, [False]))
    result = np.zeros(len(lines))
    for k, line in enumerate(lines):
        at = line.at(time)
        before = np.searchsorted(other.time, at, side="right") - 1
        good = (before >= 0) & known[before]
        if np.count_nonzero(good) < FEWEST_POINTS:
            continue
        blocks = SampleBlocks(rows[good], number[good], reference.step_s)
        one, two = blocks.detrended(np.stack([reference.rate[rows[good]], np.interp(at[good], other.time, other.rate)]))
        result[k] = abs(one @ two) / max(math.sqrt(float(one @ one) * float(two @ two)), 1e-300)
    return result


def _bread(overlap: _Overlap, lever: Floats, scale: float) -> Floats:
    """Information about (lag, drift) from the product of both derivatives, [2, 2]."""
    weights = np.stack([np.ones_like(lever), lever])
    left = overlap.blocks.detrended(scale * overlap.raw[1] * weights)
    right = overlap.blocks.detrended(overlap.raw[3] * weights)
    product = left @ right.T
    return 0.5 * (product + product.T)


def _overlap(
    reference: Band, other: Band, rows: np.ndarray, number: np.ndarray, line: ClockRelation
) -> _Overlap | None:
    time = reference.time[rows]
    places = np.interp(line.at(time), other.time, np.arange(len(other.time), dtype=float), left=np.nan, right=np.nan)
    two, slope = rate_and_slope(other, places)
    good = np.isfinite(two)
    size = np.bincount(number, good)
    good &= size[number] * reference.step_s >= SHORTEST_S
    if np.count_nonzero(good) < FEWEST_POINTS:
        return None
    kept = rows[good]
    blocks = SampleBlocks(kept, number[good], reference.step_s)
    raw = np.stack([reference.rate[kept], reference.derivative[kept], two[good], slope[good]])
    columns = blocks.detrended(raw)
    moving = _moving(blocks, columns)[blocks.block]
    if not moving.all():
        blocks, raw, columns = (
            SampleBlocks(kept[moving], blocks.block[moving], reference.step_s),
            raw[:, moving],
            columns[:, moving],
        )
    if not (columns**2).sum(axis=1).all():
        return None
    return _Overlap(blocks, time[good][moving], columns, raw)


def rate_and_slope(band: Band, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rate and derivative of a band at positions in its samples; as one complex series, for half the time."""
    both = interpolate(band.rate + 1j * band.derivative, places, band.segment)
    return both.real, both.imag


def _moving(blocks: SampleBlocks, columns: Floats) -> Bools:
    """Blocks in which one of the two moves: [B]; all, if the others agree too, or if none stands out.

    The noise of a block at rest is far from the centre of the information and would count there as information about
    the drift.
    """
    power = blocks.sums((columns[[1, 3]] / columns[[1, 3]].std(axis=1, keepdims=True)) ** 2).sum(axis=0) / blocks.size
    moving = power > STANDS_OUT * np.quantile(power, QUIET_QUANTILE, method="lower")
    if not moving.any():
        still: Bools = ~moving
        return still
    quiet = columns[:, ~moving[blocks.block]]
    agreed = abs(quiet[1] @ quiet[3]) / math.sqrt(max(float(quiet[1] @ quiet[1]) * float(quiet[3] @ quiet[3]), 1e-300))
    moves: Bools = moving | (agreed > AGREED)
    return moves

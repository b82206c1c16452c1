"""One stream laid over another: time shift and drift by which they differ least."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vgyro.alignment.blocks import SHORTEST_S, Blocks, independent_values, score_covariance
from vgyro.alignment.interpolation import interpolate
from vgyro.alignment.streams import Band

MOST_STEPS = 15
SMALL_STEP = 0.01  # of a standard error: the search has ended
FEWEST_POINTS = 16


class Line(NamedTuple):
    """Readings of the other clock: reading = t + lag_s + drift · (t - centre_s), t on the reference's clock."""

    centre_s: float
    lag_s: float
    drift: float

    def at(self, time: np.ndarray) -> np.ndarray:
        """Readings of the other clock at times of the reference's, [M] s."""
        return time + self.lag_s + self.drift * (time - self.centre_s)

    def about(self, centre_s: float) -> Line:
        """The same line with another centre."""
        return Line(centre_s, self.lag_s + self.drift * (centre_s - self.centre_s), self.drift)


class PairFit(NamedTuple):
    """A line and how well the streams agree on it.

    line        : about the centre of the information, where lag and drift are nearly independent
    covariance  : [2, 2] of (lag s, drift); drift infinite if it was not fitted
    correlation : of the two, slow drift removed
    scale       : the other's scale factor over the reference's
    seconds     : time that was compared
    independent : pairs of independent values that this is worth
    """

    line: Line
    covariance: np.ndarray
    correlation: float
    scale: float
    seconds: float
    independent: float


class _Overlap(NamedTuple):
    blocks: Blocks
    time: np.ndarray
    columns: np.ndarray  # reference, its derivative, other, its derivative: [4, K], detrended
    raw: np.ndarray


def fit_line(
    reference: Band, other: Band, rows: np.ndarray, number: np.ndarray, start: Line, drift: bool = True
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
        line = Line(line.centre_s, line.lag_s + step[0], line.drift + (step[1] if drift else 0.0))
        if abs(line.lag_s - start.about(line.centre_s).lag_s) > 4 * farthest:
            return None
        if (np.abs(step) < SMALL_STEP * error).all():
            break
    covariance = np.full((2, 2), 0.0)
    covariance[1, 1] = np.inf
    covariance[:used, :used] = inverse @ score_covariance(overlap.blocks, slopes, residual) @ inverse.T
    correlation = float(one @ two) / math.sqrt(float(one @ one) * float(two @ two))
    seconds = len(lever) * reference.step_s
    return PairFit(line, covariance, correlation, scale, seconds, independent_values(overlap.blocks, one, two))


def _bread(overlap: _Overlap, lever: np.ndarray, scale: float) -> np.ndarray:
    """Information about (lag, drift) from the product of both derivatives, [2, 2]."""
    weights = np.stack([np.ones_like(lever), lever])
    left = overlap.blocks.detrended(scale * overlap.raw[1] * weights)
    right = overlap.blocks.detrended(overlap.raw[3] * weights)
    product = left @ right.T
    return 0.5 * (product + product.T)


def _overlap(reference: Band, other: Band, rows: np.ndarray, number: np.ndarray, line: Line) -> _Overlap | None:
    time = reference.time[rows]
    places = np.interp(line.at(time), other.time, np.arange(len(other.time), dtype=float), left=np.nan, right=np.nan)
    two = interpolate(other.rate, places, other.segment)
    slope = interpolate(other.derivative, places, other.segment)
    good = np.isfinite(two) & np.isfinite(slope)
    size = np.bincount(number, good)
    good &= size[number] * reference.step_s >= SHORTEST_S
    if np.count_nonzero(good) < FEWEST_POINTS:
        return None
    kept = rows[good]
    blocks = Blocks(kept, number[good], reference.step_s)
    raw = np.stack([reference.rate[kept], reference.derivative[kept], two[good], slope[good]])
    columns = blocks.detrended(raw)
    if not (columns**2).sum(axis=1).all():
        return None
    return _Overlap(blocks, time[good], columns, raw)

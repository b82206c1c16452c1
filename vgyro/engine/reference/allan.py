"""Allan variances, their degrees of freedom and limits, by allantools; losses, and kinds of noise, in NumPy.

allantools works on one gap-free series at a time; the sums of several are added here.
"""

from __future__ import annotations

import itertools

import allantools
import numpy as np
from scipy.stats import chi2

from vgyro.engine.models import LossyDifferences

ESTIMATORS = {"overlapping": allantools.oadev, "modified": allantools.mdev, "hadamard": allantools.ohdev}
REACH = {"overlapping": 2, "modified": 3, "hadamard": 3}
D = {"overlapping": 2, "modified": 2, "hadamard": 3}
STEEPEST = {"overlapping": -2, "modified": -2, "hadamard": -4}  # noise for which the variance exists
FLATTEST = 2  # white noise of the angle
NOT_IN_ALLANTOOLS = (1.302, 0.535)  # its table 2 of the paper lacks the last row: d = 3, random walk of random walk
PRESENT = 0.9
DENSE = 64


def differences(
    rate: np.ndarray,
    factors: np.ndarray,
    edges: np.ndarray | None = None,
    share: int = 2,
    kind: str = "overlapping",
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.noise.AllanEngine.differences, by allantools."""
    sums, counts = np.zeros(len(factors)), np.zeros(len(factors), dtype=np.int64)
    # Of a modified variance a stretch of 3m samples has two differences.
    spare = 0 if kind == "modified" else 1
    for piece in _stretches(rate, edges):
        # allantools leaves out a τ with a single difference.
        possible = np.flatnonzero((REACH[kind] * factors + spare <= piece.size) & (share * factors <= piece.size))
        if possible.size:
            angle = np.concatenate(([0.0], np.cumsum(piece - piece.mean())))
            _, deviation, _, number = ESTIMATORS[kind](angle, 1.0, "phase", factors[possible].astype(float))
            counts[possible] += number.astype(np.int64)
            sums[possible] += deviation**2 * number
    return sums, counts


def slot_sums(rate: np.ndarray, slot: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.noise.AllanEngine.slot_sums, in NumPy."""
    totals, haves = [], []
    for start, stop in itertools.pairwise(edges.tolist()):
        inside = (slot >= start) & (slot < stop)
        there, filled = np.zeros(stop - start + 1, dtype=np.int32), np.zeros(stop - start + 1)
        there[slot[inside] - start + 1] = 1
        filled[slot[inside] - start + 1] = rate[inside] - (rate[inside].mean() if inside.any() else 0.0)
        totals.append(np.cumsum(filled))
        haves.append(np.cumsum(there, dtype=np.int32))
    return np.concatenate([np.empty(0), *totals]), np.concatenate([np.empty(0, np.int32), *haves])


def differences_over_losses(
    total: np.ndarray,
    have: np.ndarray,
    edges: np.ndarray,
    factors: np.ndarray,
    share: int = 3,
    kind: str = "overlapping",
) -> LossyDifferences:
    """As vgyro.engine.protocols.noise.AllanEngine.differences_over_losses, in NumPy.

    allantools would take a mean of any number of samples, or one that bridges any gap.
    """
    found = np.zeros((4, len(factors)))
    for stretch, (start, stop) in enumerate(itertools.pairwise(edges.tolist())):
        borders = slice(start + stretch, stop + stretch + 1)
        for row, m in enumerate(factors.tolist()):
            if share * m <= stop - start and REACH[kind] * m <= stop - start:
                found[:, row] += _one_stretch(total[borders], have[borders], m, kind)
    return LossyDifferences(found[0], found[1], found[2].astype(np.int64), found[3].astype(np.int64))


def _one_stretch(total: np.ndarray, have: np.ndarray, m: int, kind: str) -> np.ndarray:
    """sums, excess, counts, possible of one stretch."""
    stride = max(m // DENSE, 1)
    number = have[m:] - have[:-m]
    good = number >= PRESENT * m - 1e-9
    inverse = np.where(good, 1.0 / np.where(good, number, 1), 0.0)
    mean = (total[m:] - total[:-m]) * inverse
    weights = (1.0, -2.0, 1.0) if kind == "hadamard" else (-1.0, 1.0)
    starts = len(mean) - (len(weights) - 1) * m
    shifted = [slice(part * m, part * m + starts, stride) for part in range(len(weights))]
    d = np.add.reduce([weight * mean[at] for weight, at in zip(weights, shifted, strict=True)])
    e = np.add.reduce([weight**2 * (inverse[at] - 1 / m) for weight, at in zip(weights, shifted, strict=True)])
    valid = np.logical_and.reduce([good[at] for at in shifted])
    norm = sum(weight**2 for weight in weights)
    if kind == "modified":
        window = m // stride
        d, e, count = (np.convolve(np.where(valid, part, 0.0), np.ones(window), "valid") for part in (d, e, valid))
        valid = count >= PRESENT * window - 1e-9
        d, e = d / np.maximum(count, 1), e / np.maximum(count, 1) * (m**2 + 1) / (2 * m**2)
    return np.array([np.sum(d[valid] ** 2) / norm, np.sum(e[valid]) / norm, valid.sum(), valid.size])


def lag_products(
    rate: np.ndarray, factors: np.ndarray, edges: np.ndarray | None = None, fewest: int = 4
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.noise.AllanEngine.lag_products, in NumPy."""
    squares, products = np.zeros((len(factors), 3)), np.zeros((len(factors), 3))
    for piece in _stretches(rate, edges):
        for row, factor in enumerate(factors):
            number = piece.size // factor
            if number < fewest:
                continue
            series = piece[: number * factor].reshape(number, factor).mean(axis=1)
            position = np.arange(number) - (number - 1) / 2
            series = series - series.mean()
            series -= position * float(position @ series) / float(position @ position)
            for order in range(3):
                series = series - series.mean()
                squares[row, order] += series @ series
                products[row, order] += series[1:] @ series[:-1]
                series = np.diff(series)
    return squares, products


def _stretches(rate: np.ndarray, edges: np.ndarray | None) -> list[np.ndarray]:
    rate = np.asarray(rate, dtype=float)
    return [rate] if edges is None else [rate[start:stop] for start, stop in itertools.pairwise(edges.tolist())]


def degrees_of_freedom(alpha: int, factor: int, samples: np.ndarray | int, kind: str = "overlapping") -> np.ndarray:
    """As vgyro.engine.protocols.noise.AllanEngine.degrees_of_freedom, by allantools."""
    d, modified = D[kind], kind == "modified"
    alpha = min(max(alpha, STEEPEST[kind]), FLATTEST)
    edf = []
    for number in np.ravel(samples).tolist():
        count = number + 1 - d * factor
        # The published formula for white noise of the angle ends at 4m, for d = 3 at 6m.
        known = 1 if alpha == FLATTEST and not modified and np.ceil(count / factor) <= d else alpha
        if known == STEEPEST["hadamard"] and min(count, 4 * factor) > 100 and count > 4 * factor:
            a0, a1 = NOT_IN_ALLANTOOLS
            edf.append(count / factor / (a0 - a1 * factor / count))
        else:
            found = allantools.edf_greenhall(known, d, int(factor), number + 1, overlapping=True, modified=modified)
            edf.append(float(found))
    return np.array(edf).reshape(np.shape(samples))


def limits(deviation: np.ndarray, edf: np.ndarray, confidence: float) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.noise.AllanEngine.limits."""
    tail = (1 - confidence) / 2
    return deviation * np.sqrt(edf / chi2.ppf(1 - tail, edf)), deviation * np.sqrt(edf / chi2.ppf(tail, edf))

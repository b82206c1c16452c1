"""From the piece of a recording in which two streams were matched to all of it, twice as far at a time."""

from __future__ import annotations

import math

import numpy as np

from vgyro.alignment.blocks import block_numbers
from vgyro.alignment.coarse import SMEAR_S, LineCandidate
from vgyro.alignment.pair import ClockRelation, PairFit, agreement, fit_line
from vgyro.alignment.streams import Band

MOST_BLOCKS = 300
FEWER_BLOCKS = 60  # while candidates are compared
FEWEST_BLOCKS = 30  # while drifts are tried
PERIODS = 30  # parts of the recording from each of which the blocks that move most are taken
RIVAL_ODDS = 20.0  # twice the log likelihood ratio below which two lines cannot be told apart
ALLOWANCE = 0.1  # of the unexplained power, by which overlaps of different length differ anyway
KEPT_ODDS = 100.0
MOST_KEPT = 5
MOST_STARTS = 3  # drifts that are followed when a longer part begins
REACH = 3.0  # standard errors of the drift that are searched
NEAR_S = 0.02  # lines that differ by less, everywhere, are one


def grow(reference: Band, other: Band, candidates: list[LineCandidate], most_drift: float) -> list[PairFit]:
    """Fits over all of the recording, from candidates found in pieces of it; the likely ones, best first.

    The piece in which the streams agree most is the seed. It tells the drift too badly to know where the next motion,
    far off, falls: at each step the drifts within three standard errors are tried by correlation, and the three best
    peaks are fitted.
    """
    pieces = []
    for start, stop in sorted({(c.start_s, c.stop_s) for c in candidates}):
        lines = [c.line for c in candidates if (c.start_s, c.stop_s) == (start, stop)]
        fits = likely([fit_window(reference, other, line, most_drift, (start, stop)) for line in lines])
        if fits:
            pieces.append((fits, (start + stop) / 2, (stop - start) / 2))
    if not pieces:
        return []
    fits, middle, reach = max(pieces, key=lambda piece: score(piece[0][0]))
    whole = max(middle - reference.time[0], reference.time[-1] - middle)
    while reach < whole and fits:
        reach *= 2
        window = (middle - reach, middle + reach)
        lines = [line for fit in fits for line in _starts(reference, other, fit, most_drift, window)]
        fits = likely([fit_window(reference, other, line, most_drift, window) for line in lines])
    return fits


def likely(fits: list[PairFit | None]) -> list[PairFit]:
    """Fits that the best does not rule out, each once, the best first."""
    kept: list[PairFit] = []
    for fit in sorted((fit for fit in fits if fit is not None), key=score, reverse=True):
        if all(apart(fit, better) > NEAR_S for better in kept) and (not kept or odds(kept[0], fit) < KEPT_ODDS):
            kept.append(fit)
    return kept[:MOST_KEPT]


def fit_window(
    reference: Band,
    other: Band,
    line: ClockRelation,
    most_drift: float,
    window: tuple[float, float],
    most_blocks: int = FEWER_BLOCKS,
) -> PairFit | None:
    """The fit in a window; the drift stays as it is where the motion cannot tell it from any other."""
    rows, number = _chosen(reference, window, most_blocks)
    if not len(rows):
        return None
    fit = fit_line(reference, other, rows, number, line)
    if fit is not None and 2 * math.sqrt(fit.covariance[1, 1]) < most_drift and abs(fit.line.drift) < 1.5 * most_drift:
        return fit
    return fit_line(reference, other, rows, number, line, drift=False)


def _starts(
    reference: Band, other: Band, fit: PairFit, most_drift: float, window: tuple[float, float]
) -> list[ClockRelation]:
    """Lines with the drifts that agree best over a longer window."""
    line, error = fit.line, math.sqrt(fit.covariance[1, 1])
    spread = min(REACH * error, most_drift)
    far = max(reference.time[-1] - line.centre_s, line.centre_s - reference.time[0])
    far = min(far, max(window[1] - line.centre_s, line.centre_s - window[0]))
    count = math.ceil(spread * far / SMEAR_S)
    if count <= 1:
        return [line]
    rows, number = _chosen(reference, window, FEWEST_BLOCKS)
    lines = [line._replace(drift=line.drift + spread * k / count) for k in range(-count, count + 1)]
    agreed = np.pad(agreement(reference, other, rows, number, lines), 1)
    peaks = np.flatnonzero((agreed[1:-1] >= agreed[:-2]) & (agreed[1:-1] >= agreed[2:]))
    return [lines[k] for k in peaks[np.argsort(-agreed[peaks + 1])[:MOST_STARTS]]]


def _chosen(reference: Band, window: tuple[float, float], most_blocks: int) -> tuple[np.ndarray, np.ndarray]:
    """Samples in a window and their blocks; at most most_blocks, those of the steepest rates in each part."""
    rows = np.flatnonzero((reference.time >= window[0]) & (reference.time <= window[1]))
    number = block_numbers(reference.time[rows], reference.segment[rows])
    count = int(number[-1]) + 1 if len(number) else 0
    if count <= most_blocks:
        return rows, number
    power = np.bincount(number, reference.derivative[rows] ** 2, minlength=count)
    part = np.arange(count) * PERIODS // count
    order = np.lexsort((-power, part))
    rank = np.empty(count, dtype=np.int64)
    rank[order] = np.arange(count) - np.searchsorted(part[order], part[order])
    kept = (rank < most_blocks // PERIODS)[number]
    return rows[kept], number[kept]


def unexplained(fit: PairFit) -> float:
    """Share of the power that the other stream does not explain."""
    return max(1 - fit.correlation**2, 1e-12)


def score(fit: PairFit) -> float:
    """Log likelihood against nothing in common, but for a factor."""
    return -fit.seconds * math.log(unexplained(fit))


def odds(best: PairFit, fit: PairFit) -> float:
    """Twice the log likelihood ratio of one line over another, on the time that both compare, less the allowance."""
    ratio = math.log(unexplained(fit) / unexplained(best)) - ALLOWANCE
    return 2 * best.cutoff_hz * min(fit.seconds, best.seconds) * ratio


def apart(one: PairFit, two: PairFit) -> float:
    """The most by which two lines differ over the motion that they rest on, s."""
    gaps = []
    for fit in (one, two):
        first, last = fit.reach
        gaps += [abs(one.line.at(t) - two.line.at(t)) for t in (first, last)]
    return max(gaps)


def offset(line: ClockRelation) -> float:
    """Time of the reference at which the other clock reads 0."""
    return (line.drift * line.centre_s - line.lag_s) / (1 + line.drift)

"""Constant variances from differences between gyros: N-cornered hat, and the likelihood of the parity space.

Model: y = 1·w + n, w unknown and of any size, n of covariance R = σσ'∘C. The differences have no w in them. With the
minimum-variance weights u = R⁻¹1/(1'R⁻¹1) and r = u'Ru = 1/(1'R⁻¹1) the residual e = y - 1·u'y has the covariance
R - r·11': so e_i² + r is without bias for σ_i² where u is that of R. For C = I repeating this is the EM algorithm
(Dempster, Laird & Rubin 1977, J. R. Stat. Soc. B 39, 1-38) with w as what is missing: it climbs the likelihood of the
parity space, and no variance becomes negative.
A common term of all gyros, R + c·11', is in no difference: only the part of C orthogonal to it can be seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Bools, Floats
from vgyro.fusion.noise.difference_blocks import BlockMoments

ROUNDS = 200
CONVERGED = 1e-7
LEAST_SHARE = 1e-3
"""Least variance, as a share of the median over the gyros."""
START_SHARE = 0.02
FAR = 16.0
FAR_FROM_MEAN = 25.0
"""A block whose square is so many times the largest of the eight blocks about it, and the mean, is an outlier."""
NEIGHBOURS = 4


def cornered_hat(pairs: np.ndarray) -> np.ndarray:
    """Variances [N] of N uncorrelated gyros from the variances of their differences; without bias where none is < 0.

    pairs   : [N, N] variance of y_i - y_j in any unit; NaN where there is none
    returns : [N] least-squares solution of σ_i² + σ_j² = pairs_ij, not negative (NNLS); two gyros: equal shares
    Gray & Allan (1974), Proc. 28th Annu. Symp. on Frequency Control, 243-246 (three corners). For N = 3:
    σ_1² = (p_12 + p_13 - p_23)/2.
    """
    from scipy.optimize import nnls

    gyros = len(pairs)
    if gyros == 2:
        return np.full(2, pairs[0, 1] / 2.0)
    first, second = np.triu_indices(gyros, 1)
    known = np.isfinite(pairs[first, second])
    first, second = first[known], second[known]
    design = np.zeros((len(first), gyros))
    design[np.arange(len(first)), first] = 1.0
    design[np.arange(len(first)), second] = 1.0
    scale = float(np.mean(pairs[first, second])) or 1.0
    return scale * np.asarray(nnls(design, pairs[first, second] / scale)[0])


def pair_variances(square: Floats) -> Floats:
    """Mean squares [..., N, N] of the differences y_i - y_j from second moments `square` [..., N, N] of y."""
    own = np.einsum("...ii->...i", square)
    variances: Floats = own[..., :, None] + own[..., None, :] - 2.0 * square
    return variances


@dataclass(frozen=True)
class BestWeights:
    """The best linear estimate of the rate: weights [M, N], Σ = 1, of either sign, and its variance r [M], (deg/s)²."""

    weights: np.ndarray
    variance: np.ndarray


def best_weights(variance: np.ndarray, excluded: np.ndarray, correlation: np.ndarray) -> BestWeights:
    """u = R⁻¹1/(1'R⁻¹1) and r = 1/(1'R⁻¹1) of the gyros that are not excluded, R = σσ'∘C.

    variance [M, N] (deg/s)²; excluded [M, N], whose weights are 0; correlation [N, N]. All excluded: as if none were.
    """
    weights, total = np.zeros_like(variance), np.empty(len(variance))
    sigma = np.sqrt(variance)
    for pattern, rows in patterns(excluded):
        kept = np.flatnonzero(~pattern)
        inverse = 1.0 / sigma[np.ix_(rows, kept)]
        share = inverse * (inverse @ np.linalg.inv(correlation[np.ix_(kept, kept)]))
        total[rows] = 1.0 / share.sum(axis=1)
        weights[np.ix_(rows, kept)] = share * total[rows, None]
    return BestWeights(weights, total)


def patterns(excluded: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The different rows of excluded [M, N], and the numbers of the blocks that have each; all of a row: none of it."""
    if not excluded.any():
        return [(excluded[0], np.arange(len(excluded)))]
    code = np.packbits(excluded, axis=1)
    _, first, which = np.unique(code, axis=0, return_index=True, return_inverse=True)
    which = which.ravel()
    found = [(excluded[place], np.flatnonzero(which == number)) for number, place in enumerate(first)]
    return [(np.zeros_like(pattern) if pattern.all() else pattern, rows) for pattern, rows in found]


class ConstantVariances(NamedTuple):
    """Variances [N] a sample, (deg/s)², that hold for the whole recording, and the outlying blocks [M, N]."""

    variance: np.ndarray
    outlier: np.ndarray


def constant_variances(moments: BlockMoments, correlation: np.ndarray) -> ConstantVariances:
    """The gyros' variances if they do not change.

    The slow part (drift, bias) is left out, and so are the blocks that are excluded, or where one gyro is an outlier.
    """
    outlier = np.zeros(moments.excluded.shape, dtype=bool)
    variance = _solve(moments, np.ones(len(outlier), dtype=bool), correlation)
    for _ in range(2):
        best = best_weights(np.broadcast_to(variance, outlier.shape), moments.excluded, correlation)
        mean_square = moments.residual(best.weights)[0] + best.variance[:, None]
        outlier = outliers(np.where(moments.excluded, 0.0, mean_square))
        if not outlier.any():
            break
        variance = _solve(moments, np.logical_not(outlier.any(axis=1)), correlation)
    return ConstantVariances(variance, outlier)


def outliers(square: Floats) -> Bools:
    """Which blocks are far above their neighbours on both sides and above the mean of all: [M, N] of bool.

    square : [M, N], (deg/s)², mean square of each gyro in each block; zero where it is not known
    """
    around = np.zeros_like(square)
    for shift in range(1, NEIGHBOURS + 1):
        around[shift:] = np.maximum(around[shift:], square[:-shift])
        around[:-shift] = np.maximum(around[:-shift], square[shift:])
    mean = square.sum(axis=0) / np.maximum((square > 0).sum(axis=0), 1)
    far: Bools = (around > 0) & (square > FAR * around) & (square > FAR_FROM_MEAN * mean)
    return far


def _without_slow(moments: BlockMoments, used: Bools) -> Floats:
    """Second moments [M, N, N] a sample of the differences less their slow part, without bias for constant variances.

    used [M] : the blocks that the slow part is the mean of
    """
    count = np.maximum(moments.window_sum(used.astype(float)), 1.0)[:, None]
    slow = moments.window_sum(np.where(used[:, None], moments.mean, 0.0)) / count
    cross = moments.mean[:, :, None] * slow[:, None, :]
    size = moments.size[:, None, None]
    less = moments.square - size * (cross + cross.transpose(0, 2, 1) - slow[:, :, None] * slow[:, None, :])
    # Of the white noise, one part in `count` of a block's mean went with the slow part.
    return less / np.maximum(size - 1.0 / count[:, :, None], 0.5)


def _solve(moments: BlockMoments, used: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Variances [N] of the greatest likelihood of the parity space, from the N-cornered hat on; blocks `used` [M]."""
    return most_likely(_without_slow(moments, used), moments, used, correlation)


def second_moments(moments: BlockMoments) -> np.ndarray:
    """Second moments [M, N, N] a sample, (deg/s)², of the differences less their slow part."""
    return _without_slow(moments, np.ones(len(moments.start), dtype=bool))


def _totals(
    square: np.ndarray, moments: BlockMoments, used: np.ndarray
) -> tuple[list[np.ndarray], list[float], list[np.ndarray]]:
    """Of each set of good gyros: mean second moments [N, N], samples, and which they are [N]."""
    totals, counts, kept = [], [], []
    for pattern, rows in patterns(moments.excluded):
        mine = rows[used[rows]]
        if len(mine) and (~pattern).sum() > 1:
            size = moments.size[mine].astype(float)
            totals.append(np.einsum("b,bij->ij", size, square[mine]) / size.sum())
            counts.append(float(size.sum()))
            kept.append(~pattern)
    return totals, counts, kept


def _pairs(totals: list[np.ndarray], counts: list[float], kept: list[np.ndarray]) -> np.ndarray:
    """Variances of the differences [N, N]; NaN where two gyros were never good together."""
    share = np.array([np.outer(good, good) * count for good, count in zip(kept, counts, strict=True)])
    with np.errstate(invalid="ignore"):
        found: np.ndarray = (share * pair_variances(np.array(totals))).sum(axis=0) / share.sum(axis=0)
    return found


def scaled_to_pairs(covariance: np.ndarray, moments: BlockMoments, outlier: np.ndarray) -> np.ndarray:
    """Give a covariance, of which only the size is unknown, the size that the differences between the gyros show.

    covariance : [N, N], in any unit;  moments : of the blocks;  outlier : [M, N] of bool, blocks with one are left out
    returns    : [N, N], (deg/s)² a sample, whose differences have the mean variance that was seen
    """
    used = np.logical_not(outlier.any(axis=1))
    pairs = _pairs(*_totals(_without_slow(moments, used), moments, used))
    known = np.isfinite(pairs) & ~np.eye(len(pairs), dtype=bool)
    scaled: np.ndarray = covariance * (pairs[known].sum() / pair_variances(covariance)[known].sum())
    return scaled


def most_likely(square: np.ndarray, moments: BlockMoments, used: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Variances [N] of the greatest likelihood for second moments [M, N, N] a sample of the blocks `used` [M]."""
    totals, counts, kept = _totals(square, moments, used)
    gyros = square.shape[1]
    if not totals:
        return np.ones(gyros)
    pairs = _pairs(totals, counts, kept)
    variance = cornered_hat(pairs)
    seen = np.array(kept).any(axis=0)
    middle = float(np.median(variance[seen])) or float(np.mean(variance[seen])) or 1.0
    # Noise in common is in no difference: they show 1 - ρ of the variance.
    common = (correlation.sum() - gyros) / (gyros * (gyros - 1))
    variance = np.maximum(np.where(seen, variance, middle), START_SHARE * middle) / max(1.0 - common, 0.05)
    return _climb(variance, np.array(totals), np.array(counts), np.array(kept), correlation)


def _climb(
    variance: np.ndarray, square: np.ndarray, count: np.ndarray, kept: np.ndarray, correlation: np.ndarray
) -> np.ndarray:
    """Climb the likelihood; square [P, N, N], count [P], kept [P, N] of P patterns of good gyros.

    σ_i² ← σ_i²·√(mean e_i²/mean(σ_i² - r)) has the fixed points of EM, and is faster where a variance is near zero
    (Zhou, Hu, Qiao & Lange 2019, J. Comput. Graph. Stat. 28, 350-361).
    """
    share = kept * count[:, None]
    for _ in range(ROUNDS):
        best = best_weights(np.broadcast_to(variance, kept.shape), ~kept, correlation)
        cross = np.einsum("pij,pj->pi", square, best.weights)
        residual = np.einsum("pii->pi", square) - 2.0 * cross + np.sum(cross * best.weights, axis=1, keepdims=True)
        seen, expected = ((one * share).sum(axis=0) for one in (residual, variance - best.variance[:, None]))
        known = expected > 0
        found = variance * np.sqrt(np.where(known, seen, 1.0) / np.where(known, expected, 1.0))
        found = np.maximum(found, LEAST_SHARE * np.median(found))
        close = np.allclose(found, variance, rtol=CONVERGED, atol=0.0)
        variance = found
        if close:
            break
    return variance

"""Variances and correlation that change with time, of an array at rest as a whole: from the rates themselves.

There the rate is one constant, and what a gyro shows beside its slow part is its noise, the part that all gyros share
included, which no difference shows: R_t = σσ'∘C_t, σ and C_t from two-sided EWMA over the blocks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Bools, Floats
from vgyro.fusion.noise.cornered_hat import LEAST_SHARE, outliers
from vgyro.fusion.noise.difference_blocks import BlockMoments
from vgyro.fusion.noise.variance_model import (
    FEWEST_BLOCKS,
    TIME_CONSTANTS_S,
    LowPass,
    Memory,
    both_sides,
    chosen_memory,
    effective_share,
)

SCORED = 1 << 15
"""A memory of the correlation is scored at no more blocks than these, evenly spaced."""
FEWEST_SAMPLES = 8
"""Samples per gyro that a correlation must be known from, at least."""
LEAST_EIGENVALUE = 1e-3
"""Correlations are drawn so far toward none: a matrix of a smaller eigenvalue is too near to singular to weight by."""


@dataclass(frozen=True)
class Resting:
    """Noise of an array at rest.

    variance [M, N] : (deg/s)² a sample;  memories [N] : what each is an average over
    correlation [N, N] : the same all the time, or about the mean
    moving [M, N, N] : that of each block; None: the same all the time
    """

    variance: np.ndarray
    memories: list[Memory]
    correlation: np.ndarray
    moving: np.ndarray | None


def resting_noise(
    moments: BlockMoments,
    constant: np.ndarray,
    correlation: np.ndarray,
    block_s: float,
    engine: str = "native",
    together: bool = True,
) -> Resting:
    """Follow variances and correlation of an array at rest.

    moments : of the rates themselves, less one number a gyro (block_moments, own=True)
    constant [N] : (deg/s)², of a gyro of which no block is known;  correlation [N, N] : the constant one
    together : whether the correlation may change
    Time constants are those that predict each block best from the others (see parity_memory); that
    of the correlation by the Gaussian deviance Σ ν·(log|C| + tr C⁻¹Z) of the standardised second moments Z. Beside the
    constant correlation it pays 2·log(Σν), and a mean of this recording log(Σν) for each pair.
    """
    low_pass = engines.get(engine).kalman.low_pass
    known = ~moments.excluded
    square = _less_slow(moments, known)
    own = np.maximum(np.einsum("bii->bi", square), 0.0)
    outlier = outliers(np.where(known, own, 0.0))
    if outlier.any():
        square = _less_slow(moments, known & ~outlier)
        own = np.maximum(np.einsum("bii->bi", square), 0.0)
    good = known & ~outlier
    freedom = np.where(good, moments.size[:, None].astype(float), 0.0)
    columns = list(zip(own.T, freedom.T, strict=True))
    memories = [chosen_memory(*one, block_s, low_pass) for one in columns]
    found = [memory.average(*one, low_pass)[0] for memory, one in zip(memories, columns, strict=True)]
    variance = np.where(known.any(axis=0), np.column_stack(found), constant)
    # An outlier has the variance that it shows, and lends it to no other block.
    least = np.maximum(LEAST_SHARE * float(np.median(constant)), np.where(outlier, own, 0.0))
    variance = np.maximum(variance, least)
    sigma, standard = np.sqrt(variance), square
    standard /= sigma[:, :, None]
    standard /= sigma[:, None, :]
    both = good[:, :, None] & good[:, None, :]
    share = float(np.mean([effective_share(*one) for one in columns if one[1].any()] or [1.0]))
    count = moments.size * share
    correlation = _constant(standard, count, both, correlation)
    np.copyto(standard, correlation, where=~both)
    moving = _moving(standard, count, correlation, block_s, low_pass) if together else None
    return Resting(variance, memories, correlation, moving)


def _less_slow(moments: BlockMoments, used: Bools) -> Floats:
    """Second moments [M, N, N] a sample, (deg/s)², of the rates less their slow part, without bias for white noise.

    The slow part is the mean over the blocks about each that are `used` [M, N].
    """
    share = used * moments.size[:, None]
    mass = moments.window_sum(share)
    slow = np.where(mass > 0, moments.window_sum(share * moments.mean) / np.maximum(mass, 1.0), moments.mean)
    # (m - s)(m - s)' - mm' = ss' - ms' - sm', in place: there is one matrix a block.
    off = moments.mean - slow
    less = moments.square / moments.size[:, None, None]
    less -= moments.mean[:, :, None] * moments.mean[:, None, :]
    less += off[:, :, None] * off[:, None, :]
    kept = np.sqrt(np.maximum(1.0 - 1.0 / np.maximum(mass, 2.0), 0.5))
    less /= kept[:, :, None]
    less /= kept[:, None, :]
    return less


def _constant(standard: np.ndarray, freedom: np.ndarray, both: np.ndarray, given: np.ndarray) -> np.ndarray:
    """The given correlation [N, N], or the mean of this recording, where that pays; both [M, N, N]: pairs to use."""
    rows = both.all(axis=(1, 2))
    total = float(freedom[rows].sum())
    if total < FEWEST_SAMPLES * len(given):
        return given
    mean = np.einsum("b,bij->ij", freedom[rows], standard[rows]) / total
    sigma = np.sqrt(np.maximum(np.diag(mean), np.finfo(float).tiny))
    own = _regular(mean / np.outer(sigma, sigma))
    pairs = len(given) * (len(given) - 1) / 2
    scores = [_deviance(mean[None], np.array([total]), one[None]) for one in (given, own)]
    return own if scores[1] + pairs * math.log(total) < scores[0] else given


def _moving(
    standard: np.ndarray, freedom: np.ndarray, constant: np.ndarray, block_s: float, low_pass: LowPass
) -> np.ndarray | None:
    """Correlation [M, N, N] that predicts best; None: the constant one.

    standard [M, N, N] : second moments of rates over their s.d.;  freedom [M] : independent samples of each block
    """
    gyros, rows = len(constant), slice(None, None, max(1, len(freedom) // SCORED))
    price = 2.0 * math.log(max(float(freedom.sum()), 2.0)) / (rows.step or 1)
    best, least = math.inf, _deviance(standard[rows], freedom[rows], np.broadcast_to(constant, standard[rows].shape))
    for tau in TIME_CONSTANTS_S:
        keep = math.exp(-block_s / tau)
        if tau < FEWEST_BLOCKS * block_s or 2.0 * float(np.median(freedom)) / (1.0 - keep) < FEWEST_SAMPLES * gyros:
            continue
        alone = _regular(_average(standard, freedom, keep, low_pass, rows, alone=True))
        score = _deviance(standard[rows], freedom[rows], alone) + price
        if score < least:
            best, least = tau, score
    if math.isinf(best):
        return None
    return _regular(_average(standard, freedom, math.exp(-block_s / best), low_pass, slice(None), alone=False))


def _average(standard: Floats, freedom: Floats, keep: float, low_pass: LowPass, rows: slice, alone: bool) -> Floats:
    """Two-sided EWMA of the second moments, as correlations, of the blocks `rows`; alone: without the block itself."""
    gyros = standard.shape[1]
    result = np.empty(standard[rows].shape)
    for one in range(gyros):
        for other in range(one + 1):
            total = freedom * standard[:, one, other]
            around = both_sides(total, keep, low_pass)
            result[:, one, other] = result[:, other, one] = (around - total if alone else around)[rows]
    sigma = np.sqrt(np.maximum(np.einsum("bii->bi", result), np.finfo(float).tiny))
    average: Floats = result / (sigma[:, :, None] * sigma[:, None, :])
    return average


def _regular(correlation: np.ndarray) -> np.ndarray:
    """Correlations [..., N, N] whose eigenvalues are LEAST_EIGENVALUE or more; in place."""
    correlation *= 1.0 - LEAST_EIGENVALUE
    each = np.arange(correlation.shape[-1])
    correlation[..., each, each] = 1.0
    return correlation


def _deviance(standard: np.ndarray, freedom: np.ndarray, correlation: np.ndarray) -> float:
    """Σ ν·(log|C| + tr C⁻¹Z); infinite where a C is not positive definite."""
    sign, size = np.linalg.slogdet(correlation)
    if not (sign > 0).all():
        return math.inf
    trace = np.einsum("bij,bji->b", np.linalg.inv(correlation), standard)
    return float(np.sum(freedom * (size + trace)))

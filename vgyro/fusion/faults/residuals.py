"""Residuals: each gyro against the others, in means and in variances of blocks, while some gyros are left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Bools, Floats
from vgyro.fusion.faults.block_sums import BlockSums
from vgyro.runs import true_runs

Span = tuple[int, int]
"""Blocks [first, last)."""

LEVEL_BLOCKS = 32
LEAST_SHARE = 0.02
ROUNDS = 3
IN_MOTION = 25.0
"""A block moves where what its gyros share has so many times the variance of the noise of the combination."""


@dataclass(frozen=True)
class Spoilt:
    """Blocks [first, last) in which a gyro is no part of the combination of the others."""

    gyro: int
    first: int
    last: int


@dataclass(frozen=True)
class Residuals:
    """Each gyro less the combination of the others.

    mean     : [B, N] deg/s;  variance : [B, N] (deg/s)², of a sample in the block, of the residual
    expected : [B, N] (deg/s)², the same where every gyro has its usual noise
    motion   : [B, N] deg/s, mean of the others;  energy : [B, N] (deg/s)², variance of the others in the block
    product  : [B, N] (deg/s)², covariance of the residual and the others in the block, the noise that is in both added
    others   : [N] (deg/s)², variance of a sample of the others' combination
    sigma2   : [N] (deg/s)², usual variance of a sample of each gyro
    moving   : [B] the board moves in this block
    """

    mean: np.ndarray
    variance: np.ndarray
    expected: np.ndarray
    motion: np.ndarray
    energy: np.ndarray
    product: np.ndarray
    others: np.ndarray
    sigma2: np.ndarray
    moving: np.ndarray


def usual_variance(sums: BlockSums, gain: np.ndarray | None = None) -> np.ndarray:
    """Variance of a sample of each gyro [N], from the residuals against the combination of the others.

    gain : [N] sensitivities, by which the rates are divided
    The median over the blocks of c'Gc, c = (1, -u_j, …), is σ_i² + Σ_{j≠i} u_j²·σ_j², which is solved for σ²; first
    with equal shares u, then with those of inverse variance, in which a noisy gyro hardly counts. Only blocks count in
    which the gyro has rates; of shares that differ from block to block, as gyros come and go, u² is a mean.
    """
    gyros = sums.gyros
    gain = np.ones(gyros) if gain is None else gain
    sigma2 = np.ones(gyros)
    for _ in range(ROUNDS):
        seen, squares = np.full(gyros, np.nan), np.eye(gyros)
        for gyro in range(gyros):
            share = np.where(sums.alive, 1.0 / sigma2, 0.0)
            share[:, gyro] = 0.0
            total = share.sum(axis=1)
            known = sums.alive[:, gyro] & (total > 0)
            if not known.any():
                continue
            share = share[known] / total[known, None]
            squares[gyro] += (share**2).mean(axis=0)
            share[:, gyro] = -1.0
            parts = np.column_stack([share / gain, (share / gain).sum(axis=1)])
            seen[gyro] = np.median(np.einsum("bp,bpq,bq->b", parts, sums.moment[known], parts, optimize=True))
        middle = np.nanmedian(seen)
        sigma2 = np.maximum(np.linalg.solve(squares, np.where(np.isnan(seen), middle, seen)), LEAST_SHARE * middle)
    return sigma2


def common_ratio(sums: BlockSums, sigma2: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """How far most gyros leave the others at once [B]: variance of a difference in a block over the usual one.

    gain : [N] sensitivities
    Of each gyro its median over the partners, the lower one, then the median of the gyros: a few bad ones do not count,
    and those without a rate in the block do not at all.
    """
    gyros = sums.gyros
    parts = np.column_stack([np.diag(1.0 / gain), 1.0 / gain])
    moment = np.einsum("ip,bpq,jq->bij", parts, sums.moment, parts, optimize=True)
    own = np.diagonal(moment, axis1=1, axis2=2)
    ratio = (own[:, :, None] + own[:, None, :] - 2.0 * moment) / (sigma2[:, None] + sigma2)
    ratio[~(sums.alive[:, :, None] & sums.alive[:, None, :])] = np.inf
    # Itself, with no difference at all, comes first in the order.
    partners = np.maximum(sums.alive.sum(axis=1) - 2, 0) // 2 + 1
    place = np.minimum(np.broadcast_to(partners[:, None, None], (len(sums), gyros, 1)), gyros - 1)
    of_each = np.take_along_axis(np.sort(ratio, axis=2), place, axis=2)[:, :, 0]
    of_each = np.where(sums.alive & np.isfinite(of_each), of_each, np.nan)
    return np.where(sums.alive.sum(axis=1) > 1, _row_medians(of_each), 0.0)


def shared_energy(sums: BlockSums, gain: np.ndarray) -> np.ndarray:
    """Variance in a block of what the gyros share [B], (deg/s)²: the median of the covariances of all pairs.

    gain : [B, N]
    A gyro that is noisy shares nothing with the others, and neither do a few that share their noise with all.
    """
    gyros = sums.gyros
    one, other = np.triu_indices(gyros, 1)
    common = sums.moment[:, :gyros, gyros]
    both = sums.moment[:, one, other] + common[:, one] + common[:, other] + sums.moment[:, gyros, gyros, None]
    both = both / (gain[:, one] * gain[:, other])
    return _row_medians(np.where(sums.alive[:, one] & sums.alive[:, other], both, np.nan))


def _row_medians(values: np.ndarray) -> np.ndarray:
    """Medians of what is known in each row; 0 where nothing is."""
    empty = np.isnan(values).all(axis=1)
    return np.where(empty, 0.0, np.nanmedian(np.where(empty[:, None], 0.0, values), axis=1))


def spans_of(away: np.ndarray) -> list[Spoilt]:
    """Stretches of blocks in which a gyro is away [B, N]."""
    found = []
    for gyro in np.flatnonzero(away.any(axis=0)).tolist():
        found += [Spoilt(gyro, first, last) for first, last in true_runs(away[:, gyro]).tolist()]
    return found


def residuals_of(
    sums: BlockSums, sigma2: np.ndarray, gain: np.ndarray, spoilt: Sequence[Spoilt], run: np.ndarray | None = None
) -> Residuals:
    """Residuals of every gyro against the inverse-variance combination of the others that are not spoilt.

    gain : [B, N] sensitivity of each gyro, by which its rates are divided;  run [B] : as of the sums; None: theirs
    A spoilt gyro is not just left out of the means: its bias would go with it, and the others would seem to jump. Its
    mean is filled in so that its difference from the others goes straight from before to after.
    """
    blocks, gyros = len(sums), sums.gyros
    weight = np.tile(1.0 / sigma2, (blocks, 1))
    for one in spoilt:
        weight[one.first : one.last, one.gyro] = 0.0
    rate = (sums.mean[:, :gyros] + sums.mean[:, gyros:]) / gain
    filled = _filled(rate, 1.0 / sigma2, spoilt, sums.run if run is None else run)
    total = weight.sum(axis=1)
    everyone = 1.0 / sigma2
    shape = (blocks, gyros)
    mean, variance, expected, motion, energy, product = (np.empty(shape) for _ in range(6))
    for gyro in range(gyros):
        share = weight.copy()
        share[:, gyro] = 0.0
        left = total - weight[:, gyro]
        share /= np.where(left > 0, left, 1.0)[:, None]
        constant = everyone.copy()
        constant[gyro] = 0.0
        motion[:, gyro] = filled @ (constant / constant.sum())
        mean[:, gyro] = rate[:, gyro] - motion[:, gyro]
        of_others = np.column_stack([share / gain, (share / gain).sum(axis=1)])
        of_residual = -of_others
        of_residual[:, gyro] += 1.0 / gain[:, gyro]
        of_residual[:, gyros] += 1.0 / gain[:, gyro]
        carried = np.einsum("bpq,bq->bp", sums.moment, of_residual, optimize=True)
        variance[:, gyro] = np.einsum("bp,bp->b", of_residual, carried)
        noise = share**2 @ sigma2
        expected[:, gyro] = sigma2[gyro] + noise
        product[:, gyro] = np.einsum("bp,bp->b", of_others, carried) + noise
        energy[:, gyro] = np.einsum("bp,bpq,bq->b", of_others, sums.moment, of_others, optimize=True)
        variance[left == 0, gyro] = np.nan
    others = np.array([1.0 / (everyone.sum() - one) for one in everyone])
    moving = shared_energy(sums, gain) > IN_MOTION * np.median(others)
    return Residuals(mean, variance, expected, motion, energy, product, others, sigma2, moving)


def _filled(rate: np.ndarray, weight: np.ndarray, spoilt: Sequence[Spoilt], run: np.ndarray) -> np.ndarray:
    """Means of the gyros [B, N] with spoilt ones replaced, from their own runs [B]: in others biases may be others."""
    if not spoilt:
        return rate
    filled = rate.copy()
    bad = np.zeros(rate.shape, dtype=bool)
    for one in spoilt:
        bad[one.first : one.last, one.gyro] = True
    for first, last, gyro in _joined(spoilt):
        low = max(int(np.searchsorted(run, run[first])), first - LEVEL_BLOCKS)
        high = min(int(np.searchsorted(run, run[last - 1], side="right")), last + LEVEL_BLOCKS)
        share = _good_share(bad, weight, gyro, ((low, high), (first, last)))
        own = np.where(bad[:, gyro], np.nan, rate[:, gyro] - rate @ share)
        begin, end = _level(own[low:first]), _level(own[last:high])
        begin, end = (end if np.isnan(begin) else begin), (begin if np.isnan(end) else end)
        if np.isnan(begin):
            begin = end = 0.0 if np.isnan(own).all() else _level(own)
        filled[first:last, gyro] = rate[first:last] @ share + np.linspace(begin, end, last - first)
    return filled


def _good_share(bad: Bools, weight: Floats, gyro: int, spans: Sequence[Span]) -> Floats:
    """Weights [N] of the others that are good all over a span, the first that has such; else of all others."""
    others = np.arange(bad.shape[1]) != gyro
    for first, last in spans:
        good = others & ~np.any(bad[first:last], axis=0)
        if good.any():
            break
    else:
        good = others
    share = np.where(good, weight, 0.0)
    weights: Floats = share / share.sum()
    return weights


def _level(values: np.ndarray) -> float:
    """Median of what is known; NaN where nothing is."""
    known = values[~np.isnan(values)]
    return float(np.median(known)) if known.size else float("nan")


def _joined(spoilt: Sequence[Spoilt]) -> list[tuple[int, int, int]]:
    """(first, last, gyro) of the spoilt stretches, those of a gyro that touch as one."""
    found: list[tuple[int, int, int]] = []
    for one in sorted(spoilt, key=lambda one: (one.gyro, one.first)):
        if found and found[-1][2] == one.gyro and one.first <= found[-1][1]:
            first, last, gyro = found[-1]
            found[-1] = (first, max(last, one.last), gyro)
        else:
            found.append((one.first, one.last, one.gyro))
    return found

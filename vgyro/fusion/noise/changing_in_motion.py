"""Variances and correlation that both change with time, in any motion: the best linear estimate from the differences.

In block t R_ij = σ_i·σ_j·e^((v_i + v_j)/2)·(C_ij + c_ij). The mean square of y_i - y_j, relative to its constant value,
is about 1 + h_ij'θ, θ = (v, c): a change of a variance moves the differences with all other gyros alike, a change of a
correlation moves one. So how much of each there is can be seen, Π = diag(V_1 ... V_N, U ... U), and the best linear
estimate is

    θ̂ = Π·H'·(H·Π·H' + κ·Σ)⁻¹·z̄

taken twice: about θ = 0, and about what that gave (Bell & Cathey 1993, IEEE Trans. Autom. Control 38, 294-297).
z̄ : two-sided EWMA of the relative squares, less 1;  κ·Σ : covariance of its sampling error. For Gaussian noise
Σ is 2·cov(d_a, d_b)² of the differences d_a, d_b (Isserlis 1918, Biometrika 12, 134-139).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vgyro import engine as engines
from vgyro.fusion.noise.changing import Changing
from vgyro.fusion.noise.cornered_hat import patterns
from vgyro.fusion.noise.difference_blocks import BlockMoments
from vgyro.fusion.noise.variance_model import (
    FEWEST_BLOCKS,
    TIME_CONSTANTS_S,
    LowPass,
    Memory,
    both_sides,
    effective_share,
)

FEWEST_GYROS = 4
"""Of fewer there are no more differences than variances: nothing shows which of the two has changed."""
MOST_GYROS = 8
"""The work of a block grows with the sixth power of their number."""
SCORED = 1 << 13
"""A model is scored at no more blocks than these, evenly spaced."""
LEAST_EIGENVALUE = 0.03
"""A correlation that would have a smaller one is drawn toward the constant one by halves."""
HALVES = 8
STEPS = 2
PIECE = 4096
"""Blocks at a time."""
LARGEST = 5.0
"""No log σ² is farther from the constant one."""


@dataclass(frozen=True)
class Moving:
    """Variances [M, N], (deg/s)², and correlation [M, N, N] of each block; tau_s : of the EWMA behind both."""

    variance: np.ndarray
    correlation: np.ndarray
    tau_s: float


class Score:
    """Gaussian deviance Σ ν·(log|D| + tr D⁻¹S) of the differences between the good gyros; infinite: impossible.

    D = B'RB, B [N, N - 1] an orthonormal basis of the differences: what all gyros have in common changes nothing.
    """

    def __init__(
        self, moments: BlockMoments, square: np.ndarray, outlier: np.ndarray, freedom: np.ndarray
    ) -> None:  # fmt: skip
        """square [M, N, N] : see squares_of_pairs;  freedom [M] : independent samples of each block.

        Blocks with an outlier [M, N] are left out.
        """
        known = ~outlier.any(axis=1) & ((~moments.excluded).sum(axis=1) > 1)
        self.rows = np.flatnonzero(known)[:: max(1, len(freedom) // SCORED)]
        self.freedom = freedom[self.rows]
        self._parts = []
        for pattern, rows in patterns(moments.excluded[self.rows]):
            basis = differences(np.flatnonzero(~pattern), len(pattern))
            # B'1 = 0: the squares of the differences are as good as the second moments.
            self._parts.append((rows, basis, basis.T @ square[self.rows[rows]] @ basis / -2.0))

    @property
    def price(self) -> float:
        """Of one parameter: log Σν."""
        return math.log(max(float(self.freedom.sum()), 2.0))

    def __call__(self, variance: np.ndarray, correlation: np.ndarray) -> float:
        """variance [B, N], correlation [B, N, N] or [N, N] of the blocks `rows`, from other blocks than that alone."""
        total = 0.0
        sigma = np.sqrt(variance)
        for rows, basis, square in self._parts:
            moving = correlation if correlation.ndim == 2 else correlation[rows]
            covariance = basis.T @ (sigma[rows][:, :, None] * sigma[rows][:, None, :] * moving) @ basis
            sign, size = np.linalg.slogdet(covariance)
            if not (sign > 0).all():
                return math.inf
            trace = np.einsum("bij,bji->b", np.linalg.inv(covariance), square)
            total += float(self.freedom[rows] @ (size + trace))
        return total


def squares_of_pairs(moments: BlockMoments, good: np.ndarray) -> np.ndarray:
    """Mean squares [M, N, N], (deg/s)², of the differences y_i - y_j less their slow part; white noise has no bias.

    The slow part is the mean over the blocks about each in which both gyros are good [M, N].
    """
    gyros = good.shape[1]
    result = np.zeros((len(good), gyros, gyros))
    own = np.einsum("bii->bi", moments.square)
    for one, other in zip(*np.triu_indices(gyros, 1), strict=True):
        used = (good[:, one] & good[:, other]).astype(float)
        count = np.maximum(moments.window_sum(used), 1.0)
        mean = moments.mean[:, one] - moments.mean[:, other]
        slow = moments.window_sum(used * mean) / count
        square = own[:, one] + own[:, other] - 2.0 * moments.square[:, one, other]
        square += moments.size * (slow - 2.0 * mean) * slow
        # Of the white noise, one part in `count` of a block's mean went with the slow part.
        result[:, one, other] = result[:, other, one] = square / np.maximum(moments.size - 1.0 / count, 0.5)
    return result


def differences(kept: np.ndarray, gyros: int) -> np.ndarray:
    """Orthonormal basis [N, K - 1] of the differences between K of N gyros."""
    from scipy.linalg import helmert

    basis = np.zeros((gyros, len(kept) - 1))
    basis[kept] = helmert(len(kept)).T
    return basis


@dataclass(frozen=True)
class Rivals:
    """Deviances of constant variances and of those that change alone, prices included; less is better.

    square [M, N, N] : see squares_of_pairs
    """

    score: Score
    square: np.ndarray
    still: float
    changing: float


def alike(moments: BlockMoments, constant: np.ndarray, outlier: np.ndarray, correlation: np.ndarray) -> bool:
    """Does nothing show that a gyro is better than another? Then equal weights, the average, are as good as any.

    Constant [N] variances against their mean for all: by the deviance of the differences, they must be worth
    (N - 1)·log Σν. correlation [N, N] of the noise;  outlier [M, N]
    """
    freedom = moments.size.astype(float)
    score = Score(moments, squares_of_pairs(moments, ~moments.excluded & ~outlier), outlier, freedom)
    if len(score.rows) == 0:
        return False
    blocks = np.ones((len(score.rows), 1))
    used = ~moments.excluded.all(axis=0)
    same = score(blocks * np.where(used, constant[used].mean(), constant), correlation)
    return bool(same - score(blocks * constant, correlation) < (int(used.sum()) - 1) * score.price)


def compared(
    moments: BlockMoments, constant: np.ndarray, correlation: np.ndarray, changing: Changing
) -> Rivals | None:  # fmt: skip
    """Constant [N] variances against those that change, each block predicted from the others; None: no block tells.

    correlation [N, N]; prices as in chosen_memory
    """
    columns = zip(changing.square.T, changing.freedom.T, strict=True)
    shares = [effective_share(*one) for one in columns if one[1].any()]
    if not shares:
        return None
    square = squares_of_pairs(moments, ~moments.excluded & ~changing.outlier)
    score = Score(moments, square, changing.outlier, moments.size * float(np.mean(shares)))
    if len(score.rows) == 0:
        return None
    still = np.broadcast_to(constant, changing.alone[score.rows].shape)
    price = _price(changing.memories, score)
    return Rivals(
        score, square, score(still, correlation), score(changing.alone[score.rows], correlation) + price
    )  # fmt: skip


def moving_noise(
    moments: BlockMoments, constant: np.ndarray, correlation: np.ndarray, block_s: float, changing: Changing,
    engine: str = "native",
) -> Moving | None:  # fmt: skip
    """The best linear estimate, where it predicts the differences of each block from the others better than variances
    that change alone, and than constant ones. None: it does not.

    constant [N], correlation [N, N] : σ², (deg/s)², and C;  changing : the variances that change alone
    Prices: for the time constant and the N + 1 changes log Σν each, those of `changing` as in chosen_memory.
    """
    gyros = len(constant)
    rivals = None
    if FEWEST_GYROS <= gyros <= MOST_GYROS:
        rivals = compared(moments, constant, correlation, changing)
    if rivals is None:
        return None
    score, square = rivals.score, rivals.square
    pairs = _Pairs(moments, square, constant, changing.outlier, correlation)
    low_pass = engines.get(engine).kalman.low_pass
    freedom = float(np.median(score.freedom))
    best, least, last = math.inf, min(rivals.still, rivals.changing) - (gyros + 2) * score.price, math.inf
    for tau in TIME_CONSTANTS_S:
        if tau < FEWEST_BLOCKS * block_s:
            continue
        found = pairs.estimate(tau, math.exp(-block_s / tau), freedom, low_pass, alone=True, rows=score.rows)
        here = math.inf if found is None else score(found.variance, found.correlation)
        if here < least:
            best, least = tau, here
        elif here > last:
            # Past the best there is nothing better.
            break
        last = here
    if math.isinf(best):
        return None
    every = np.arange(len(moments.size))
    chosen = pairs.estimate(best, math.exp(-block_s / best), freedom, low_pass, alone=False, rows=every)
    assert chosen is not None
    # An outlier has the variance that it shows.
    shown = np.where(changing.outlier, changing.square, 0.0)
    return replace(chosen, variance=np.maximum(chosen.variance, shown))


def _price(memories: list[Memory], score: Score) -> float:
    times = sum(math.isfinite(one.tau_s) for one in memories)
    return 2.0 * times * score.price


@dataclass(frozen=True)
class _Model:
    """About one θ a block: relative mean squares [B, P], H [B, P, N + P] and Σ [B, P, P]."""

    square: np.ndarray
    design: np.ndarray
    sampling: np.ndarray


class _Pairs:
    """Relative mean squares z [M, P] of the P differences between two gyros, and the model of what moves them."""

    def __init__(
        self, moments: BlockMoments, square: np.ndarray, constant: np.ndarray, outlier: np.ndarray,
        correlation: np.ndarray,
    ) -> None:  # fmt: skip
        first, second = np.triu_indices(len(constant), 1)
        good = ~moments.excluded & ~outlier
        known = good[:, first] & good[:, second]
        seen = np.flatnonzero(known.sum(axis=0) > 1)
        self.first, self.second, known = first[seen], second[seen], known[:, seen]
        self.constant, self.correlation, self.excluded = constant, correlation, moments.excluded
        self.level = np.ones(len(self.first))
        every = np.arange(len(self.first))
        start = self.at(np.zeros((1, len(constant) + len(every))), every)
        self.level, relative = start.square[0], square[:, self.first, self.second] / start.square[0]
        start = self.at(np.zeros((1, len(constant) + len(every))), every)
        self.design, self.sampling = start.design[0], start.sampling[0]
        self.mass = np.where(known, moments.size[:, None].astype(float), 0.0)
        total = self.mass.sum(axis=0)
        self.relative = np.where(known, relative - (self.mass * relative).sum(axis=0) / total, 0.0)

    def at(self, theta: np.ndarray, pairs: np.ndarray) -> _Model:
        """The model of some pairs about their θ [B, N + P]."""
        gyros = len(self.constant)
        first, second, level = self.first[pairs], self.second[pairs], self.level[pairs]
        sigma = np.sqrt(self.constant * np.exp(theta[:, :gyros]))
        covariance = sigma[:, :, None] * sigma[:, None, :] * self.correlation
        product = sigma[:, first] * sigma[:, second]
        covariance[:, first, second] += theta[:, gyros:] * product
        covariance[:, second, first] = covariance[:, first, second]
        own, each = np.einsum("bii->bi", covariance), np.arange(len(pairs))
        design = np.zeros((len(theta), len(pairs), gyros + len(pairs)))
        design[:, each, first] = (own[:, first] - covariance[:, first, second]) / level
        design[:, each, second] = (own[:, second] - covariance[:, first, second]) / level
        design[:, each, gyros + each] = -2.0 * product / level
        difference = np.zeros((len(pairs), gyros))
        difference[each, first], difference[each, second] = 1.0, -1.0
        between = difference @ covariance @ difference.T
        square = np.einsum("bpp->bp", between) / level
        return _Model(square, design, 2.0 * between**2 / np.outer(level, level))

    def estimate(
        self, tau: float, keep: float, freedom: float, low_pass: LowPass, alone: bool, rows: np.ndarray
    ) -> Moving | None:  # fmt: skip
        """Best linear estimate at the blocks `rows`; alone: without the block itself.  None: nothing changes."""
        others = self._around(keep, low_pass, alone=True)
        share = self._shares(others, (1.0 - keep) / (2.0 * (1.0 + keep) * freedom))
        if share is None:
            return None
        if alone:
            around, error = others, (1.0 - keep) / (2.0 * (1.0 + keep) * freedom)
        else:
            around = self._around(keep, low_pass, alone=False)
            error = (1.0 + keep**2) * (1.0 - keep) / ((1.0 + keep) ** 3 * freedom)
        gyros = len(self.constant)
        theta = np.zeros((len(rows), gyros + len(self.first)))
        for pattern, places in patterns(self.excluded[rows]):
            here = np.flatnonzero(~pattern[self.first] & ~pattern[self.second])
            used = np.concatenate([np.arange(gyros), gyros + here])
            for begin in range(0, len(places), PIECE):
                piece = places[begin : begin + PIECE]
                theta[np.ix_(piece, used)] = self._solved(around[np.ix_(rows[piece], here)], here, share[used], error)
        return self._noise(theta, tau)

    def _solved(self, around: np.ndarray, pairs: np.ndarray, share: np.ndarray, error: float) -> np.ndarray:
        """θ̂ [B, N + P] of some pairs from their z̄ [B, P], by Π and κ: Gauss-Newton steps to the most likely."""
        gyros = len(self.constant)
        # The constant variance is the mean of those that change: E e^v = 1.
        middle = np.concatenate([-share[:gyros] / 2.0, np.zeros(len(pairs))])
        theta = np.broadcast_to(middle, (len(around), len(middle)))
        for _ in range(STEPS):
            model = self.at(theta, pairs)
            off = around - (model.square - 1.0) + np.einsum("bpk,bk->bp", model.design, theta - middle)
            weighted = model.design * share
            inner = weighted @ model.design.transpose(0, 2, 1) + error * model.sampling
            theta = middle + np.einsum("bpk,bp->bk", weighted, np.linalg.solve(inner, off[:, :, None])[:, :, 0])
            theta[:, :gyros] = np.clip(theta[:, :gyros], -LARGEST, LARGEST)
            theta[:, gyros:] = np.clip(theta[:, gyros:], -1.0, 1.0)
        return theta

    def _around(self, keep: float, low_pass: LowPass, alone: bool) -> np.ndarray:
        """Two-sided EWMA [M, P] of z; 0 where nothing is known."""
        result = np.empty(self.relative.shape)
        for pair, (values, mass) in enumerate(zip(self.relative.T, self.mass.T, strict=True)):
            total, number = both_sides(mass * values, keep, low_pass), both_sides(mass, keep, low_pass)
            if alone:
                total, number = total - mass * values, number - mass
            known = number > 1e-6 * mass.max()
            result[:, pair] = np.where(known, total / np.where(known, number, 1.0), 0.0)
        return result

    def _shares(self, others: np.ndarray, error: float) -> np.ndarray | None:
        """Diagonal of Π [N + P], from the covariance of each block with the others about it, which has no sampling
        error: non-negative least squares, then once more with the weights of what it finds. None: nothing changes."""
        from scipy.optimize import nnls

        used = (self.mass > 0).astype(float)
        number = used.T @ used
        if len(self.first) == 0 or (number == 0).any():
            return None
        cross = ((used * self.relative).T @ (used * others)) / number
        cross = (cross + cross.T) / 2.0
        gyros = len(self.constant)
        columns = [np.outer(one, one) for one in self.design[:, :gyros].T]
        columns.append(self.design[:, gyros:] @ self.design[:, gyros:].T)
        found = nnls(np.column_stack([one.ravel() for one in columns]), cross.ravel())[0]
        if not found.any():
            return None
        inner = sum(size * one for size, one in zip(found, columns, strict=True)) + error * self.sampling
        root = np.linalg.cholesky(np.linalg.inv(inner))
        whitened = np.column_stack([(root.T @ one @ root).ravel() for one in columns])
        found = nnls(whitened, (root.T @ cross @ root).ravel())[0]
        if not found.any():
            return None
        # Of e^v, whose variance this is, to v.
        return np.concatenate([np.log1p(found[:gyros]), np.full(len(self.first), found[gyros])])

    def _noise(self, theta: np.ndarray, tau: float) -> Moving:
        """R of θ [B, N + P], with correlations that are positive definite."""
        gyros = len(self.constant)
        variance = self.constant * np.exp(np.clip(theta[:, :gyros], -5.0, 5.0))
        move = np.zeros((len(theta), gyros, gyros))
        move[:, self.first, self.second] = move[:, self.second, self.first] = theta[:, gyros:]
        correlation = self.correlation + move
        least = min(LEAST_EIGENVALUE, 0.5 * float(np.linalg.eigvalsh(self.correlation)[0]))
        for turn in range(HALVES):
            bad = np.flatnonzero(np.linalg.eigvalsh(correlation)[:, 0] < least)
            if len(bad) == 0:
                break
            move[bad] = move[bad] / 2.0 if turn < HALVES - 1 else 0.0
            correlation[bad] = self.correlation + move[bad]
        return Moving(variance, correlation, tau)

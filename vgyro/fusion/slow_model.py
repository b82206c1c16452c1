"""Model of the gyros' slow errors: what a block of samples says of them, and what is known beforehand.

ȳ = 1·w̄ + b + n̄ in each block. Where the board may move w̄ is unknown: what is left is the parity, the differences
between gyros, with the weight matrix G = R⁻¹ - R⁻¹11'R⁻¹/(1'R⁻¹1), G1 = 0. Where it stands still for certain (anchors)
w̄ = 0 and G = R⁻¹. b = initial bias + temperature slope × (T - T̄) + random walk; the first two are constants.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vgyro.errors import DataError
from vgyro.fusion.array import ArrayRates
from vgyro.fusion.slow_blocks import SlowBlocks
from vgyro.fusion.slow_smoother import Filtered, Information, run_back, run_filters

FREEDOM = 2.0
"""Degrees of freedom ν of the initial biases' Student distribution. Above N - 2 one gyro however far off is believed
as much as the rest: its likelihood falls by d^-(ν+1), that of N - 1 wider biases by d^-(N-1)."""
STEPS, SETTLED = 500, 1e-9
LEAST = 1.0
"""Least variance of the constants beforehand, in that with which one is measured: an estimate may vanish by chance."""


@dataclass(frozen=True)
class Evidence:
    """Block means of N gyros and what they weigh.

    means  : [B, N], deg/s, less their mean where the board may move;  weight : G [B, N, N]
    time   : [B] s;  jump : [B, N], variance by which a bias may have changed just before
    temperature : [B], K, about its mean; None: no regressors of it
    anchored : standstill makes the common part seen in some of the blocks
    """

    means: np.ndarray
    weight: np.ndarray
    time: np.ndarray
    jump: np.ndarray
    temperature: np.ndarray | None
    anchored: bool

    @classmethod
    def of(
        cls,
        array: ArrayRates,
        blocks: SlowBlocks,
        variance: np.ndarray,
        correlation: np.ndarray,
        resting: np.ndarray,
        temperature: np.ndarray | None,
    ) -> Evidence:
        """All blocks of a recording.

        variance    : [B, N], (deg/s)² of a sample; not finite or not above 0: the gyro says nothing in this block
        correlation : [N, N] of the noise;  resting : [B] of bool, the board stands still for certain
        """
        used = np.isfinite(variance) & (variance > 0) & ~blocks.at_fault(array)
        weight = _inverse_covariance(used, variance / blocks.length[:, None], correlation)
        total = weight.sum(axis=2)
        parity = ~resting & (used.sum(axis=1) > 1)
        weight[parity] -= total[parity, :, None] * (total[parity] / total[parity].sum(axis=1)[:, None])[:, None, :]
        weight[~resting & ~parity] = 0.0
        means = np.stack([blocks.mean(column) for column in array.rate.T], axis=1)
        # G1 = 0: a rate that all share is taken out first, so that not even its rounding is left.
        means[~resting] -= means[~resting].mean(axis=1)[:, None]
        return cls(means, weight, blocks.time, blocks.jumps(array), temperature, bool(resting.any()))

    def part(self, kept: np.ndarray) -> Evidence:
        """Some of the blocks, by their numbers, increasing: the others are as if they had not been measured."""
        temperature = None if self.temperature is None else self.temperature[kept]
        # The jumps since the one before it; those before the first are part of the initial bias.
        total = np.cumsum(self.jump, axis=0)[kept]
        jump = np.diff(total, axis=0, prepend=total[:1])
        return Evidence(self.means[kept], self.weight[kept], self.time[kept], jump, temperature, self.anchored)

    def information(self) -> Information:
        """For the filter; the regressors are the N initial biases, then the N temperature slopes."""
        known = self.weight @ self.means[..., None]
        scales = [np.ones(len(self.time))]
        if self.temperature is not None:
            scales.append(self.temperature)
        vector = np.concatenate([known, *(self.weight * one[:, None, None] for one in scales)], axis=2)
        measured = np.tensordot(self.means, vector, axes=([0, 1], [0, 1]))
        # D = [I, T·I]
        total = np.vstack([measured[None], *(np.einsum("b,bnk->nk", scale, vector) for scale in scales)])
        return Information(self.weight, vector, total, np.diff(self.time, prepend=self.time[:1]), self.jump)

    def filtered(self, information: Information, walk: np.ndarray) -> Filtered:
        """The filter's forward pass with one walk [N, N]."""
        return self.filtered_with(information, walk[None])[0]

    def filtered_with(self, information: Information, walks: np.ndarray) -> list[Filtered]:
        """The filter's forward pass with each of several walks [S, N, N].

        What rounding takes for information on the constants, or against it, is taken out: without anchors their common
        parts are not seen at all, and nowhere is there less than none.
        """
        return [self._cleared(filtered) for filtered in run_filters(information, walks)]

    def _cleared(self, filtered: Filtered) -> Filtered:
        gyros = self.means.shape[1]
        squares = filtered.squares.copy()
        for start in range(1, len(squares), gyros) if not self.anchored else ():
            rows = slice(start, start + gyros)
            squares[rows] -= squares[rows].mean(axis=0)
            squares[:, rows] -= squares[:, rows].mean(axis=1)[:, None]
        values, vectors = np.linalg.eigh((squares[1:, 1:] + squares[1:, 1:].T) / 2)
        squares[1:, 1:] = (vectors * np.maximum(values, 0.0)) @ vectors.T
        return replace(filtered, squares=squares)


def _inverse_covariance(used: np.ndarray, variance: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Inverses [B, N, N] of σσ'∘C among the gyros that are used, 0 elsewhere; used, variance [B, N]."""
    scale = 1.0 / np.sqrt(np.where(used, variance, 1.0))
    inverse = np.zeros((*used.shape, used.shape[1]))
    patterns, which = np.unique(used, axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        present = np.ix_(pattern, pattern)
        try:
            np.linalg.cholesky(correlation[present])
        except np.linalg.LinAlgError:
            raise DataError("the correlation of the noise is not positive definite") from None
        among = np.zeros_like(correlation)
        among[present] = np.linalg.inv(correlation[present])
        inverse[which.ravel() == number] = among
    return inverse * (scale[:, :, None] * scale[:, None, :])


def walk_covariance(rrw: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Covariance of the random walks K_i·K_j·corr_ij [N, N], (deg/s)²/s; a K that is not known is 0."""
    known = np.where(np.isfinite(rrw), rrw, 0.0)
    return np.outer(known, known) * correlation


@dataclass(frozen=True)
class Constants:
    """Posterior of the constants β: initial biases [N], deg/s, then temperature slopes [N], deg/s/K.

    mean [k], covariance [k, k];  prior [k], variances beforehand, of mean 0
    """

    mean: np.ndarray
    covariance: np.ndarray
    prior: np.ndarray


def posterior(filtered: Filtered, prior: np.ndarray) -> Constants:
    """The constants given the innovations, with independent normal priors of the variances `prior` [k], 0 allowed."""
    seen, score = filtered.squares[1:, 1:], filtered.squares[1:, 0]
    root = np.sqrt(prior)
    inside = np.linalg.inv(np.eye(len(prior)) + root[:, None] * seen * root)
    covariance = root[:, None] * (inside + inside.T) / 2 * root
    return Constants(covariance @ score, covariance, prior)


def log_likelihood(filtered: Filtered, prior: np.ndarray) -> float:
    """Log likelihood of the blocks, less what depends neither on the walk nor on the prior."""
    seen, score = filtered.squares[1:, 1:], filtered.squares[1:, 0]
    root = np.sqrt(prior)
    factor = np.linalg.cholesky(np.eye(len(prior)) + root[:, None] * seen * root)
    explained = np.linalg.solve(factor, root * score)
    log_det = filtered.log_det + 2.0 * float(np.log(np.diag(factor)).sum())
    return -0.5 * (log_det + float(filtered.squares[0, 0]) - float(explained @ explained))


def log_likelihood_slope(
    blocks: Information, filtered: Filtered, prior: np.ndarray, rrw: np.ndarray, correlation: np.ndarray
) -> np.ndarray:
    """Derivatives [N] of log_likelihood by log K_i, exactly.

    With respect to Q_t it is ½(rr' - Λ), and with constants β that are not known ½(E rr' - Λ) over their posterior.
    Koopman & Shephard (1992), Biometrika 79, 823-826.
    """
    score, weight = run_back(blocks, filtered)
    found = posterior(filtered, prior)
    left = score[..., 0] - score[..., 1:] @ found.mean
    gap = blocks.gap
    across = np.einsum("b,bik,bjl->ikjl", gap, score[..., 1:], score[..., 1:], optimize=True)
    excess = (gap[:, None] * left).T @ left + np.einsum("ikjl,kl->ij", across, found.covariance)
    excess -= np.tensordot(gap, weight, axes=1)
    return rrw * ((excess * correlation) @ rrw)


def empirical_prior(filtered: Filtered, gyros: int) -> np.ndarray:
    """Variances [k] of the constants beforehand, from their own spread: empirical Bayes.

    Initial biases: independent Student variables about 0 with ν degrees of freedom, as normal ones of the variance
    s²/λ_i: λ_i = (ν + 1)/(ν + E b_i²/s²), s² = mean λ_i·E b_i², again and again (an EM algorithm; E b_i² is that of the
    posterior). What all share goes to the motion where nothing anchors it, so they are about their robust centre,
    whose variance is 1/Σ(λ_i/s²). That is too small, for the information of a Student location is (ν + 1)/(ν + 3) of
    that of its weights, and for s is known from N - 1 differences alone: the variances are enlarged by the inverse of
    the former, and such that 1.96 standard deviations reach as far as the 95 % limits of a Student variable of N - 1
    degrees of freedom.
    Temperature slopes: independent normal variables of one variance, enlarged for the latter reason.
    Lange, Little & Taylor (1989), J. Am. Stat. Assoc. 84, 881-896.
    """
    from scipy.stats import norm, t

    constants = len(filtered.squares) - 1
    seen = np.diag(filtered.squares)[1:]
    # Begins wide: the squared estimate of each alone, or what one measurement of all would leave open.
    alone = (filtered.squares[1:, 0] ** 2 / np.where(seen > 0, seen, 1.0) ** 2).reshape(-1, gyros)
    open_variance = (1.0 / np.where(seen > 0, seen, 1.0)).reshape(-1, gyros)
    size = np.maximum(alone, open_variance).mean(axis=1)
    least = LEAST * open_variance.mean(axis=1)
    share = np.ones((constants // gyros, gyros))
    for _ in range(STEPS):
        found = posterior(filtered, (size[:, None] / share).ravel())
        second = (found.mean**2 + np.diag(found.covariance)).reshape(-1, gyros)
        share[0] = (FREEDOM + 1) / (FREEDOM + second[0] / size[0])
        before, size = size, np.maximum((share * second).mean(axis=1), least)
        if np.all(np.abs(size - before) <= SETTLED * before):
            break
    few = float(t.ppf(0.975, max(gyros - 1, 1)) / norm.ppf(0.975)) ** 2
    prior = few * size[:, None] / share
    prior[0] *= (FREEDOM + 3) / (FREEDOM + 1)
    return prior.ravel()

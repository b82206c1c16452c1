"""Kalman filter and two-sided smoother of random walks, in information form, with constants that are regressed on.

State b [N], b_t = φ_t·b_{t-1} + noise of covariance q_t·walk: a random walk, φ = 1 and q = Δt, that begins at 0, or one
that fades with the time τ (Gauss-Markov), φ = e^(-Δt/τ) and q = τ/2·(1 - φ²), that begins anywhere, with τ/2·walk.
A block of measurements is its information: y has the weight matrix G (singular where a part of b cannot be seen), and
only G, Gy and y'Gy matter. The columns of y are the measurement itself and k regressors, so that one run serves for
every value of their coefficients β: what is left of y is y_0 - Σ β_j·y_j, and the filter is linear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vgyro.arrays import Floats


@dataclass(frozen=True)
class Information:
    """What the measurements of B blocks of samples say of N states, the biases of the gyros in deg/s.

    matrix : [B, N, N], s²/deg², the weight matrix G of each block: the inverse covariance of its measurement, singular
             where the block does not see a part of the state
    vector : [B, N, 1 + k], G·y for each column of y: first the measurement in deg/s, then the k regressors
    total  : [1 + k, 1 + k], the sum over the blocks of y'·G·y
    gap    : [B], s, time since the block before; 0 for the first block
    """

    matrix: np.ndarray
    vector: np.ndarray
    total: np.ndarray
    gap: np.ndarray

    def merged(self, first: np.ndarray) -> Information:
        """The same measurements with several blocks taken as one, as if the states did not change within it.

        first : [M], increasing, number of the first block of each of the M new ones;  returns : Information of M blocks
        """
        time = np.cumsum(self.gap)
        middle = np.add.reduceat(time, first) / np.diff(first, append=len(time))
        matrix, vector = (np.add.reduceat(one, first, axis=0) for one in (self.matrix, self.vector))
        return Information(matrix, vector, self.total, np.diff(middle, prepend=middle[:1]))

    def first_regressors(self, count: int) -> Information:
        """With the first `count` regressors alone."""
        kept = slice(1 + count)
        return Information(self.matrix, self.vector[..., kept], self.total[kept, kept], self.gap)


@dataclass(frozen=True)
class Filtered:
    """What the forward filter knows of the N states at each of B blocks, before the measurement of that block is used.

    state      : [B, N, 1 + k], predicted state for the measurement (deg/s) and for each of the k regressors
    covariance : [B, N, N], (deg/s)², covariance P of the prediction
    keep       : [B, N, N], L = (I + P·G)⁻¹, the part of the prediction that is left when the measurement is used
    fade       : [B], factor φ by which the state decays from the block before to this one; 1 where walks do not fade
    grown      : [B], s, factor q of the walk's covariance rate: q·walk [(deg/s)²] is added from the block before to
                 this one; for the first block q·walk is the covariance with which the state begins
    squares    : [1 + k, 1 + k], the sum over the blocks of e'·W·e, where e are the innovations of all columns and W is
                 their inverse covariance
    log_det    : the sum over the blocks of log det(I + P·G)
    """

    state: np.ndarray
    covariance: np.ndarray
    keep: np.ndarray
    fade: np.ndarray
    grown: np.ndarray
    squares: np.ndarray
    log_det: float

    def first_regressors(self, count: int) -> Filtered:
        """What it is with the first `count` regressors alone."""
        kept = slice(1 + count)
        return replace(self, state=self.state[..., kept], squares=self.squares[kept, kept])


def run_filters(blocks: Information, walks: np.ndarray, taus: np.ndarray) -> list[Filtered]:
    """Forward pass with each of several walks: P ← φ²P + Q, x ← φx;  L = (I + PG)⁻¹, P ← LP, x ← Lx + P·Gy.

    blocks : B blocks of measurements;  walks [S, N, N], (deg/s)²/s;  taus [S] s, in which they fade, or infinite
    The covariance form of the update with G singular: Bayard & Ploen, US 2003/0187623, where G is that of the parity.
    """
    number, states, columns = blocks.vector.shape
    many = len(walks)
    fade, grown = _steps(blocks.gap, taus)
    state, covariance = np.empty((number, many, states, columns)), np.empty((number, many, states, states))
    keep, one = np.empty((number, many, states, states)), np.eye(states)
    x, P = np.zeros((many, states, columns)), np.zeros((many, states, states))
    for index in range(number):
        still = fade[index]
        x, P = still * x, still * still * P + grown[index] * walks
        state[index], covariance[index] = x, P
        L = np.linalg.inv(one + P @ blocks.matrix[index])
        keep[index] = L
        P = L @ P
        P = (P + P.transpose(0, 2, 1)) * 0.5
        x = L @ x + P @ blocks.vector[index]
    parts = (state, covariance, keep, fade[..., 0, 0], grown[..., 0, 0])
    return [_filtered(blocks, *(part[:, index] for part in parts)) for index in range(many)]


def _steps(gap: np.ndarray, taus: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """φ and q of each block [B, S, 1, 1]."""
    fading = np.isfinite(taus)
    shares = gap[:, None] / taus
    grown = np.where(fading, np.where(fading, taus, 1.0) / 2.0 * -np.expm1(-2.0 * shares), gap[:, None])
    grown[0] = np.where(fading, taus, 0.0) / 2.0
    return np.exp(-shares)[..., None, None], grown[..., None, None]


def _filtered(
    blocks: Information,
    state: np.ndarray,
    covariance: np.ndarray,
    keep: np.ndarray,
    fade: np.ndarray,
    grown: np.ndarray,
) -> Filtered:
    squares = blocks.total - _fitted(blocks, state, keep @ covariance)
    return Filtered(state, covariance, keep, fade, grown, squares, -float(np.linalg.slogdet(keep)[1].sum()))


def _fitted(blocks: Information, state: Floats, updated: Floats) -> Floats:
    """Σ y'Gy - Σ e'We: e'We = e'Ge - (Ge)'P(Ge), with the updated P and e = y - x."""
    seen = blocks.matrix @ state
    left = blocks.vector - seen
    across = _summed(state, blocks.vector)
    fitted: Floats = across + across.T - _summed(state, seen) + _summed(left, updated @ left)
    return fitted


def _summed(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Σ one'other over blocks and states: [B, N, a], [B, N, b] → [a, b]"""
    return np.tensordot(one, other, axes=([0, 1], [0, 1]))


def run_back(blocks: Information, filtered: Filtered) -> tuple[np.ndarray, np.ndarray]:
    """Backward pass: r ← W·e + L'r [B, N, 1 + k] and Λ ← W + L'ΛL [B, N, N], with W = L'G.

    What this block and all later ones say: by r the one-sided state is corrected, Λ is the covariance of r.
    """
    keep = filtered.keep
    turned = np.ascontiguousarray(keep.transpose(0, 2, 1))
    score = turned @ (blocks.vector - blocks.matrix @ filtered.state)
    weight = turned @ blocks.matrix
    r, curvature = np.zeros_like(score[0]), np.zeros_like(weight[0])
    for index, still in zip(range(len(score) - 1, -1, -1), filtered.fade[::-1].tolist(), strict=True):
        back = turned[index]
        r = score[index] + back @ r
        curvature = weight[index] + back @ curvature @ keep[index]
        score[index], weight[index] = r, curvature
        r, curvature = still * r, still * still * curvature
    return score, weight


def run_smoother(blocks: Information, filtered: Filtered) -> tuple[np.ndarray, np.ndarray]:
    """Two-sided estimates [B, N, 1 + k] of each column and covariance [B, N, N].

    x_s = x + P·r, P_s = P - PΛP: the smoother of Bryson & Frazier (1963), equal to that of Rauch, Tung & Striebel, and
    without the inverse of P, which is singular where a state does not walk.
    """
    score, weight = run_back(blocks, filtered)
    P = filtered.covariance
    smoothed = filtered.state + P @ score
    covariance = P - P @ weight @ P
    return smoothed, (covariance + covariance.transpose(0, 2, 1)) * 0.5

"""Filters that adapt themselves to the array: an extended Kalman filter of scale errors, a bank of filters.

Both are recursions over the samples of one gap-free stretch; what runs in lockstep are the states of the first and the
members of the second.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vgyro.arrays import Floats
from vgyro.engine.finite import not_positive_definite, refuse_broken
from vgyro.engine.native import _adaptive

PIECE = 1 << 16
"""Samples that are brought to double precision at a time."""


def scale_bias_filter(
    rate: np.ndarray,
    period: float,
    noise: np.ndarray,
    drive: np.ndarray,
    walk: np.ndarray,
    state: np.ndarray,
    covariance: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.AdaptiveEngine.scale_bias_filter.

    The sums are kept at zero by an orthonormal basis B, b = Bβ and s = Bσ, so the filter has 2N states. The readings
    are made independent once, by the Cholesky factor of `noise` (rows of H are mixed alike), and are then used one
    after the other.
    """
    gyros = rate.shape[1]
    basis = _zero_sum_basis(gyros)
    white = np.linalg.inv(_factor(np.asarray(noise, dtype=float)))
    mixed = np.zeros((2 + 2 * gyros, 2 * gyros))
    mixed[:2, :2] = np.eye(2)
    mixed[2 : 2 + gyros, 2 : 1 + gyros] = mixed[2 + gyros :, 1 + gyros :] = basis
    x, P = mixed.T @ state, _symmetric(mixed.T @ covariance @ mixed)
    steps = _symmetric(basis.T @ (np.asarray(walk, dtype=float)[:, None] * basis))
    estimate = np.empty(len(rate))
    for start in range(0, len(rate), PIECE):
        rows = slice(start, start + PIECE)
        piece = np.ascontiguousarray(rate[rows], dtype=float)
        _adaptive.scale_bias(
            piece, period, np.asarray(drive)[[0, 0, 1], [0, 1, 1]], steps, basis, white, x, P, estimate[rows]
        )
    _refuse(rate, estimate)
    return estimate, mixed @ x, _symmetric(mixed @ P @ mixed.T)


def filter_bank(
    rate: np.ndarray,
    noise: np.ndarray,
    process: np.ndarray,
    start: float,
    variance: float,
    probability: np.ndarray,
    least: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.AdaptiveEngine.filter_bank.

    With D = 1'R⁻¹1 and u = R⁻¹1/D, Sherman & Morrison (1950) gives S⁻¹ and |S| of S = R + 1·P·1':
    e'S⁻¹e = y'(R⁻¹ - R⁻¹11'R⁻¹/D)y + (u'y - x)²/(P + 1/D),  |S| = |R|·(1 + P·D).
    """
    shares, parities, noises, sizes = (np.ascontiguousarray(part) for part in zip(*map(_weighed, noise), strict=True))
    members = np.shape(probability)
    mean, spread = np.full(members, float(start)), np.full(members, float(variance))
    probability, total = np.array(probability, dtype=float, order="C"), np.zeros(members)
    steps = np.ascontiguousarray(process, dtype=float)
    estimate = np.empty(len(rate))
    for first in range(0, len(rate), PIECE):
        rows = slice(first, first + PIECE)
        piece = np.ascontiguousarray(rate[rows], dtype=float)
        _adaptive.mix(
            piece, shares, parities, noises, sizes - sizes[0], steps, least, mean, spread, probability, total,
            estimate[rows],
        )  # fmt: skip
    _refuse(rate, estimate)
    return estimate, probability, total / max(len(rate), 1)


def _zero_sum_basis(gyros: int) -> np.ndarray:
    """Helmert's orthonormal columns [N, N-1], each of sum zero."""
    basis = np.zeros((gyros, gyros - 1))
    for column in range(1, gyros):
        basis[:column, column - 1] = 1.0
        basis[column, column - 1] = -column
        basis[:, column - 1] /= math.sqrt(column * (column + 1))
    return basis


class _Weighed(NamedTuple):
    """Of one R: R⁻¹1/1'R⁻¹1 without its first [N-1], what makes y_i - y_0 white [N-1, N-1], 1/1'R⁻¹1, log|R|."""

    share: np.ndarray
    parity: np.ndarray
    noise: float
    size: float


def _weighed(noise: np.ndarray) -> _Weighed:
    noise = np.asarray(noise, dtype=float)
    factor = _factor(noise)
    solved = np.linalg.solve(noise, np.ones(len(noise)))
    between = noise[1:, 1:] - noise[1:, :1] - noise[:1, 1:] + noise[0, 0]
    parity = np.linalg.inv(_factor(between))
    size = 2.0 * float(np.log(np.diag(factor)).sum())
    return _Weighed((solved / solved.sum())[1:], parity, 1.0 / solved.sum(), size)


def _factor(noise: np.ndarray) -> np.ndarray:
    try:
        if not np.isfinite(noise).all():
            raise np.linalg.LinAlgError
        return np.linalg.cholesky(noise)
    except np.linalg.LinAlgError:
        raise not_positive_definite(0) from None


def _symmetric(matrix: Floats) -> Floats:
    return (matrix + matrix.T) / 2


def _refuse(rate: np.ndarray, estimate: np.ndarray) -> None:
    # What is not finite stays in the recursions.
    if len(estimate) and not np.isfinite(estimate[-1]):
        refuse_broken("rate", rate)

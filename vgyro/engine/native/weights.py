"""Minimum-variance weights in C: four matrices, or four windows, in lockstep."""

from __future__ import annotations

import numpy as np

from vgyro.engine.models import ConditionalWeights
from vgyro.engine.native import _weights, pool
from vgyro.errors import EngineError

PIECE = 16384
"""Matrices that a thread takes at once; like WINDOWS, a multiple of four."""
WINDOWS = 64


def min_variance_weights(H: np.ndarray) -> np.ndarray:
    """As vgyro.engine.protocols.volatility.WeightsEngine.min_variance_weights; at most 32 gyros.

    With Hx ≥ 1, x ≥ 0, x'(Hx - 1) = 0 the weights are x/Σx. The support is found by block principal pivoting from the
    full one (Portugal, Júdice & Vicente 1994; at last by Murty's single exchanges, 1974). A search from the support of
    the matrix before is tried first, and counts where all its inequalities hold by a margin, so that the weights of a
    matrix depend on nothing else. H is scaled by powers of two to a diagonal in [1, 4), which rounds nothing. Each
    system is solved by LDL' and refined, where a pivot is small with residuals in twice the working precision: w is
    exact to 1e-13 as long as H can be used.
    """
    H = np.ascontiguousarray(H, dtype=float)
    _check_size(H.shape[2])
    w = np.empty(H.shape[:2])
    pool.run(lambda start, stop: _weights.min_variance_weights(H, w, start, stop), len(H), PIECE)
    return w


def conditional_weights(
    r: np.ndarray,
    inside: int,
    omega: np.ndarray,
    alpha: np.ndarray,
    beta: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    target: np.ndarray,
    begin: int,
    end: int,
) -> ConditionalWeights:
    """As vgyro.engine.protocols.volatility.WeightsEngine.conditional_weights; at most 32 gyros."""
    omega, alpha, beta, a, b, target = (
        np.ascontiguousarray(array, dtype=float) for array in (omega, alpha, beta, a, b, target)
    )
    count, length, n = r.shape
    _check_size(n)
    # Windows that overlap in memory need no copy, as long as each is contiguous.
    if r.dtype != float or r.strides[1:] != (8 * n, 8):
        r = np.ascontiguousarray(r, dtype=float)
    shape = (count, end - begin, n)
    if not 0 <= begin <= end <= length or not 0 <= inside <= length:
        raise EngineError(f"samples {begin} to {end} (window: {inside}) of a series of {length}")
    weights, deviation, sigma = np.empty(shape), np.empty(shape), np.empty(shape[:2])
    good = np.empty(shape[:2], dtype=bool)

    def weigh(start: int, stop: int) -> None:
        _weights.conditional_weights(
            r, inside, omega, alpha, beta, a, b, target, begin, end, weights, deviation, sigma, good.view(np.uint8),
            start, stop,
        )  # fmt: skip

    if weights.size:
        pool.run(weigh, count, WINDOWS)
    return ConditionalWeights(weights, deviation, sigma, good)


def _check_size(n: int) -> None:
    if not 1 <= n <= _weights.MAX_GYROS:
        raise EngineError(
            f"the native engine weighs 1 to {_weights.MAX_GYROS} gyros, not {n}", remedy="use engine: reference"
        )

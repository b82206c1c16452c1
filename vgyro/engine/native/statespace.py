"""Likelihood and smoother of a linear Gaussian state space of at most five states that one series measures."""

from __future__ import annotations

import math

import numpy as np

from vgyro.engine.finite import refuse_broken
from vgyro.engine.linear import StateSpace, checked
from vgyro.engine.native import _statespace


def log_likelihood(
    z: np.ndarray, r: float | np.ndarray, model: StateSpace, skip: int = 0, regime: np.ndarray | None = None
) -> tuple[float, int]:
    """As vgyro.engine.protocols.filters.StateSpaceEngine.log_likelihood."""
    z, r, flags, whole = checked(z, r, model, regime)
    if len(z) == 0:
        return 0.0, 0
    squares, product, exponent, count = _statespace.likelihood(
        z, r, flags, whole.transition, whole.process, whole.reads, model.coloured, whole.start, whole.spread, skip
    )
    if not product > 0.0:
        return -math.inf, count
    determinant = math.log(product) + exponent * math.log(2.0)
    return -0.5 * (count * math.log(2.0 * math.pi) + determinant + squares), count


def smooth(
    z: np.ndarray, r: float | np.ndarray, model: StateSpace, regime: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.StateSpaceEngine.smooth.

    The modified Bryson-Frazier form of the Rauch-Tung-Striebel smoother (Bierman 1973, Int. J. Control 18, 1251-1258):
    it inverts nothing, so that a noise without a white part and a state that does not move are no special cases. The
    forward pass is run twice, its state kept at the borders of chunks: memory does not grow with n² T.
    """
    z, r, flags, whole = checked(z, r, model, regime)
    smoothed, variance = np.empty(len(z)), np.empty(len(z))
    if len(z) == 0:
        return smoothed, variance
    _statespace.smooth(
        z, r, flags, whole.transition, whole.process, whole.reads, whole.wanted, model.coloured, whole.start,
        whole.spread, smoothed, variance,
    )  # fmt: skip
    refuse_broken("smoothed rate", smoothed[[0, -1]])
    return smoothed, variance

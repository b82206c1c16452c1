"""Likelihood and smoother of a linear Gaussian state space by filterpy, one sample at a time: slow, for checks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from vgyro.engine.linear import StateSpace, checked

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter


def log_likelihood(
    z: np.ndarray, r: float | np.ndarray, model: StateSpace, skip: int = 0, regime: np.ndarray | None = None
) -> tuple[float, int]:
    """As vgyro.engine.protocols.filters.StateSpaceEngine.log_likelihood, by filterpy."""
    z, r, flags, whole = checked(z, r, model, regime)
    variances = np.broadcast_to(r, len(z))
    total, seen, count = 0.0, 0, 0
    filter_ = _filter(whole)
    for index in range(len(z)):
        if not _step(filter_, whole, z, variances, flags, index):
            continue
        seen += 1
        if seen > skip:
            spread = filter_.S.item()
            total -= 0.5 * (math.log(2.0 * math.pi * spread) + filter_.y.item() ** 2 / spread)
            count += 1
    return total, count


def smooth(
    z: np.ndarray, r: float | np.ndarray, model: StateSpace, regime: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """As vgyro.engine.protocols.filters.StateSpaceEngine.smooth, by filterpy's rts_smoother."""
    z, r, flags, whole = checked(z, r, model, regime)
    if len(z) == 0:
        return np.empty(0), np.empty(0)
    variances = np.broadcast_to(r, len(z))
    filter_ = _filter(whole)
    states, spreads = [], []
    for index in range(len(z)):
        _step(filter_, whole, z, variances, flags, index)
        states.append(filter_.x[:, 0].copy())
        spreads.append(filter_.P.copy())
    order = [_regime(flags, index) for index in range(len(z))]
    F, Q = ([matrices[place] for place in order] for matrices in (whole.transition, whole.process))
    # filterpy takes the step to sample k + 1 from place k + 1 of the lists.
    x, P, _, _ = filter_.rts_smoother(np.array(states), np.array(spreads), F, Q)
    return x @ whole.wanted, np.einsum("i,tij,j->t", whole.wanted, P, whole.wanted)


def _filter(whole: StateSpace) -> KalmanFilter:
    from filterpy.kalman import KalmanFilter

    filter_ = KalmanFilter(dim_x=len(whole.reads), dim_z=1)
    filter_.x[:, 0] = whole.start
    filter_.P = np.array(whole.spread, dtype=float)
    return filter_


def _step(
    filter_: KalmanFilter, whole: StateSpace, z: np.ndarray, variances: np.ndarray, flags: np.ndarray, index: int
) -> bool:
    """Predict (but for the first sample) and update; False where there is nothing to update by."""
    place = _regime(flags, index)
    if index > 0:
        filter_.predict(F=whole.transition[place], Q=whole.process[place])
    if np.isinf(variances[index]):
        return False
    reads = whole.reads[None, :].copy()
    if whole.coloured:
        reads[0, -1] = math.sqrt(variances[index])
    filter_.update(z[index], R=0.0 if whole.coloured else variances[index], H=reads)
    return True


def _regime(flags: np.ndarray, index: int) -> int:
    return int(flags[index]) if len(flags) else 0

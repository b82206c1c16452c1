"""Where the smoother begins: what is known of the state before the first sample."""

from __future__ import annotations

import numpy as np

from vgyro.fusion.motion.models import Dynamics

FIRST = 16
"""Samples at the start that tell how large the noise is."""
WIDE = 1e5
"""Variance of a start that counts as knowing nothing, over that of the noise."""


def wide_start(z: np.ndarray, r: np.ndarray, model: Dynamics) -> tuple[np.ndarray, np.ndarray] | None:
    """Mean [n] and covariance [n, n] of the state at the first sample; None where no sample says anything.

    States that have a variance start with it about zero; the others at the first sample that says something, with WIDE
    times the variance of the noise and 100 times that of the steps.
    """
    told = np.flatnonzero(np.isfinite(r[:FIRST])) if r.ndim else np.zeros(1, dtype=int)
    if told.size == 0:
        told = np.flatnonzero(np.isfinite(r))[:FIRST]
    if told.size == 0:
        return None
    noise = float(np.max(r[told])) if r.ndim else float(r)
    inside = z[: 1 << 12] if r.ndim == 0 else z[np.isfinite(r[: 1 << 12]).nonzero()[0]]
    step = float(np.mean(np.diff(inside) ** 2)) if len(inside) > 1 else 0.0
    wide = np.full(len(model.reads), WIDE * noise + 100.0 * step)
    wanders = np.isnan(np.diagonal(model.stationary))
    spread = np.where(np.diag(wanders), np.diag(wide), model.stationary)
    start = np.zeros(len(model.reads))
    start[np.flatnonzero(wanders & (model.order == 0))[:1]] = z[told[0]]
    return start, spread

"""Minimum-variance weights."""

from __future__ import annotations

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Floats
from vgyro.engine.covariance import usable as usable
from vgyro.errors import DataError, EngineError


def min_variance_weights(H: Floats, engine: str = "native") -> Floats:
    """Weights of the combination with the smallest variance: min w'Hw, Σw = 1, 0 ≤ w ≤ 1.

    H       : array [..., N, N], covariance of the N gyros in any unit; symmetric, positive definite
    engine  : who solves it
    returns : w [..., N], exact to about 1e-12 (the equality system on the support is solved, the KKT conditions hold)
    raises  : EngineError, with the index of the first matrix that is not finite or not positive definite
    Liu et al. (2015), eq. 15-16. A matrix H + c·11' has the weights of H. Equal weights are what a caller may fall
    back to; nothing here does so silently.
    """
    H = np.asarray(H, dtype=float)
    if H.ndim < 2 or H.shape[-1] != H.shape[-2] or H.shape[-1] == 0:
        raise DataError(f"H has the shape {H.shape}", remedy="give an array [..., N, N] with N >= 1")
    size = H.shape[-1]
    matrices = H.reshape(-1, size, size)
    if len(matrices) == 0:
        return np.empty(H.shape[:-1])
    weights = engines.get(engine).weights.min_variance_weights(matrices)
    bad = np.flatnonzero(np.isnan(weights[:, 0]))
    if len(bad):
        _refuse(matrices, bad, H.shape[:-2])
    found: Floats = weights.reshape(H.shape[:-1])
    return found


def _refuse(matrices: np.ndarray, bad: np.ndarray, leading: tuple[int, ...]) -> None:
    index = tuple(int(i) for i in np.unravel_index(bad[0], leading)) if leading else ()
    kind = "is not symmetric and positive definite" if np.isfinite(matrices[bad[0]]).all() else "is not finite"
    raise EngineError(
        f"{len(bad)} of {len(matrices)} covariance matrices cannot be used; the first {kind}",
        f"H[{', '.join(map(str, index))}]" if index else "H",
        "leave them out (vgyro.fusion.usable names them), or use equal weights there",
    )

"""Minimum-variance weights, and weights of blocks brought to the samples of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.engine.covariance import usable
from vgyro.errors import DataError, EngineError
from vgyro.fusion.array import WeightKey


def min_variance_weights(H: np.ndarray, engine: str = "native") -> np.ndarray:
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
    _refuse_unusable(matrices, H.shape[:-2])
    matrices = (matrices + matrices.transpose(0, 2, 1)) / 2
    return engines.get(engine).weights.min_variance_weights(matrices).reshape(H.shape[:-1])


def _refuse_unusable(matrices: np.ndarray, leading: tuple[int, ...]) -> None:
    bad = np.flatnonzero(~usable(matrices))
    if len(bad) == 0:
        return
    index = tuple(int(i) for i in np.unravel_index(bad[0], leading)) if leading else ()
    kind = "is not symmetric and positive definite" if np.isfinite(matrices[bad[0]]).all() else "is not finite"
    raise EngineError(
        f"{len(bad)} of {len(matrices)} covariance matrices cannot be used; the first {kind}",
        f"H[{', '.join(map(str, index))}]" if index else "H",
        "leave them out (vgyro.fusion.usable names them), or use equal weights there",
    )


def block_of_sample(
    time: np.ndarray,
    block_time: np.ndarray,
    block_s: float,
    rate_hz: float,
) -> np.ndarray:
    """Number of the block that each sample lies in, -1 for none: array [T] of int.

    time       : [T] of the samples, s
    block_time : [M], time of each block's first sample, increasing, s
    block_s    : length of a block, s
    """
    if len(block_time) == 0:
        return np.full(len(time), -1)
    # Half a sample keeps the rounding of time stamps away from the borders.
    late = time + 0.5 / rate_hz
    index = np.searchsorted(block_time, late, side="right") - 1
    inside = index >= 0
    index = np.maximum(index, 0)
    inside &= late - block_time[index] < block_s
    return np.where(inside, index, -1)


def expand_weights(weights: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Weights of blocks [M, N] → of samples [T, N]; a sample in no block (-1) has equal weights."""
    size = weights.shape[1]
    rows = np.vstack([weights, np.full((1, size), 1.0 / size)])
    return rows[block]


@dataclass(frozen=True)
class SampleWeights(Mapping[WeightKey, np.ndarray]):
    """Weights of blocks that become weights of samples [T, N] only when they are looked up, to save memory.

    blocks : (model, mode, definition) → (weights [M, N], block of each sample [T], -1: none)
    """

    blocks: Mapping[WeightKey, tuple[np.ndarray, np.ndarray]]

    def __getitem__(self, key: WeightKey) -> np.ndarray:
        return expand_weights(*self.blocks[key])

    def __iter__(self) -> Iterator[WeightKey]:
        return iter(self.blocks)

    def __len__(self) -> int:
        return len(self.blocks)

"""A linear Gaussian state space that one series measures: what both engines filter and smooth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vgyro.engine.finite import refuse_broken
from vgyro.errors import DataError, EngineError

MOST_STATES = 11
"""With the state that coloured noise needs."""


@dataclass(frozen=True)
class StateSpace:
    """x_t = F x_{t-1} + w_t, z_t = h'x_t + v_t; the combination c'x_t is wanted.

    transition, process : F and the covariance of w, [n, n], or one of each for every regime, [M, n, n]
    reads, wanted       : h and c, [n]
    start, spread       : mean [n] and covariance [n, n] of the state at the first sample, before it is measured
    pole                : φ of the noise, v_t = √r_t·a_t with a_t = φ·a_{t-1} + √(1 - φ²)·(white of variance 1): the
                          variance of v_t is r_t, and with a constant r it is AR(1). 0: white
    """

    transition: np.ndarray
    process: np.ndarray
    reads: np.ndarray
    wanted: np.ndarray
    start: np.ndarray
    spread: np.ndarray
    pole: float = 0.0

    @property
    def coloured(self) -> bool:
        return self.pole != 0.0

    def whole(self) -> StateSpace:
        """With [regimes, n, n], and with the noise in units of its standard deviation as last state if it has colour.

        Its measurement is then h'x + √r_t·(last state) without any noise; reads[-1] is 0 here, √r_t has its place.
        """
        size = len(self.reads)
        F, Q = (np.asarray(one, dtype=float).reshape(-1, size, size) for one in (self.transition, self.process))
        if not self.coloured:
            return replace(self, transition=np.ascontiguousarray(F), process=np.ascontiguousarray(Q))
        return replace(
            self,
            transition=_bordered(F, self.pole),
            process=_bordered(Q, 1.0 - self.pole**2),
            reads=np.append(self.reads, 0.0),
            wanted=np.append(self.wanted, 0.0),
            start=np.append(self.start, 0.0),
            spread=_bordered(np.asarray(self.spread, dtype=float)[None], 1.0)[0],
        )


def _bordered(matrices: np.ndarray, corner: float) -> np.ndarray:
    size = matrices.shape[-1]
    wide = np.zeros((len(matrices), size + 1, size + 1))
    wide[:, :size, :size] = matrices
    wide[:, size, size] = corner
    return wide


class CheckedSeries(NamedTuple):
    """z [T], r [1] or [T], regime [T] uint8 or [0], and the whole model."""

    z: np.ndarray
    r: np.ndarray
    regime: np.ndarray
    model: StateSpace


def checked(z: np.ndarray, r: float | np.ndarray, model: StateSpace, regime: np.ndarray | None) -> CheckedSeries:
    """A series as the engines take it.

    raises : DataError for shapes that do not fit; EngineError that names the first sample whose r is not above 0 (it
             may be infinite), or whose z is not finite though r is
    """
    z = np.ascontiguousarray(z, dtype=float)
    r = np.ascontiguousarray(r, dtype=float).reshape(-1)
    flags = np.empty(0, dtype=np.uint8) if regime is None else np.ascontiguousarray(regime, dtype=np.uint8)
    if z.ndim != 1 or len(r) not in (1, len(z)) or (regime is not None and flags.shape != z.shape):
        shapes = f"z {z.shape}, r {r.shape} and regime {flags.shape}"
        raise DataError(f"{shapes} do not fit", remedy="give [T], one r or [T], and [T]")
    whole = model.whole()
    if len(whole.reads) > MOST_STATES:
        raise DataError(f"{len(whole.reads)} states are too many", remedy=f"the state space has at most {MOST_STATES}")
    most = min(len(whole.transition), len(whole.process))
    if flags.any() and flags.max() >= most:
        raise DataError(f"regime {flags.max()} is asked for, and the model has {most}", remedy="give [M, n, n] of both")
    usable = r > 0.0
    if not usable.all():
        raise EngineError("the variance r is not above zero", f"sample {int(np.argmin(usable))}", "infinite: no data")
    refuse_broken("rate", z if np.isfinite(r).all() else np.where(np.isinf(r), 0.0, z))
    return CheckedSeries(z, r, flags, whole)

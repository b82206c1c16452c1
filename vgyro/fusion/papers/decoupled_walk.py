"""A random walk of N states in white noise, as scalar filters that do not depend on each other.

y = x + n, x a random walk in N dimensions, n white: both covariances become diagonal in the same coordinates, so that
the Kalman filter of N states is that of N scalars. The gain of a scalar random walk is known in closed form for every
sample, from the first on: no Riccati recursion is run, and no [T, N] array is made.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Floats
from vgyro.fusion.blocks import PIECE, combined
from vgyro.fusion.types import ArrayNoise, ArrayRates, CannotRun

SMALLEST = 1e-10
"""A mode whose step, in standard deviations of one sample's white noise, is smaller does not walk: it stays where it
began. Even at 1000 Hz its settled filter would have a time constant of months."""


@dataclass(frozen=True)
class Modes:
    """Modes of a random walk in white noise: z_k = direction_k'y is a scalar random walk in white noise of variance 1.

    direction : [N, M], s/deg;  step : [M], standard deviation of the walk's step from sample to sample, 1
    share     : [M], deg/s: the output that is wanted is Σ share_k·x_k, given the estimates x_k of all modes

    Of each: p∞ = λ/2·(√(1 + 4/λ) - 1), λ = step², is the settled gain and the variance after an update.
    """

    direction: np.ndarray
    step: np.ndarray
    share: np.ndarray

    @property
    def gain(self) -> np.ndarray:
        """p∞ [M]: settled gain, and variance after an update."""
        half = self.step / 2.0
        return 2.0 * half * (np.sqrt(half**2 + 1.0) - half)


def modes(white: np.ndarray, walk: np.ndarray, output: np.ndarray, basis: np.ndarray | None = None) -> Modes:
    """Modes of basis'y, y = x + n.

    white  : [N, N], (deg/s)², covariance of n in one sample, positive definite
    walk   : [N, F], deg/s: the step of x from sample to sample is walk·ξ, ξ of F independent unit normals
    output : [F], deg/s: the step of what is wanted is output·ξ
    basis  : [N, L], what of y is looked at; None: all of it

    By the singular values of the whitened factor, not the eigenvalues of a covariance: steps that are 1e-7 of the
    largest are still good to nine digits. The share of a mode is the regression of the wanted step on the mode's step;
    what is wanted then follows from the modes at every sample, if the covariance at the start is that of such steps.
    """
    basis = np.eye(len(white)) if basis is None else basis
    lower = np.linalg.cholesky(basis.T @ white @ basis)
    left, step, right = np.linalg.svd(np.linalg.solve(lower, basis.T @ walk), full_matrices=False)
    walking = step > SMALLEST
    direction = basis @ np.linalg.solve(lower.T, left[:, walking])
    return Modes(direction, step[walking], right[walking] @ output / step[walking])


def walk_factor(noise: ArrayNoise) -> np.ndarray:
    """F [N, N] with FF' = Q = K²·correlation, the covariance of the random walks, (deg/s)²/s.

    raises : CannotRun if the rate random walk of a gyro is not known, or the correlation is not one
    """
    unknown = np.flatnonzero(~(np.isfinite(noise.rrw) & (noise.rrw >= 0)))
    if len(unknown):
        which = ", ".join(str(index + 1) for index in unknown)
        raise CannotRun(f"the rate random walk of gyro {which} of {len(noise.rrw)} is not known")
    try:
        return noise.rrw[:, None] * np.linalg.cholesky(noise.correlation)
    except np.linalg.LinAlgError:
        raise CannotRun("the correlation of the gyros is not positive definite") from None


def estimate(array: ArrayRates, direct: np.ndarray, found: Modes, engine: str, start_s: float = math.inf) -> np.ndarray:
    """direct'y + Σ share_k·x_k [T], x_k the Kalman estimates of the modes after each sample.

    direct  : [N]
    start_s : the covariance at the start is that of a walk which began at zero so many seconds before the first sample;
              infinite: nothing is known of the start

    x is kept over a gap, and its variance grows by λ a sample that is lost; where the length of a gap is not known,
    none counts as lost. The gain of sample k since the start is 1 - φ_k, φ_k = μ(1 - f_k)/(1 - f_{k+1}), μ = 1 - p∞,
    f_k = f_0·μ^(2k), f_0 = (p_0 - p∞)/(p_0 + p∞ + λ): the solution of p ← (p + λ)/(p + λ + 1).
    """
    settle = engines.get(engine).kalman.settling_filter
    settled, growth = found.gain, found.step**2
    keep, state = 1.0 - settled, np.zeros(len(settled))
    fading = _fading(growth * start_s / array.period, settled, growth)
    fused = np.empty(len(array.rate))
    for part, lost in zip(array.stretches(), samples_lost(array), strict=True):
        if lost > 0:
            fading = _fading(_variance(fading, settled, growth) + growth * lost, settled, growth)
        for start in range(part.start, part.stop, PIECE):
            rows = slice(start, min(start + PIECE, part.stop))
            # Once in double precision, not once a mode.
            piece = np.asarray(array.rate[rows], dtype=float, order="F")
            fused[rows] = combined(piece, direct) if direct.any() else 0.0
            for k, share in enumerate(found.share):
                x = settle(combined(piece, found.direction[:, k]), keep[k], fading[k], state[k])
                fused[rows] += share * x
                state[k] = x[-1]
            fading = fading * keep ** (2.0 * len(piece))
    return fused


def samples_lost(array: ArrayRates) -> list[float]:
    """Sample periods without a sample before each gap-free stretch; 0 before the first and where it is not known."""
    stretches = array.stretches()
    if array.stretch_time is None:
        return [0.0] * len(stretches)
    length = np.array([part.stop - part.start for part in stretches])
    between = np.diff(array.stretch_time) * array.rate_hz - length[:-1]
    return [0.0, *np.maximum(between, 0.0).tolist()]


def _fading(variance: np.ndarray, settled: np.ndarray, growth: np.ndarray) -> np.ndarray:
    known = np.isfinite(variance)
    finite = np.where(known, variance, 0.0)
    return np.where(known, (finite - settled) / (finite + settled + growth), 1.0)


def _variance(fading: Floats, settled: Floats, growth: Floats) -> Floats:
    return (settled + fading * (settled + growth)) / (1.0 - fading)


def operations(modes_run: int, gyros: int) -> float:
    """Floating-point operations a sample: sums over the gyros, gain, filter and output of each mode."""
    return modes_run * (2.0 * gyros + 12.0)

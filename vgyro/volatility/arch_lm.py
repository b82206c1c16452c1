"""Engle's test for ARCH effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.errors import TooShort

FLAT = 1e-12


@dataclass(frozen=True)
class ArchLm:
    """statistic [N], p_value [N]; NaN for a series whose square does not vary."""

    statistic: np.ndarray
    p_value: np.ndarray


def arch_lm(residual: np.ndarray, lags: int = 1, keep: np.ndarray | None = None) -> ArchLm:
    """Engle's Lagrange-multiplier test for ARCH effects.

    residual : array [T, N], deg/s, zero mean; one test per column
    lags     : m, number of lagged squares in the auxiliary regression
    keep     : [T], false for samples that take no part, neither as a square nor as a lagged one; None: all do
    returns  : ArchLm(statistic [N], p_value [N]); statistic = (T-m)·R², chi² with m d.o.f.; NaN where e² is constant
    raises   : TooShort if T <= 2m + 1, or if no more than m + 1 squares are kept with all their lags
    Slow drift of the level fails this test as well as changing variance does: read it beside the detrended series.
    Engle (1982), Econometrica 50(4), 987-1007; Liu et al. (2015), Table 1.
    """
    from scipy.special import chdtrc

    residual = np.asarray(residual, dtype=float)
    samples = len(residual)
    if samples <= 2 * lags + 1:
        raise TooShort(
            f"{samples} samples are too few for an ARCH-LM test with {lags} lags",
            remedy=f"It takes at least {2 * lags + 2}",
        )
    used = np.ones(samples, dtype=bool) if keep is None else np.asarray(keep, dtype=bool)
    rows = np.asarray(np.lib.stride_tricks.sliding_window_view(used, lags + 1).all(axis=1))
    if rows.sum() <= lags + 1:
        raise TooShort(f"{rows.sum()} samples are kept with their {lags} lags", remedy="Keep more of them")
    statistic = np.array([_statistic(column, lags, rows) for column in residual.T])
    return ArchLm(statistic, chdtrc(lags, statistic))


def _statistic(column: np.ndarray, lags: int, rows: np.ndarray) -> float:
    """rows [T - m]: true for the squares that are explained"""
    square = np.square(column)
    size = square.mean()
    if not np.isfinite(size) or np.ptp(square) <= FLAT * square.max(initial=0.0):
        return np.nan
    square = square / size
    target = square[lags:][rows]
    target = target - target.mean()
    lagged = np.stack([square[lags - lag : len(square) - lag][rows] for lag in range(1, lags + 1)], axis=1)
    lagged = lagged - lagged.mean(axis=0)
    total = float(target @ target)
    if total == 0:
        return np.nan
    coefficients = np.linalg.lstsq(lagged, target, rcond=None)[0]
    rest = target - lagged @ coefficients
    return len(target) * (1 - float(rest @ rest) / total)


def kurtosis(residual: np.ndarray) -> np.ndarray:
    """Kurtosis mean(x⁴)/mean(x²)² of each column about its mean, [N]; 3 for a Gaussian, NaN for a constant."""
    away = residual - residual.mean(axis=0)
    square = np.square(away)
    size = square.mean(axis=0)
    flat = np.ptp(residual, axis=0) <= FLAT * np.max(np.abs(residual), axis=0)
    return np.where(flat, np.nan, np.mean(np.square(square), axis=0) / np.where(flat, 1.0, size) ** 2)

"""The series on which Engle's test is made: r_t itself, detrended, whitened, and standardised by its GARCH model."""

from __future__ import annotations

import numpy as np

from vgyro.engine.models import GarchWindows
from vgyro.tasks.volatility.stored import ArraySeries
from vgyro.volatility.batches import fitted_batch
from vgyro.volatility.effects.whiten import whiten
from vgyro.volatility.garch import garch_variance
from vgyro.volatility.series import detrended
from vgyro.volatility.windowed import MIN_SAMPLES


def whitened(r: np.ndarray, array: ArraySeries) -> np.ndarray:
    """r_t [T] of one gyro without drift, tones and correlation; NaN throughout if it lacks values."""
    if not np.isfinite(r).all():
        return np.full(len(r), np.nan)
    return whiten(r, array.rate_hz, array.options.detrend_span).residual


def series_of(array: ArraySeries, values: np.ndarray, garch: GarchWindows) -> dict[str, np.ndarray]:
    """The four series that are tested, [T, N]. They lie in one stretch: no lag bridges a gap.

    values [T, N] : a stretch of the array's series;  garch : its fit, as of one window
    level        : r_t of the definition
    detrended    : r_t minus its centred running mean
    whitened     : r_t without drift, tones and correlation (vgyro.volatility.effects.whiten)
    standardised : r_t/√h_t with the GARCH fit of the same stretch; NaN for a gyro without one
    """
    if len(values) < MIN_SAMPLES:
        r = np.full(values.shape, np.nan)
        return {"level": r, "detrended": r, "whitened": r, "standardised": r}
    start = np.zeros(1, dtype=np.int64)
    r = fitted_batch(values, start, len(values), array.definition, array.options.residual_span)[0]
    variance = garch_variance(r, garch.omega[0], garch.alpha[0], garch.beta[0])
    return {
        "level": r,
        "detrended": detrended(r, array.options.detrend_span),
        "whitened": np.column_stack([whitened(one, array) for one in r.T]),
        "standardised": r / np.sqrt(variance),
    }

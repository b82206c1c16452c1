"""How well scale factor and bias repeat from one switch-on to the next (IEEE Std 1431-2004, repeatability)."""

from __future__ import annotations

import numpy as np

from vgyro import units
from vgyro.calibration.figures import Finding, not_measured, unsigned
from vgyro.calibration.wandering import Errors

FEWEST_FOR_TEMPERATURE = 4
FEWEST_KELVIN = 1.0


def scale_repeatability(
    scale: np.ndarray, error: np.ndarray, temperature: np.ndarray | None = None, confidence: float = 0.95
) -> Finding:
    """σ(S_i) / mean S, ppm, over R power cycles; scale and its standard error, deg/s a count, [R].

    temperature : [R] °C; where there are 4 cycles and it varies by 1 K, a straight line in it is taken off first
    """
    scale, error = np.asarray(scale, dtype=float), np.asarray(error, dtype=float)
    mean = abs(float(np.mean(scale))) if scale.size else 1.0
    to_ppm = float(units.parts_per_million(1.0 / mean))
    return _repeatability(scale * to_ppm, error * to_ppm, temperature, confidence)


def bias_repeatability(
    bias: np.ndarray,
    error: np.ndarray,
    scale: float,
    temperature: np.ndarray | None = None,
    confidence: float = 0.95,
) -> Finding:
    """σ of the bias, deg/h, over R power cycles; bias and its standard error, counts, [R]; scale deg/s a count."""
    to_deg_h = float(units.deg_h(abs(scale)))
    return _repeatability(np.asarray(bias) * to_deg_h, np.asarray(error) * to_deg_h, temperature, confidence)


def _repeatability(values: np.ndarray, error: np.ndarray, temperature: np.ndarray | None, confidence: float) -> Finding:
    """σ of values with errors.

    The variance seen is σ² + mean error². Its limits are those of chi²; the error's part is taken off value and limits.
    """
    from scipy.special import chdtri

    cycles = len(values)
    if cycles < 2:
        return not_measured("needs two calibration recordings or more, a power cycle each")
    left, freedom, note = values - values.mean(), cycles - 1, f"{cycles} power cycles"
    if temperature is not None and cycles >= FEWEST_FOR_TEMPERATURE and np.ptp(temperature) >= FEWEST_KELVIN:
        design = np.column_stack([np.ones(cycles), temperature])
        left = values - design @ Errors(cycles).fit(design, values).estimate
        freedom, note = cycles - 2, f"{note}, straight line in temperature taken off"
    squares, noise = float(left @ left), float(np.mean(error**2))
    tail = (1 - confidence) / 2
    low, high = (squares / float(chdtri(freedom, share)) for share in (tail, 1 - tail))
    value, low, high = (float(np.sqrt(max(variance - noise, 0.0))) for variance in (squares / freedom, low, high))
    # The spread that noise alone shows in half of such tests; it stands out where chi² of the noise is exceeded.
    floor = float(np.sqrt(noise * chdtri(freedom, 0.5) / freedom))
    return unsigned(value, low, high, floor, note=note)

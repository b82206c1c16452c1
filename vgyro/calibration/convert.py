"""From counts to deg/s, and what the true rate was."""

from __future__ import annotations

import numpy as np


def to_rates(counts: np.ndarray, sign: int, scale: float | np.ndarray, bias: float | np.ndarray) -> np.ndarray:
    """Rate of one gyro, deg/s: sign · (count - bias) · scale.

    counts : array [T];  scale : deg/s a count;  bias : counts; numbers, or arrays [T] that follow the temperature
    """
    return (np.asarray(counts, dtype=float) - bias) * (sign * scale)


def sinusoid(time: np.ndarray, amplitude: float, frequency_hz: float, phase_rad: float) -> np.ndarray:
    """amplitude · sin(2π · frequency · t + phase), deg/s; time [T] in s"""
    return amplitude * np.sin(2 * np.pi * frequency_hz * np.asarray(time) + phase_rad)


def fit_phase(rate: np.ndarray, time: np.ndarray, frequency_hz: float) -> float:
    """Phase, rad, of the sinusoid of that frequency that fits rate [T] best (least squares, with an offset).

    A delay common to all gyros ends up in the phase: it cannot be told from a table that started later.
    """
    angle = 2 * np.pi * frequency_hz * np.asarray(time)
    design = np.column_stack([np.sin(angle), np.cos(angle), np.ones_like(angle)])
    (in_phase, quadrature, _), *_ = np.linalg.lstsq(design, np.asarray(rate, dtype=float), rcond=None)
    return float(np.arctan2(quadrature, in_phase))


def clipped_samples(counts: np.ndarray, rails: tuple[float, float] | None) -> np.ndarray:
    """True where a count [T] lies at a rail of the converter."""
    counts = np.asarray(counts)
    if rails is None:
        return np.zeros(counts.shape, dtype=bool)
    return (counts <= rails[0]) | (counts >= rails[1])

"""What a gyro makes of the rate that it sees: nonlinearity, asymmetry, hysteresis, temperature of scale and bias."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vgyro.arrays import Floats
from vgyro.simulate.twin import GyroTruth, TemperatureTruth
from vgyro.units import parts_per_million

CUBIC_SLOPE = 0.6
"""Slope of the least-squares line of u³ over -1 ≤ u ≤ 1, every u alike."""
CUBIC_LARGEST = 0.4
"""Largest |u³ - 0.6 u| there, at both ends."""


class Transfer:
    """Errors that follow the rate, of N gyros, deg/s; all zero unless the twin says otherwise.

    With u = rate / full scale F, ΔT = T - reference_c and d = ±1 the direction of the rate's last change (0 before):
        nonlinearity  F · p · (u³ - 0.6 u) / 0.4       p at the ends, and a least-squares line of slope 0 over ±F
        asymmetry     a / 2 · |rate|                   so that S⁺ - S⁻ = a, their mean is unchanged
        hysteresis    -d · F · h / 2 · (1 - u²)        lags: h between the branches at rest, nothing at ±F and beyond
        temperature   k · ΔT · rate                    the sensitivity alone: bias and noise are not multiplied
    Ratios p, a, h, k of the keys in ppm. They are added to the rate, before `scale_error`.
    truths : errors of each gyro;  full_scale : [N], deg/s, what is irrelevant where p = h = 0
    """

    def __init__(self, truths: Sequence[GyroTruth], full_scale: Sequence[float], reference_c: float) -> None:
        self._full_scale, self._reference_c = np.array(full_scale), reference_c
        self._nonlinearity = _ratios(truths, "nonlinearity_ppm")
        self._asymmetry = _ratios(truths, "asymmetry_ppm")
        self._hysteresis = _ratios(truths, "hysteresis_ppm")
        self._slope = _ratios(truths, "scale_temperature_ppm_k")

    @property
    def ideal(self) -> bool:
        """True if there is nothing to add."""
        return not any(map(np.any, (self._nonlinearity, self._asymmetry, self._hysteresis, self._slope)))

    def error(self, rate: Floats, direction: Floats, temperature: Floats) -> Floats:
        """deg/s to add, [T, N].

        rate : [T, N], deg/s, seen by each gyro;  direction : [T], -1, 0 or 1;  temperature : [T], °C
        """
        share = rate / self._full_scale
        bent = self._nonlinearity * (share**3 - CUBIC_SLOPE * share) / CUBIC_LARGEST
        loop = self._hysteresis / 2.0 * np.maximum(1.0 - share**2, 0.0) * direction[:, None]
        warm = np.outer(temperature - self._reference_c, self._slope)
        error: Floats = self._full_scale * (bent - loop) + self._asymmetry / 2.0 * np.abs(rate) + warm * rate
        return error


def _ratios(truths: Sequence[GyroTruth], key: str) -> np.ndarray:
    return np.array([getattr(truth, key) for truth in truths]) / parts_per_million(1.0)


class Direction:
    """Which way the rate changed last, piece after piece: 1 up, -1 down, 0 while it never changed."""

    def __init__(self) -> None:
        self._rate: float | None = None
        self._last = 0.0

    def next(self, rate: np.ndarray) -> np.ndarray:
        """The next samples, [T]."""
        before = rate[0] if self._rate is None else self._rate
        step = np.sign(np.diff(rate, prepend=before))
        places = np.maximum.accumulate(np.where(step != 0, np.arange(step.size), -1))
        direction = np.where(places >= 0, step[places], self._last)
        self._rate, self._last = float(rate[-1]), float(direction[-1])
        return direction


def temperature_at(thermal: TemperatureTruth, time: np.ndarray) -> np.ndarray:
    """°C at `time` [T], s: the chamber's (start_c, or straight lines between `points`), and the self-heating on top."""
    chamber: float | np.ndarray = thermal.start_c
    if thermal.points:
        chamber = np.interp(time, *np.array(thermal.points).T)
    return chamber + thermal.rise_k * -np.expm1(-time / thermal.time_constant_s)


def thermal_bias(truths: Sequence[GyroTruth], above: np.ndarray) -> np.ndarray:
    """Bias that the temperature adds, deg/s, [T, N]: c₁ΔT + c₂ΔT² + c₃ΔT³.  above : [T], ΔT, K above reference_c"""
    bias = np.outer(above, [truth.temperature_coefficient for truth in truths])
    for power, key in ((2, "temperature_quadratic"), (3, "temperature_cubic")):
        coefficients = np.array([getattr(truth, key) for truth in truths])
        if coefficients.any():
            bias += np.outer(above**power, coefficients)
    return bias

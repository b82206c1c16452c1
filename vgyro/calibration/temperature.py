"""What the temperature does to scale factor and bias, and how it is taken off."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vgyro import units
from vgyro.arrays import Floats
from vgyro.calibration.convert import to_rates
from vgyro.calibration.figures import VALUE, Finding, not_measured, signed
from vgyro.calibration.wandering import Errors
from vgyro.runs import run_starts

FEWEST_KELVIN = 1.0
FEWEST_TEMPERATURES = 3  # for a slope with limits
MEDIAN_OF_NOISE = 0.6745  # of |x|, x standard normal


@dataclass(frozen=True)
class Compensation:
    """Bias and scale factor of one gyro as functions of temperature, clamped to the range that was measured.

    reference_c : temperature of the test whose scale holds;  low_c, high_c : range, °C
    scale_slope : k, 1/K: S(T) = S · (1 + k·(T - reference_c)), S in counts per deg/s
    bias        : counts, counts/K, counts/K², counts/K³
    """

    reference_c: float
    low_c: float
    high_c: float
    scale_slope: float
    bias: tuple[float, float, float, float]

    def bias_at(self, temperature: Floats) -> Floats:
        """Counts at temperatures [T], °C."""
        return np.polynomial.polynomial.polyval(self._apart(temperature), self.bias)

    def scale_factor_at(self, temperature: np.ndarray) -> np.ndarray:
        """What the scale, deg/s a count, of the reference temperature is multiplied by at temperatures [T], °C."""
        return 1.0 / (1.0 + self.scale_slope * self._apart(temperature))

    def anchored(self, bias: float) -> Compensation:
        """The same curve through the bias, counts, that a test at the reference temperature found.

        The bias changes with every switch-on; only the curve's shape carries over from one recording to another.
        """
        return replace(self, bias=(bias, *self.bias[1:]))

    def _apart(self, temperature: Floats) -> Floats:
        apart: Floats = np.clip(np.asarray(temperature, dtype=float), self.low_c, self.high_c) - self.reference_c
        return apart


def compensate(
    counts: np.ndarray, temperature: np.ndarray, sign: int, scale: float, compensation: Compensation
) -> np.ndarray:
    """Rate [T], deg/s, of counts [T] at temperatures [T], °C; scale: deg/s a count at the reference temperature.

    The temperature must be smooth already (`smooth_temperature`): white noise of the thermometer would enter the rate
    times the slope of the bias.
    """
    scales = scale * compensation.scale_factor_at(temperature)
    return to_rates(counts, sign, scales, compensation.bias_at(temperature))


def smooth_temperature(
    temperature: np.ndarray, rate_hz: float, seconds: float = 60.0, segment: np.ndarray | None = None
) -> np.ndarray:
    """Running mean [T] over `seconds`; at both ends the straight line through as many seconds.

    temperature : [T], °C, without NaN;  segment : [T] int, numbers that change where the board was off; lost frames
                  need no new number here
    White noise of the thermometer falls by √(seconds · rate_hz). A temperature that follows e^(-t/τ) is off by
    (seconds/τ)²/24 of its distance from the end.
    """
    temperature = np.asarray(temperature, dtype=float)
    half = max(round(seconds * rate_hz / 2), 1)
    edges = run_starts(segment)[1:] if segment is not None else np.empty(0, dtype=int)
    return np.concatenate([_running_mean(part, half) for part in np.split(temperature, edges)])


def _running_mean(values: np.ndarray, half: int) -> np.ndarray:
    width = 2 * half + 1
    if len(values) <= width:
        return _straight_line(values)
    level = values.mean()
    total = np.concatenate([[0.0], np.cumsum(values - level)])
    inside = (total[width:] - total[:-width]) / width + level
    return np.concatenate([_straight_line(values[:width])[:half], inside, _straight_line(values[-width:])[-half:]])


def _straight_line(values: np.ndarray) -> np.ndarray:
    """Least-squares line through values [n], at their places."""
    place = np.arange(len(values)) - (len(values) - 1) / 2
    rise = place @ values / (place @ place) if len(values) > 1 else 0.0
    return values.mean() + rise * place if len(values) else values


def scale_temperature(
    temperature: np.ndarray, scale: np.ndarray, error: np.ndarray, confidence: float = 0.95
) -> Finding:
    """Slope of S over S, ppm/K, S = 1/scale in counts per deg/s.

    temperature : [R], °C, of R calibration recordings (NaN: left out)
    scale, error : [R], deg/s a count, and their standard errors
    Weighted least squares; t interval from the scatter of the recordings, which holds what S changes from one
    switch-on to the next.
    """
    known = np.isfinite(temperature)
    temperature, scale, error = temperature[known], scale[known], error[known]
    if temperature.size < 2 or np.ptp(temperature) < FEWEST_KELVIN:
        return not_measured("needs calibration recordings at different temperatures, 1 K apart or more")
    sensitivity = float(units.parts_per_million(np.mean(scale))) / scale
    if different(temperature) < FEWEST_TEMPERATURES:
        slope = np.polyfit(temperature, sensitivity, 1)[0]
        return Finding(float(slope), math.nan, math.nan, math.nan, VALUE, "two temperatures: no limits")
    weight = error**2 if np.all(error > 0) else np.ones_like(error)
    design = np.column_stack([np.ones_like(temperature), temperature - temperature.mean()])
    fit = Errors(len(design), weight).fit(design, sensitivity)
    slope = np.array([0.0, 1.0])
    floor = MEDIAN_OF_NOISE * fit.standard_error(slope)
    note = f"{temperature.size} recordings from {temperature.min():.1f} to {temperature.max():.1f} °C"
    return signed(float(fit.estimate[1]), fit.half_width(slope, confidence), floor, note)


def different(temperature: np.ndarray) -> int:
    """How many temperatures are 1 K or more apart from the one below."""
    ordered = np.sort(temperature)
    last, number = -math.inf, 0
    for value in ordered.tolist():
        if value - last >= FEWEST_KELVIN:
            last, number = value, number + 1
    return number

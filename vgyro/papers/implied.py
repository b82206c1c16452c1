"""Closed forms: what the equations of the two papers imply for the numbers in their tables. Nothing here is typed in.

Notation of Jiang et al. (2012): N = angle random walk of a gyro, deg/s/√Hz, two-sided; D = 1'R⁻¹1; q = process noise,
deg²/s³; τ = time constant of the Markov rate model, s; s = √(1/τ² + Dq), rad/s: the filter is a low-pass of pole s.
The filter's own formulas (D, s, bandwidth, gain, Allan ratio) are those of vgyro.fusion.design.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Implied:
    """value : None where no equation gives the cell;  how : what it follows from, or why nothing does"""

    value: float | None
    how: str


def alike(arw: float, gyros: int, correlation: float = 0.0) -> np.ndarray:
    """R of identical gyros with one correlation factor, (deg/s)²/Hz (J eq. 6).  arw : deg/s/√Hz, two-sided"""
    return arw**2 * ((1.0 - correlation) * np.eye(gyros) + correlation)


def allan_minimum(white: float, walk: float) -> float:
    """Least value of √(N²/τ + K²τ/3), deg/s: √(2NK/√3).  white : N, deg/s/√Hz;  walk : K, deg/s/√s"""
    return math.sqrt(2.0 * white * walk / math.sqrt(3.0))


def flat_floor(white: float, walk: float, minimum: float) -> float:
    """The flat part that lifts the minimum of N and K to `minimum`, deg/s; 0 where N and K alone reach above it."""
    return math.sqrt(max(minimum**2 - allan_minimum(white, walk) ** 2, 0.0))


def allan_reading(white: float, walk: float, minimum: float, shape: float = 1.0, averaging: float = 1.0) -> float:
    """Allan deviation as read at τ = `averaging`, deg/s: white noise × `shape`, flat floor and rate random walk.

    minimum : of the whole curve, deg/s, from which the floor follows (flat_floor)
    """
    floor = flat_floor(white, walk, minimum)
    return math.sqrt((white * shape) ** 2 / averaging + floor**2 + walk**2 * averaging / 3.0)


def average_factor(correlation: np.ndarray) -> float:
    """White noise of the average of identical gyros over that of one: √(1'C1)/N = √((1 + (N-1)·mean ρ)/N)."""
    return float(math.sqrt(correlation.sum()) / len(correlation))


def mean_correlation(correlation: np.ndarray) -> float:
    """Mean of the off-diagonal factors."""
    n = len(correlation)
    return float((correlation.sum() - np.trace(correlation)) / (n * (n - 1)))


def correlation_of_average(singles: np.ndarray, average: float) -> float:
    """The common correlation factor at which the average of these gyros has this deviation.

    (N·average)² = Σ s_i² + ρ·Σ_{i≠j} s_i s_j
    """
    squares = float((singles**2).sum())
    cross = float(singles.sum()) ** 2 - squares
    return float(((len(singles) * average) ** 2 - squares) / cross)


def uncorrelated_average(singles: np.ndarray) -> float:
    """Deviation of the average of uncorrelated gyros: √(Σ s_i²)/N."""
    return float(np.sqrt((singles**2).sum()) / len(singles))


def best_fixed_weights(singles: np.ndarray) -> float:
    """Least deviation that fixed weights can give to uncorrelated gyros: 1/√(Σ 1/s_i²)."""
    return float(1.0 / np.sqrt((singles**-2.0).sum()))


@dataclass(frozen=True)
class SampledFilter:
    """The filter as it runs (J eq. 14), after a gyro with one pole: x_k = φ x_{k-1} + g(1 - φ) z_k, φ = e^{-sT}.

    x_k is compared with the rate at sample k: the one-sample delay of the printed eq. 14 is left out, as it only shifts
    the output by T.  s : rad/s;  period : T, s;  gain : g, DC gain;  sensor_hz : pole of the gyro, Hz
    """

    s: float
    period: float
    gain: float = 1.0
    sensor_hz: float = math.inf

    def response(self, frequency_hz: float) -> complex:
        """Response of the filter alone to a sine."""
        phi = math.exp(-self.s * self.period)
        turn = complex(math.cos(w := 2.0 * math.pi * frequency_hz * self.period), -math.sin(w))
        return self.gain * (1.0 - phi) / (1.0 - phi * turn)

    def delay(self, frequency_hz: float) -> float:
        """Phase delay at a frequency, s."""
        response = self.response(frequency_hz)
        return -math.atan2(response.imag, response.real) / (2.0 * math.pi * frequency_hz)

    def noise_sigma(self, density: float) -> float:
        """1σ of the output for white noise of a two-sided density, deg/s/√Hz, before the gyro's pole.

        The pole and the filter are two first-order low-passes in a row: σ² = n²·s·c/(2(s + c)), c = 2π·sensor_hz.
        """
        if math.isinf(self.sensor_hz):
            return abs(self.gain) * density * math.sqrt(self.s / 2.0)
        pole = 2.0 * math.pi * self.sensor_hz
        return abs(self.gain) * density * math.sqrt(self.s * pole / (2.0 * (self.s + pole)))

    def sine_error_sigma(
        self, amplitude: float, frequency_hz: float, noise: float, aligned: bool, chain: bool = False
    ) -> float:
        """1σ of output minus true sine: raw, or with the delay removed, with noise of 1σ `noise` on it.

        chain : the gyro's pole and the one-sample delay of the printed eq. 14 change the sine too
        """
        response = self.response(frequency_hz)
        if chain:
            turn = complex(math.cos(w := 2.0 * math.pi * frequency_hz * self.period), -math.sin(w))
            response *= turn / complex(1.0, frequency_hz / self.sensor_hz)
        error = amplitude * abs(1.0 - (abs(response) if aligned else response))
        return math.hypot(error / math.sqrt(2.0), noise)


def one_pole_sigma(density: float, sensor_hz: float) -> float:
    """1σ of white noise of a two-sided density after one pole at f_c: n·√(2π·f_c/2)."""
    return density * math.sqrt(math.pi * sensor_hz)


def unconditional_sd(omega: float, alpha: float, beta: float) -> float:
    """Standard deviation that a GARCH(1,1) settles to, √(α0/(1 - α - β))."""
    return math.sqrt(omega / (1.0 - alpha - beta))


def arch_lm_p(statistic: float, lags: int = 1) -> float:
    """Probability of an LM statistic under chi² with `lags` degrees of freedom (Engle 1982)."""
    from scipy.stats import chi2

    return float(chi2.sf(statistic, lags))

"""Noise of an array of gyros: white, flicker, rate random walk, correlated and with changing volatility.

Conventions (two-sided densities, deg/s):  white N deg/s/√Hz has N·√rate a sample;  flicker has the density B²/(2πf);
a rate random walk adds K·√T a sample.  Every function takes unit noise from its caller or a Generator: no hidden state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats

BLOCK_HZ = 1.0
PIECE = 1 << 18


@dataclass(frozen=True)
class Volatility:
    """GARCH(1,1) margins and DCC(1,1) correlation of the one-second means.

    omega, alpha, beta : [N], (deg/s)², 1, 1;  a, b : DCC;  target : [N, N] correlation S
    """

    omega: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    a: float
    b: float
    target: np.ndarray


@dataclass(frozen=True)
class White:
    """noise : [T, N], deg/s;  block_index : [T], second of each sample

    sd : [M, N], deg/s, conditional s.d. √h of the mean of each second, which is the density N in deg/s/√Hz
    """

    noise: np.ndarray
    sd: np.ndarray
    block_index: np.ndarray


def correlation_matrix(value: float | tuple[tuple[float, ...], ...], gyros: int) -> np.ndarray:
    """[N, N] from one factor for every pair, or from the rows of the matrix."""
    if isinstance(value, float):
        return np.where(np.eye(gyros, dtype=bool), 1.0, value)
    return np.array(value)


class ModulatedWhite:
    """White noise whose one-second means are a GARCH(1,1)/DCC(1,1) process.

    Second t has n samples. z_t = Σ u_k / √n is standard normal, and so is every z_t given the past. The recursion
    (Liu et al. 2015, eq. 1, 4-6) runs on ε_t = R_t^½ z_t, r_t = √h_t ε_t:
        h_t = ω + α r²_{t-1} + β h_{t-1}        Q_t = (1-a-b) S + a ε_{t-1}ε'_{t-1} + b Q_{t-1}
    with R_t = diag(Q_t)^-½ Q_t diag(Q_t)^-½, R^½ its Cholesky factor, h_1 = ω/(1-α-β), Q_1 = S. Then every sample of
    second t is √rate · D_t R_t^½ u_k. Its mean over the second is D_t R_t^½ z_t = r_t, exactly, when rate_hz is a whole
    number (else up to √(rate_hz/n)); within the second the noise is white, of density √h_t and of the same correlation.
    So there is nothing to interpolate, and the reading at any τ is consistent with that at 1 s.
    """

    def __init__(self, rate_hz: float, volatility: Volatility) -> None:
        self._rate_hz, self._volatility = rate_hz, volatility
        self._h = volatility.omega / (1.0 - volatility.alpha - volatility.beta)
        self._q = volatility.target.copy()
        self._rows = 0

    def next(self, unit: np.ndarray) -> White:
        """The next whole seconds.  unit : [T, N], independent standard normal numbers u_k"""
        samples, gyros = unit.shape
        index = np.floor(np.arange(self._rows, self._rows + samples) * BLOCK_HZ / self._rate_hz + 1e-9).astype(np.int64)
        index -= index[0]
        self._rows += samples
        counts = np.bincount(index)
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        z = np.add.reduceat(unit, starts, axis=0) / np.sqrt(counts)[:, None]
        sd, factor = self._path(z)
        noise = np.empty_like(unit)
        for gyro in range(gyros):
            # Lower-triangular product, row by row: never builds a [T, N, N] array.
            mixed = np.zeros(samples)
            for other in range(gyro + 1):
                mixed += factor[index, gyro, other] * unit[:, other]
            noise[:, gyro] = np.sqrt(self._rate_hz) * sd[index, gyro] * mixed
        return White(noise, sd, index)

    def _path(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """From unit noise z [M, N]: s.d. [M, N] and Cholesky factor of the correlation [M, N, N] of each second."""
        blocks, gyros = z.shape
        v, h, q = self._volatility, self._h, self._q
        sd = np.empty((blocks, gyros))
        factor = np.empty((blocks, gyros, gyros))
        lower = np.linalg.cholesky(v.target)
        for block in range(blocks):
            sd[block] = np.sqrt(h)
            if v.a + v.b > 0:
                scale = 1.0 / np.sqrt(np.diag(q))
                lower = np.linalg.cholesky(q * np.outer(scale, scale))
            factor[block] = lower
            epsilon = lower @ z[block]
            h = v.omega + h * (v.alpha * epsilon**2 + v.beta)
            q = (1.0 - v.a - v.b) * v.target + v.a * np.outer(epsilon, epsilon) + v.b * q
        self._h, self._q = h, q
        return sd, factor


def unit_flicker(samples: int, generator: np.random.Generator) -> Floats:
    """Flicker noise with B = 1: two-sided density 1/(2πf); [T], mean zero over the stretch, in single precision.

    Independent normal Fourier coefficients of the right variance at every bin of a stretch twice as long, of which the
    first half is kept: the density is exact from 1/(2·duration) to half the rate, and the end does not join the start.
    What lies below 1/(2·duration) looks like a constant over the stretch; the mean is taken out, so that it is the
    constant bias alone. Expected Allan deviation: 0.664 within 1 % from 8 samples to a third of the stretch (1.09 times
    that at one sample, as the density ends at half the rate); one stretch scatters by a fifth at a tenth of its length.
    Needs 40 bytes a sample while it works.
    """
    from scipy.fft import irfft, next_fast_len

    length = next_fast_len(2 * samples, real=True)
    bins = length // 2 + 1
    spectrum = np.empty(bins, dtype=np.complex64)
    for part in (spectrum.real, spectrum.imag):
        for first in range(0, bins, PIECE):
            part[first : first + PIECE] = generator.standard_normal(min(PIECE, bins - first))
    # A bin of the DFT of noise with density S has E|X|² = S·length·rate; with f = k·rate/length the rate cancels.
    for first in range(0, bins, PIECE):
        number = np.arange(first, min(first + PIECE, bins))
        spectrum[first : first + PIECE] *= length / np.sqrt(4.0 * np.pi * np.maximum(number, 1))
    spectrum[0] = 0.0
    if length % 2 == 0:
        spectrum[-1] = spectrum[-1].real * np.sqrt(2.0)
    stretch: Floats = irfft(spectrum, length, overwrite_x=True)[:samples].copy()
    stretch -= stretch.mean(dtype=np.float64)
    return stretch


class UnitRandomWalk:
    """Random walk with K = 1 deg/s/√s that starts at 0."""

    def __init__(self, rate_hz: float, generator: np.random.Generator) -> None:
        self._rate_hz, self._generator = rate_hz, generator
        self._last: float | None = None

    def next(self, samples: int) -> np.ndarray:
        """The next samples, [T]."""
        steps = self._generator.standard_normal(samples) / np.sqrt(self._rate_hz)
        steps[0] = 0.0 if self._last is None else self._last + steps[0]
        walk = np.cumsum(steps)
        self._last = float(walk[-1])
        return walk


class Pole:
    """A recursive filter of order one, y_k = φ y_{k-1} + b_0 x_k + b_1 x_{k-1}, along axis 0, piece after piece."""

    def __init__(self, phi: float, numerator: list[float], steady: bool) -> None:
        """steady : begin in the steady state of the first sample; else at 0"""
        self._phi, self._numerator, self._steady = phi, numerator, steady
        self._state: np.ndarray | None = None

    def next(self, values: Floats) -> Floats:
        """The next samples, [T, …]."""
        from scipy.signal import lfilter

        if self._state is None:
            self._state = (1.0 - self._numerator[0]) * values[:1] if self._steady else np.zeros_like(values[:1])
        filtered: Floats
        filtered, self._state = lfilter(self._numerator, [1.0, -self._phi], values, axis=0, zi=self._state)
        return filtered


def pole_of_noise(pole_hz: float, rate_hz: float) -> Pole:
    """White noise as it is sampled behind an analogue one-pole low-pass: y_k = φ y_{k-1} + (1-φ) x_k.

    φ = exp(-2π·pole_hz/rate_hz) is the correlation of neighbouring samples of such noise, aliases included. The density
    at low frequency stays N², so the variance is N²·rate·(1-φ)/(1+φ). Analogue noise of density N² would have the
    variance N²·π·pole_hz and, once sampled, a density larger by its aliases (13 % at 200 Hz for 40 Hz).
    """
    phi = np.exp(-2.0 * np.pi * pole_hz / rate_hz)
    return Pole(phi, [1.0 - phi, 0.0], steady=False)


def pole_of_motion(pole_hz: float, rate_hz: float) -> Pole:
    """A smooth rate behind an analogue one-pole low-pass, exact for a rate that is straight between samples.

    Gain 1 at rest, delay 1/(2π·pole_hz) at low frequency; begins in the steady state of the first sample.
    """
    phi = np.exp(-2.0 * np.pi * pole_hz / rate_hz)
    share = rate_hz / (2.0 * np.pi * pole_hz) * (1.0 - phi)
    return Pole(phi, [1.0 - share, share - phi], steady=True)

"""Noise of an array of gyros: white, flicker, rate random walk, correlated and with changing volatility.

Conventions (two-sided densities, deg/s):  white N deg/s/√Hz has N·√rate a sample;  flicker has the density B²/(2πf);
a rate random walk adds K·√T a sample.  Every function takes unit noise from its caller or a Generator: no hidden state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BLOCK_HZ = 1.0


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


def modulated_white(unit: np.ndarray, rate_hz: float, volatility: Volatility) -> White:
    """White noise whose one-second means are a GARCH(1,1)/DCC(1,1) process.

    unit : [T, N], independent standard normal numbers u_k;  rate_hz : samples a second

    Second t has n samples. z_t = Σ u_k / √n is standard normal, and so is every z_t given the past. The recursion
    (Liu et al. 2015, eq. 1, 4-6) runs on ε_t = R_t^½ z_t, r_t = √h_t ε_t:
        h_t = ω + α r²_{t-1} + β h_{t-1}        Q_t = (1-a-b) S + a ε_{t-1}ε'_{t-1} + b Q_{t-1}
    with R_t = diag(Q_t)^-½ Q_t diag(Q_t)^-½, R^½ its Cholesky factor, h_1 = ω/(1-α-β), Q_1 = S. Then every sample of
    second t is √rate · D_t R_t^½ u_k. Its mean over the second is D_t R_t^½ z_t = r_t, exactly, when rate_hz is a whole
    number (else up to √(rate_hz/n)); within the second the noise is white, of density √h_t and of the same correlation.
    So there is nothing to interpolate, and the reading at any τ is consistent with that at 1 s.
    """
    samples, gyros = unit.shape
    index = np.floor(np.arange(samples) * BLOCK_HZ / rate_hz + 1e-9).astype(np.int64)
    counts = np.bincount(index)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    z = np.add.reduceat(unit, starts, axis=0) / np.sqrt(counts)[:, None]
    sd, factor = _volatility_path(z, volatility)
    noise = np.empty_like(unit)
    for gyro in range(gyros):
        # Lower-triangular product, row by row: never builds a [T, N, N] array.
        mixed = np.zeros(samples)
        for other in range(gyro + 1):
            mixed += factor[index, gyro, other] * unit[:, other]
        noise[:, gyro] = np.sqrt(rate_hz) * sd[index, gyro] * mixed
    return White(noise, sd, index)


def _volatility_path(z: np.ndarray, volatility: Volatility) -> tuple[np.ndarray, np.ndarray]:
    """From unit noise z [M, N]: s.d. [M, N] and Cholesky factor of the correlation [M, N, N] of each second."""
    blocks, gyros = z.shape
    v = volatility
    sd = np.empty((blocks, gyros))
    factor = np.empty((blocks, gyros, gyros))
    h = v.omega / (1.0 - v.alpha - v.beta)
    q = v.target.copy()
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
    return sd, factor


def unit_flicker(samples: int, generator: np.random.Generator) -> np.ndarray:
    """Flicker noise with B = 1: two-sided density 1/(2πf); [T], mean zero over the stretch.

    Independent normal Fourier coefficients of the right variance at every bin of a stretch twice as long, of which the
    first half is kept: the density is exact from 1/(2·duration) to half the rate, and the end does not join the start.
    What lies below 1/(2·duration) looks like a constant over the stretch; the mean is taken out, so that it is the
    constant bias alone. Expected Allan deviation: 0.664 within 1 % from 8 samples to a third of the stretch (1.09 times
    that at one sample, as the density ends at half the rate); one stretch scatters by a fifth at a tenth of its length.
    """
    from scipy.fft import irfft, next_fast_len

    length = next_fast_len(2 * samples, real=True)
    bins = length // 2 + 1
    # A bin of the DFT of noise with density S has E|X|² = S·length·rate; with f = k·rate/length the rate cancels.
    amplitude = np.zeros(bins)
    amplitude[1:] = length / np.sqrt(2.0 * np.pi * np.arange(1, bins))
    spectrum = generator.standard_normal(bins) + 1j * generator.standard_normal(bins)
    spectrum *= amplitude / np.sqrt(2.0)
    if length % 2 == 0:
        spectrum[-1] = spectrum[-1].real * np.sqrt(2.0)
    stretch = irfft(spectrum, length)[:samples]
    return stretch - stretch.mean()


def unit_random_walk(samples: int, rate_hz: float, generator: np.random.Generator) -> np.ndarray:
    """Random walk with K = 1 deg/s/√s that starts at 0; [T]."""
    steps = generator.standard_normal(samples) / np.sqrt(rate_hz)
    steps[0] = 0.0
    return np.cumsum(steps)


def pole_of_noise(noise: np.ndarray, pole_hz: float, rate_hz: float) -> np.ndarray:
    """White noise [T, …] as it is sampled behind an analogue one-pole low-pass: y_k = φ y_{k-1} + (1-φ) x_k.

    φ = exp(-2π·pole_hz/rate_hz) is the correlation of neighbouring samples of such noise, aliases included. The density
    at low frequency stays N², so the variance is N²·rate·(1-φ)/(1+φ). Analogue noise of density N² would have the
    variance N²·π·pole_hz and, once sampled, a density larger by its aliases (13 % at 200 Hz for 40 Hz).
    """
    from scipy.signal import lfilter

    phi = np.exp(-2.0 * np.pi * pole_hz / rate_hz)
    return lfilter([1.0 - phi], [1.0, -phi], noise, axis=0)


def pole_of_motion(rate: np.ndarray, pole_hz: float, rate_hz: float) -> np.ndarray:
    """A smooth rate [T] behind an analogue one-pole low-pass, exact for a rate that is straight between samples.

    Gain 1 at rest, delay 1/(2π·pole_hz) at low frequency; begins in the steady state of the first sample.
    """
    from scipy.signal import lfilter

    phi = np.exp(-2.0 * np.pi * pole_hz / rate_hz)
    share = rate_hz / (2.0 * np.pi * pole_hz) * (1.0 - phi)
    numerator = [1.0 - share, share - phi]
    return lfilter(numerator, [1.0, -phi], rate, zi=[(1.0 - numerator[0]) * rate[0]])[0]

"""Random signals from which the recordings are made: poles, walks, correlated noise, changing noise. NumPy alone.

Low-passes run in the frequency domain on a circle that is LEAD longer than what is kept: no run-in, exact spectra.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from zlib import crc32

import numpy as np

from benchmarks.accuracy.scenario import Group, Volatility

LEAD_S = 20.0
GROUP = 8  # seeds
FAIR = 0.02
"""Largest error of the NEES of the biases' common part, stated as well as can be, over the seeds of a group."""


def stream(seed: int, label: str) -> np.random.Generator:
    """Random numbers for one purpose: other purposes and scenarios leave them as they are."""
    return np.random.default_rng([seed, crc32(label.encode())])


def on_circle(values: np.ndarray, response: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """values [T] or [T, N] filtered by response(frequency in cycles a sample), as if they went on in a circle."""
    spectrum = np.fft.rfft(values, axis=0)
    gain = response(np.fft.rfftfreq(len(values)))
    return np.fft.irfft(spectrum * (gain if values.ndim == 1 else gain[:, None]), len(values), axis=0)


def pole(decay: float) -> Callable[[np.ndarray], np.ndarray]:
    """Response of y(t) = a·y(t-1) + (1-a)·x(t), a = decay: gain 1 for a constant."""
    return lambda frequency: (1.0 - decay) / (1.0 - decay * np.exp(-2j * np.pi * frequency))


def delay(samples: float) -> Callable[[np.ndarray], np.ndarray]:
    """Response of a delay, whole or not."""
    return lambda frequency: np.exp(-2j * np.pi * frequency * samples)


def decay_of(pole_hz: float, rate_hz: float) -> float:
    """a of a pole, per sample: exp(-2π·pole_hz/rate_hz)."""
    return float(np.exp(-2.0 * np.pi * pole_hz / rate_hz))


def poles_in_a_row(rng: np.random.Generator, samples: int, decay: float, count: int) -> np.ndarray:
    """[T] of unit variance: white noise through `count` equal poles."""
    gain = pole(decay)
    raw = on_circle(rng.standard_normal(samples), lambda frequency: gain(frequency) ** count)
    power = np.abs(gain(np.fft.fftfreq(samples))) ** (2 * count)
    return raw / np.sqrt(power.mean())


def walks(rng: np.random.Generator, samples: int, step_sd: np.ndarray) -> np.ndarray:
    """Random walks [T, N] that begin at 0;  step_sd : [N], or [T, N] of each step"""
    gyros = step_sd.shape[-1]
    steps = rng.standard_normal((samples, gyros)) * step_sd
    steps[0] = 0.0
    return np.cumsum(steps, axis=0)


def correlation_of(groups: Sequence[Group], gyros: int) -> np.ndarray:
    """[N, N] with unit diagonal."""
    matrix = np.eye(gyros)
    for group in groups:
        for one in group.gyros:
            for other in group.gyros:
                if one != other:
                    matrix[one, other] = group.rho
    return matrix


def mixed(independent: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    """Independent noise [T, N] of unit variance → with this correlation [N, N]."""
    if np.array_equal(correlation, np.eye(len(correlation))):
        return independent
    return independent @ np.linalg.cholesky(correlation).T


def sizes(
    rng: np.random.Generator, shape: tuple[int, int], dof: float | None, share: float, factor: float
) -> np.ndarray:
    """Factor [T, N] on Gaussian noise that makes it Student's t of unit variance, with outliers."""
    size = np.ones(shape)
    if dof is not None:
        size *= np.sqrt((dof - 2.0) / rng.chisquare(dof, shape))
    if share > 0:
        size[rng.random(shape) < share] *= factor
    return size


def changing(rng: np.random.Generator, blocks: int, gyros: int, how: Volatility) -> tuple[np.ndarray, np.ndarray]:
    """DCC(1,1) with GARCH(1,1) margins of mean variance 1.

    returns : deviations [B, N], correlations [B, N, N] of each block
    """
    target = np.full((gyros, gyros), how.rho)
    np.fill_diagonal(target, 1.0)
    variance, inner = np.ones(gyros), target.copy()
    deviation, correlation = np.empty((blocks, gyros)), np.empty((blocks, gyros, gyros))
    for block in range(blocks):
        root = np.sqrt(np.diag(inner))
        correlation[block] = inner / np.outer(root, root)
        deviation[block] = np.sqrt(variance)
        shock = np.linalg.cholesky(correlation[block]) @ rng.standard_normal(gyros)
        variance = (1.0 - how.alpha - how.beta) + (how.alpha * shock**2 + how.beta) * variance
        inner = (1.0 - how.a - how.b) * target + how.a * np.outer(shock, shock) + how.b * inner
    return deviation, correlation


def balanced(seed: int, label: str, gyros: int) -> np.ndarray:
    """Standard normal constants [N] of one seed, less a part of the luck.

    Seeds 1-8, 9-16, … are groups. In a group, the mean over the seeds of (u'b)² is u'u for any weights u of up to eight
    gyros, as it is on average over many seeds: the columns of [8, N] are orthogonal. And the best statement about the
    common part that the spread allows is right: its NEES is 1 within FAIR. The common part of the biases is one number
    a seed that nobody can see, and would make the NEES of an honest method anything between .4 and 1.8.
    """
    group, place = divmod(seed - 1, GROUP)
    rng = stream(abs(group), label)
    while True:
        root, triangle = np.linalg.qr(rng.standard_normal((max(gyros, GROUP), min(gyros, GROUP))))
        drawn = np.sqrt(len(root)) * root * np.sign(np.diag(triangle))
        constants = drawn if gyros <= GROUP else drawn.T
        if abs(_common_nees(constants) - 1.0) <= FAIR:
            return constants[place]


def _common_nees(constants: np.ndarray) -> float:
    """Mean of (mean of the N)² over its variance told by their spread.  constants [seeds, N]

    (N - 1)/(N - 3)·spread²/N, of which the mean is 1 for normal variables; three times the spread for two and three.
    """
    gyros = constants.shape[1]
    wide = (gyros - 1) / (gyros - 3) if gyros > 3 else 3.0
    return float(np.mean(constants.mean(axis=1) ** 2 / (wide * constants.var(axis=1, ddof=1) / gyros)))

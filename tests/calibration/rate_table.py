"""Plateau means of gyros of known transfer on a rate table, simulated without samples, and what is true of them."""

from collections.abc import Callable

import numpy as np

from vgyro.calibration import GyroNominal, PlateauMeans, ScaleFit, fit_scale_factor
from vgyro.simulate.noise import unit_flicker

SCALE, BIAS, FULL_SCALE = 0.0149, 57.0, 300.0
STEP_HZ = 2
Transfer = Callable[[np.ndarray], np.ndarray]

_UP = np.arange(0.0, 301.0, 25.0)
LOOP = np.concatenate([_UP, _UP[-2::-1], -_UP[1:], -_UP[-2::-1]])
ONCE = np.array([0, *range(25, 301, 25), *range(-25, -301, -25), 0], dtype=float)


def straight(rate: np.ndarray) -> np.ndarray:
    """A perfectly linear gyro, deg/s."""
    return np.asarray(rate, dtype=float)


def bent(cubic_ppm: float, asymmetry_ppm: float = 0.0) -> Transfer:
    """u³ - 0.6u has the slope 0 over ±1 and is 0.4 at its ends; S⁺ - S⁻ is the asymmetry."""

    def transfer(rate: np.ndarray) -> np.ndarray:
        size = np.asarray(rate) / FULL_SCALE
        return rate + 1e-6 * FULL_SCALE * (cubic_ppm * (size**3 - 0.6 * size) / 0.4 + asymmetry_ppm / 2 * np.abs(size))

    return transfer


def lag(ppm: float) -> Transfer:
    """Output reached from below minus from above, deg/s: most at zero, nothing at the ends."""
    return lambda rate: ppm * 1e-6 * FULL_SCALE * (1 - (rate / FULL_SCALE) ** 2)


def turn(
    rates: np.ndarray,
    generator: np.random.Generator,
    tests: int,
    transfer: Transfer = straight,
    hysteresis: Transfer | None = None,
    white: float = 0.0,
    flicker: float = 0.0,
    walk: float = 0.0,
    drift: float = 0.0,
    seconds: int = 20,
    pause: int = 5,
    sign: int = 1,
) -> PlateauMeans:
    """`tests` independent tests, one a column. deg/s: white of a plateau mean, flicker B, walk K (√s), drift a second.

    Flicker and random walk are made sample by sample and averaged; their mean over the test is 0.
    """
    plateaus = len(rates)
    time = np.arange(plateaus) * (seconds + pause) + seconds / 2
    direction = np.sign(np.diff(rates, prepend=rates[:1])).astype(np.int8)
    output = transfer(rates) + drift * (time - time.mean())
    if hysteresis is not None:
        output = output + direction * hysteresis(rates) / 2
    noise = white * generator.standard_normal((tests, plateaus))
    samples = plateaus * (seconds + pause) * STEP_HZ
    for row in noise:
        slow = np.zeros(samples)
        if flicker:
            slow += flicker * unit_flicker(samples, generator)
        if walk:
            steps = np.cumsum(generator.standard_normal(samples)) / np.sqrt(STEP_HZ)
            slow += walk * (steps - steps.mean())
        row += slow.reshape(plateaus, -1)[:, : seconds * STEP_HZ].mean(axis=1)
    mean = (BIAS + sign * (output + noise) / SCALE).T
    return PlateauMeans(
        rates, mean, np.full_like(mean, white / SCALE), np.full(plateaus, 200 * seconds), time,
        np.full(plateaus, float(seconds)), np.zeros(plateaus, int), direction, np.full_like(mean, np.nan),
    )  # fmt: skip


def gyro(name: str = "g1", sign: int = 1) -> GyroNominal:
    """Nominal values that are 2.7 % off."""
    return GyroNominal(name, 0.0153, 0.0, sign, FULL_SCALE)


def fit(means: PlateauMeans, **options) -> list[ScaleFit]:
    """Every column as a gyro of its own."""
    return fit_scale_factor(means, [gyro()] * means.mean.shape[1], **options)


def truth(rates: np.ndarray, transfer: Transfer, hysteresis: Transfer | None = None) -> dict[str, float]:
    """Figures of the noiseless transfer at the rates as visited, by numpy's polyfit."""
    output = transfer(rates)
    slope, intercept = np.polyfit(rates, output, 1)
    different = np.unique(rates)
    residual = transfer(different) - np.polyval([slope, intercept], different)
    read = np.abs(different) >= 0.1 * FULL_SCALE
    up, down = (np.polyfit(rates[side], output[side], 1)[0] for side in (rates >= 0, rates <= 0))
    return {
        "scale": SCALE / slope,
        "bias": BIAS + intercept / SCALE,
        "nonlinearity_full_scale": 1e6 * np.abs(residual).max() / FULL_SCALE,
        "nonlinearity_reading": 1e6 * np.abs(residual[read] / different[read]).max(),
        "nonlinearity_rms": 1e6 * np.sqrt(np.mean(residual**2)) / FULL_SCALE,
        "asymmetry": 1e6 * (up - down) / ((up + down) / 2),
        "hysteresis": 0.0 if hysteresis is None else 1e6 * np.abs(hysteresis(different[1:-1])).max() / FULL_SCALE,
    }

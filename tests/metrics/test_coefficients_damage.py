"""Lost, outlying and clipped samples change N, B and K by less than their intervals, or the term is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vgyro import units
from vgyro.metrics import NoiseCoefficients, allan_deviation, noise_coefficients
from vgyro.metrics.outliers import find_outliers
from vgyro.metrics.sampling import Sampling
from vgyro.simulate.noise import UnitRandomWalk, unit_flicker

RATE_HZ, SAMPLES = 50.0, 180_000
N, B, K = units.arw_deg_s_rt_hz(6.17), units.deg_s(54.11), units.rrw_deg_s_rt_s(294.3)
FULL_SCALE = 300.0  # deg/s
SEEDS = [0, 1, *(pytest.param(seed, marks=pytest.mark.full) for seed in range(2, 30))]


def simulated_hour(seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    white = N * math.sqrt(RATE_HZ) * generator.standard_normal(SAMPLES)
    return white + B * unit_flicker(SAMPLES, generator) + K * UnitRandomWalk(RATE_HZ, generator).next(SAMPLES)


def bursts(seed: int, share: float, seconds: float) -> np.ndarray:
    """Mask [T] of bursts of this length, anywhere, that are together a share of the samples."""
    length = round(seconds * RATE_HZ)
    number = round(share * SAMPLES / length)
    free = np.sort(np.random.default_rng(100 + seed).choice(SAMPLES - number * length, number, replace=False))
    starts = free + length * np.arange(number)
    mask = np.zeros(SAMPLES, dtype=bool)
    mask[(starts[:, None] + np.arange(length)).ravel()] = True
    return mask


def fitted(rate: np.ndarray, lost: np.ndarray | None = None) -> NoiseCoefficients:
    """As measure does it: the samples that are there, without the outliers among them."""
    position = np.arange(len(rate)) if lost is None else np.flatnonzero(~lost)
    sampling = Sampling.of(RATE_HZ, np.zeros(len(position), dtype=int), position)
    rate = rate[position]
    outlying = find_outliers(rate, RATE_HZ, sampling.segment)
    curve = allan_deviation(rate[~outlying], RATE_HZ, sampling=sampling.without(outlying))
    return noise_coefficients(curve, replicates=100)


def check(damaged: NoiseCoefficients, whole: NoiseCoefficients) -> None:
    """Known truth: the same series, undamaged. Either is within the interval of the other."""
    for term in "NBK":
        found, truth = getattr(damaged, term), getattr(whole, term)
        assert found.low <= truth.value <= found.high, term
        assert truth.low <= found.value <= truth.high, term


def holds(damaged: NoiseCoefficients, whole: NoiseCoefficients) -> dict[str, bool]:
    """Does the interval of each damaged term hold what is found in the whole series? NaN is refused."""
    found = {term: (getattr(damaged, term), getattr(whole, term).value) for term in "NBK"}
    return {term: math.isnan(one.value) or one.low <= value <= one.high for term, (one, value) in found.items()}


@pytest.mark.parametrize("seed", SEEDS)
def test_short_losses(seed: int):
    # Losses of less than half a second end no average.
    rate = simulated_hour(seed)
    whole, damaged = fitted(rate), fitted(rate, bursts(seed, 0.01, 0.4))
    check(damaged, whole)
    assert damaged.K.high < 1.2 * whole.K.high


@pytest.mark.parametrize(("share", "seconds"), [(0.01, 2.0), (0.3, 10.0), (0.3, 360.0), (0.3, 0.4)])
@pytest.mark.parametrize("seeds", [2, pytest.param(40, marks=pytest.mark.full)])
def test_losses_that_cut_the_series(seeds: int, share: float, seconds: float):
    # Longer losses end a stretch, and where 30 % are lost all over, hardly a second is nine tenths there. The long τ
    # are gone, and what is left has its own scatter: the limits hold as often as METRICS asks of 95 % intervals.
    held = {"N": 0, "B": 0, "K": 0}
    for seed in range(seeds):
        rate = simulated_hour(seed)
        whole, damaged = fitted(rate), fitted(rate, bursts(seed, share, seconds))
        for term, inside in holds(damaged, whole).items():
            held[term] += inside
        # White noise is seen in any stretch.
        assert whole.N.low <= damaged.N.value <= whole.N.high
        assert damaged.N.high - damaged.N.low < 2 * (whole.N.high - whole.N.low)
        if seconds < 1:
            assert damaged.K.low == damaged.B.low == 0
    assert held["N"] >= 0.90 * seeds
    assert held["B"] >= 0.88 * seeds
    assert held["K"] >= 0.85 * seeds


@pytest.mark.parametrize("seed", SEEDS)
def test_outliers_and_clipped_samples(seed: int):
    rate = simulated_hour(seed)
    whole = fitted(rate)
    spoilt, generator = rate.copy(), np.random.default_rng(200 + seed)
    where = generator.choice(SAMPLES, SAMPLES // 1000, replace=False)
    spoilt[where] += generator.choice([-1, 1], len(where)) * generator.uniform(15, 60, len(where)) * rate.std()
    check(fitted(spoilt), whole)
    knocked = np.where(bursts(seed, 0.002, 0.3), FULL_SCALE, rate)
    check(fitted(knocked, knocked >= FULL_SCALE), whole)
    # Left in, either would show.
    for series in (spoilt, knocked):
        unaware = noise_coefficients(allan_deviation(series, RATE_HZ), replicates=50)
        assert not whole.N.low <= unaware.N.value <= whole.N.high

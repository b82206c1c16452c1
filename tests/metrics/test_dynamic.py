"""Dynamic errors against a known delayed and weakened reference."""

import math

import numpy as np
import pytest

from vgyro.config import MetricsOptions
from vgyro.metrics import dynamic_errors, dynamic_figures

RATE_HZ = 500.0
AMPLITUDE, FREQUENCY = 62.8, 0.25  # Jiang et al. (2012), swing test


def swing(seconds: float, gain: float = 1.0, delay: float = 0.0) -> np.ndarray:
    time = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    return gain * AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * (time - delay))


def smooth_random(seconds: float, seed: int = 1) -> np.ndarray:
    """A sum of twenty tones below 2 Hz."""
    rng = np.random.default_rng(seed)
    time = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    tones = zip(rng.uniform(0.1, 2, 20), rng.uniform(0, 6.28, 20), strict=True)
    return sum(np.sin(2 * np.pi * frequency * time + phase) for frequency, phase in tones)


@pytest.mark.parametrize(("bandwidth", "noise"), [(5.0, 0.16), (1.0, 0.0)])
def test_first_order_lag_of_a_sinusoid(bandwidth: float, noise: float):
    # Closed form: gain 1/√(1+(f/BW)²), delay atan(f/BW)/(2πf).
    gain = 1 / math.sqrt(1 + (FREQUENCY / bandwidth) ** 2)
    delay = math.atan(FREQUENCY / bandwidth) / (2 * math.pi * FREQUENCY)
    rate = swing(60, gain, delay) + noise * np.random.default_rng(1).standard_normal(int(60 * RATE_HZ)) + 0.02
    found = dynamic_errors(rate, swing(60), RATE_HZ)
    assert found.delay == pytest.approx(delay, abs=5e-5)
    assert found.amplitude == pytest.approx(gain * AMPLITUDE, rel=1e-3)
    assert found.error_mean == pytest.approx(0.02, abs=0.01)
    lag = math.sqrt(1 + gain**2 - 2 * gain * math.cos(2 * math.pi * FREQUENCY * delay)) * AMPLITUDE / math.sqrt(2)
    assert found.error_sigma == pytest.approx(math.hypot(lag, noise), rel=1e-2)
    weakened = (1 - gain) * AMPLITUDE / math.sqrt(2)
    assert found.error_sigma_aligned == pytest.approx(math.hypot(weakened, noise), rel=1e-2)
    assert found.error_sigma_scaled == pytest.approx(noise, rel=0.02, abs=1e-3)


@pytest.mark.parametrize("samples", [-37, 0, 3, 250])
def test_whole_sample_delay_of_a_random_motion(samples: int):
    truth = smooth_random(42)
    rate = 0.9 * np.roll(truth, samples)[1000:-1000]
    found = dynamic_errors(rate, truth[1000:-1000], RATE_HZ)
    assert found.delay == pytest.approx(samples / RATE_HZ, abs=1e-6)
    assert found.gain == pytest.approx(0.9, rel=1e-6)
    assert found.error_sigma_scaled < 1e-5


def test_gaps_do_not_disturb():
    truth = smooth_random(60)
    rate = np.roll(truth, 5)
    kept = np.r_[500:12_000, 14_000:29_000]
    segment = np.repeat([0, 1], [11_500, 15_000])
    found = dynamic_errors(rate[kept], truth[kept], RATE_HZ, segment)
    assert found.delay == pytest.approx(0.01, abs=1e-6)
    assert found.error_sigma_scaled < 1e-5


def test_constant_reference_has_no_delay():
    rate = 40.1 + 0.05 * np.random.default_rng(2).standard_normal(20_000)
    found = dynamic_errors(rate, np.full(20_000, 40.0), RATE_HZ)
    assert found.error_mean == pytest.approx(0.1, abs=0.002)
    assert found.error_sigma == pytest.approx(0.05, rel=0.03)
    assert math.isnan(found.delay)
    assert "does not change" in found.note


def test_too_short_has_a_note():
    assert "fewer than 2" in dynamic_errors(np.ones(1), np.ones(1), RATE_HZ).note
    assert "gap-free" in dynamic_errors(swing(2), swing(2), RATE_HZ).note


def test_figures_of_an_array():
    # Known truth: 4 gyros of 1σ = 1.5, their mean has half of that; a lagging filter of gain 0.9.
    rng = np.random.default_rng(3)
    truth = swing(60)
    gyros = truth[:, None] + 1.5 * rng.standard_normal((truth.size, 4)) + np.array([0.2, -0.1, 0.1, 0.2])
    values = np.column_stack([gyros, gyros.mean(axis=1), swing(60, 0.9, 0.05)])
    figures = dynamic_figures(
        list(values.T), truth, RATE_HZ, np.zeros(truth.size, dtype=int), 4, MetricsOptions(bootstrap=200)
    )
    average, lagging = figures[4], figures[5]
    assert average["if_sigma"].low <= 2.0 <= average["if_sigma"].high
    assert average["if_sigma"].value == pytest.approx(2.0, rel=0.02)
    assert average["if_mean"].value == pytest.approx(1.5, rel=0.3)
    assert lagging["delay"].value == pytest.approx(0.05, abs=1e-5)
    assert lagging["amplitude"].value == pytest.approx(0.9 * AMPLITUDE, rel=1e-4)
    assert average["delay"].low <= 0 <= average["delay"].high
    assert average["amplitude"].low <= AMPLITUDE <= average["amplitude"].high
    assert "if_sigma" not in figures[0]
    for row in figures:
        assert row["error_sigma"].low <= row["error_sigma"].value <= row["error_sigma"].high


def test_unknown_reference_is_a_note_not_an_error():
    figures = dynamic_figures(
        [np.ones(100)] * 2, np.full(100, np.nan), RATE_HZ, np.zeros(100, dtype=int), 1, MetricsOptions(bootstrap=50)
    )
    assert math.isnan(figures[0]["error_sigma"].value)
    assert figures[0]["error_sigma"].note

"""Dynamic errors against a known delayed and weakened reference."""

import math

import numpy as np
import pytest

from vgyro.config import MetricsOptions
from vgyro.metrics import dynamic_errors
from vgyro.metrics.dynamic.figures import dynamic_figures

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


def test_nees_of_a_white_error():
    # Known truth: (error/sd)² has mean 1 where sd is right, 4 where it is half of that; 95.4 % lie within ±2 s.d.
    truth = swing(60)
    sd = np.linspace(0.5, 1.5, truth.size)
    rate = truth + sd * np.random.default_rng(8).standard_normal(truth.size)
    reference = np.where(np.arange(truth.size) < 200, np.nan, truth)
    options = MetricsOptions(bootstrap=200)
    rows = dynamic_figures(
        [rate] * 4, reference, RATE_HZ, np.zeros(truth.size, int), 1, options,
        deviation=[None, sd, sd / 2, np.zeros(truth.size)].__getitem__,
    )  # fmt: skip
    assert "nees" not in rows[0]
    for row, expected in zip(rows[1:3], (1.0, 4.0), strict=True):
        # Mean of 29,800 chi² of one degree of freedom: s.d. √(2/29,800) = 0.8 %.
        assert row["nees"].value == pytest.approx(expected, rel=0.03)
        assert row["nees"].low < row["nees"].value < row["nees"].high
        assert row["nees"].high / row["nees"].low == pytest.approx(1 + 4 * math.sqrt(2 / 29_800), abs=0.02)
    inside = float(rows[1]["nees"].note.split(" ")[0])
    assert inside == pytest.approx(95.45, abs=0.5)
    assert rows[1]["nees"].note.split("; ")[0].endswith("% of the samples within ±2 s.d.")
    assert math.isnan(rows[3]["nees"].value)
    assert "not positive" in rows[3]["nees"].note


def test_limits_of_nees_know_that_errors_last():
    # An error that keeps for 2 s (first order): the limits hold 1 in about 95 of 100 tries; 88 % is far too few.
    from scipy.signal import lfilter

    truth, options, held = swing(60), MetricsOptions(bootstrap=200), 0
    keep = math.exp(-1 / (2 * RATE_HZ))
    for seed in range(40):
        white = np.random.default_rng(seed).standard_normal(truth.size + 5000)
        error = lfilter([math.sqrt(1 - keep**2)], [1, -keep], white)[5000:]
        found = dynamic_figures(
            [truth + error], truth, RATE_HZ, np.zeros(truth.size, int), 1, options,
            deviation=lambda _: np.ones(truth.size),
        )[0]["nees"]  # fmt: skip
        held += found.low <= 1 <= found.high
    assert held >= 30


def test_unknown_reference_is_a_note_not_an_error():
    figures = dynamic_figures(
        [np.ones(100)] * 2, np.full(100, np.nan), RATE_HZ, np.zeros(100, dtype=int), 1, MetricsOptions(bootstrap=50)
    )
    assert math.isnan(figures[0]["error_sigma"].value)
    assert figures[0]["error_sigma"].note


def first_order(values: np.ndarray, bandwidth: float) -> np.ndarray:
    """Low-pass of a series: its exact solution for an input that is straight between samples; starts settled."""
    from scipy.signal import cont2discrete, lfilter, lfilter_zi

    pole = 2 * math.pi * bandwidth
    b, a, _ = cont2discrete(([pole], [1, pole]), 1 / RATE_HZ, method="foh")
    b = np.ravel(b)
    return lfilter(b, a, values, zi=lfilter_zi(b, a) * values[0])[0]


@pytest.mark.parametrize("bandwidth", [0.1, 1.0, 5.0])
def test_phase_of_a_first_order_low_pass(bandwidth: float):
    # Closed form: -atan(f/BW); Chang et al. (2012). Noise of 0.16 deg/s beside 62.8: about 0.01 degrees.
    rng = np.random.default_rng(5)
    rate = first_order(swing(200), bandwidth)[int(80 * RATE_HZ) :]
    truth = swing(200)[int(80 * RATE_HZ) :]
    rate = rate + 0.16 * rng.standard_normal(rate.size)
    (row,) = dynamic_figures([rate], truth, RATE_HZ, np.zeros(rate.size, int), 1, MetricsOptions(bootstrap=200))
    expected = -math.degrees(math.atan(FREQUENCY / bandwidth))
    assert row["phase"].value == pytest.approx(expected, abs=0.03)
    assert row["phase"].low < row["phase"].value < row["phase"].high
    assert row["phase"].low - 0.02 < expected < row["phase"].high + 0.02
    assert row["phase"].note == "at 0.25 Hz"
    gain = 1 / math.sqrt(1 + (FREQUENCY / bandwidth) ** 2)
    assert row["amplitude"].value == pytest.approx(gain * AMPLITUDE, rel=1e-3)
    assert "sinusoid" not in row["amplitude"].note


def test_limits_of_the_phase_hold_it():
    # 60 tries with noise of 20 deg/s; 95 % limits hold the truth in 57 on average, in 52 or more but once in 100.
    truth, options = swing(40), MetricsOptions(bootstrap=200)
    held = 0
    for seed in range(60):
        rate = swing(40, 0.9, 0.1) + 20 * np.random.default_rng(seed).standard_normal(truth.size)
        phase = dynamic_figures([rate], truth, RATE_HZ, np.zeros(truth.size, int), 1, options)[0]["phase"]
        held += phase.low <= -9.0 <= phase.high
    assert held >= 52


def test_a_fast_sinusoid_lags_by_less_than_half_a_period():
    # At 4 Hz the correlation is as high a period later; noise would choose any. 0.08 s of 0.25 s is a lag of 115.2 deg.
    time = np.arange(int(30 * RATE_HZ)) / RATE_HZ
    truth = np.sin(2 * np.pi * 4.0 * time)
    for seed in range(5):
        rate = 0.7 * np.sin(2 * np.pi * 4.0 * (time - 0.08)) + 0.3 * np.random.default_rng(seed).standard_normal(
            time.size
        )
        found = dynamic_errors(rate, truth, RATE_HZ)
        assert found.delay == pytest.approx(0.08, abs=2e-3)
        assert found.phase == pytest.approx(-115.2, abs=3.0)
        assert found.frequency == pytest.approx(4.0, abs=1e-9)


def test_no_sinusoid_has_no_phase():
    truth = smooth_random(42)
    row = dynamic_figures([0.9 * truth], truth, RATE_HZ, np.zeros(truth.size, int), 1, MetricsOptions(bootstrap=50))[0]
    assert math.isnan(row["phase"].value)
    assert row["phase"].note == "the reference is no sinusoid"
    assert "no sinusoid: √2 times the r.m.s." in row["amplitude"].note
    assert row["amplitude"].value == pytest.approx(0.9 * math.sqrt(2) * truth.std(), rel=1e-6)
    # One and a half periods could be anything.
    short = dynamic_errors(swing(6), swing(6), RATE_HZ)
    assert math.isnan(short.frequency)


def test_angle_of_an_error_in_motion():
    # White error of 0.1 deg/s at 500 Hz: N = 0.1/√500, r.m.s. N·√(60·(1 - 60/400)) of the angle in 60 s.
    truth = swing(400)
    rate = truth + 3.0 + 0.1 * np.random.default_rng(6).standard_normal(truth.size)
    row = dynamic_figures([rate], truth, RATE_HZ, np.zeros(truth.size, int), 1, MetricsOptions(bootstrap=50))[0]
    expected = 0.1 / math.sqrt(RATE_HZ) * math.sqrt(60 * (1 - 60 / 400))
    assert row["angle_drift_60s"].low < expected < row["angle_drift_60s"].high
    assert row["angle_drift_60s"].value == pytest.approx(expected, rel=0.4)
    few = dynamic_figures(
        [rate[:30_000]], truth[:30_000], RATE_HZ, np.zeros(30_000, int), 1, MetricsOptions(bootstrap=50)
    )
    assert few[0]["angle_drift_60s"].note == "shorter than 180 s"

"""Whitening: what is taken out is what was put in, and what is left is white, of constant variance or not."""

import numpy as np
import pytest
from scipy.signal import lfilter
from statsmodels.regression.linear_model import burg
from statsmodels.tsa.stattools import pacf_burg

from vgyro.volatility.arch_lm import arch_lm
from vgyro.volatility.effects.whiten import block_gain, fit_autoregression, running_median, whiten

SPAN = 61


def failures(make, samples: int, seeds: int, lags: int = 1) -> float:
    """Share of series whose whitened residual fails ARCH-LM at 5 %."""
    failed = 0
    for seed in range(seeds):
        residual = whiten(make(np.random.default_rng(seed), samples), 1.0, SPAN).residual
        failed += arch_lm(residual[:, None], lags).p_value[0] < 0.05
    return failed / seeds


def white(rng, samples):
    return rng.standard_normal(samples)


def random_walk(rng, samples):
    return rng.standard_normal(samples) + 0.3 * np.cumsum(rng.standard_normal(samples))


def ramp(rng, samples):
    return rng.standard_normal(samples) + np.linspace(0, 50, samples)


def toned(rng, samples):
    time = np.arange(samples)
    slow, fast = 30 * np.sin(2 * np.pi * 0.0117 * time), 3 * np.sin(2 * np.pi * 0.2303 * time)
    return rng.standard_normal(samples) + slow + fast


def correlated(rng, samples):
    return lfilter([1], [1, -0.6], rng.standard_normal(samples))


# Stated: the size on white noise is at most 5 %; a 99 % binomial limit on top for 40 series, not for 1000.
@pytest.mark.parametrize("make", [white, random_walk, ramp, toned, correlated])
def test_what_is_no_arch_passes(make):
    assert failures(make, 3600, 40) <= 6 / 40


@pytest.mark.full
@pytest.mark.parametrize("samples", [120, 360, 3600])
def test_size_on_white_noise(samples):
    # The figure to reach, for the test of arch_lm.parquet.
    assert failures(white, samples, 1000) <= 0.05


@pytest.mark.full
@pytest.mark.parametrize("samples", [120, 360, 3600])
def test_size_with_twelve_lags(samples):
    # 5 %, and the 99 % binomial limit of 1000 series: 4.9 % of 4000 other series of T = 3600 fail, 4.4 % unwhitened.
    assert failures(white, samples, 1000, lags=12) <= 0.05 + 2.33 * np.sqrt(0.05 * 0.95 / 1000)


@pytest.mark.full
@pytest.mark.parametrize("make", [random_walk, ramp, toned])
def test_size_with_drift_and_tones(make):
    assert failures(make, 3600, 400) <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / 400)


def test_tones_are_found_and_taken_out():
    # Known: amplitude, frequency; the running mean's effect on the slower one is put right.
    rng = np.random.default_rng(1)
    time = np.arange(3600)
    found = whiten(
        rng.standard_normal(3600) + 5 * np.sin(2 * np.pi * 0.0123 * time) + np.cos(2 * np.pi * 0.31 * time), 1.0, SPAN
    )
    assert [line.frequency for line in found.lines] == pytest.approx([0.0123, 0.31], abs=2e-5)
    assert [line.amplitude for line in found.lines] == pytest.approx([5, 1], abs=0.1)
    assert np.std(found.tones - 5 * np.sin(2 * np.pi * 0.0123 * time) - np.cos(2 * np.pi * 0.31 * time)) < 0.1


def test_a_tone_at_half_the_rate():
    rng = np.random.default_rng(2)
    (line,) = whiten(rng.standard_normal(3600) + 0.5 * np.tile([1.0, -1.0], 1800), 1.0, SPAN).lines
    assert line.frequency == pytest.approx(0.5, abs=2e-4)
    # A sinusoid of r.m.s. 0.5.
    assert line.amplitude == pytest.approx(0.5 * np.sqrt(2), rel=0.1)


def test_a_knock_bends_nothing_and_stays():
    rng = np.random.default_rng(3)
    plain = rng.standard_normal(2000)
    knocked = plain.copy()
    knocked[1000] += 500
    calm, found = whiten(plain, 1.0, SPAN), whiten(knocked, 1.0, SPAN)
    assert np.flatnonzero(found.disturbed).tolist() == [1000]
    assert found.residual[1000] > 490
    away = np.abs(np.arange(2000) - 1000) > 40
    assert np.abs(found.quiet - calm.quiet)[away].max() < 0.5


def test_parts_add_up():
    rng = np.random.default_rng(4)
    series = random_walk(rng, 500) + toned(rng, 500)
    found = whiten(series, 1.0, SPAN)
    rest = series - found.drift - found.tones
    filtered = lfilter(np.concatenate([[1.0], -found.autoregression]), [1.0], rest)
    np.testing.assert_allclose(found.residual, filtered, atol=1e-10)


def test_burg_finds_a_known_autoregression():
    # Known simulated truth, within five standard errors of 1/√T.
    series = lfilter([1], [1, -0.5, 0.3], np.random.default_rng(5).standard_normal(20_000))
    found = fit_autoregression(series)
    assert found[:2] == pytest.approx([0.5, -0.3], abs=5 / np.sqrt(20_000))
    assert np.abs(found[2:]).max(initial=0) < 5 / np.sqrt(20_000)
    assert fit_autoregression(np.zeros(100)).size == 0


def test_the_order_of_the_lowest_aicc():
    # Expected: statsmodels' partial correlations by Burg's method, σ² = σ₀²·Π(1 - k²), AICc of each order by its
    # definition (Hurvich & Tsai 1989), up to 20 and a sample in 20, and statsmodels' fit of the best.
    for seed, samples in ((1, 600), (2, 600), (3, 200)):
        series = lfilter([1], [1, -0.5, 0.3], np.random.default_rng(seed).standard_normal(samples))
        partial = pacf_burg(series, min(20, samples // 20), demean=False)[0][1:]
        orders = np.arange(len(partial) + 1)
        variance = np.mean(series**2) * np.cumprod(np.append(1.0, 1 - partial**2))
        best = int(np.argmin(samples * np.log(variance) + 2 * orders * samples / (samples - orders - 1)))
        assert 0 < best < len(partial)
        np.testing.assert_allclose(fit_autoregression(series), burg(series, best, demean=False)[0], atol=1e-9)


def test_running_median_follows_a_line_and_a_step_exactly():
    line = 3 + 0.1 * np.arange(200)
    np.testing.assert_allclose(running_median(line, SPAN), line, atol=1e-12)
    step = np.repeat([0.0, 1.0], 100)
    np.testing.assert_array_equal(running_median(step, SPAN), step)
    np.testing.assert_allclose(running_median(line[:20], SPAN), line[:20], atol=1e-12)


@pytest.mark.parametrize("frequency", [0.001, 0.25, 0.4997])
def test_gain_of_a_mean(frequency):
    # By hand: the mean of 7 samples of a cosine about its middle.
    by_hand = np.cos(2 * np.pi * frequency * np.arange(-3, 4)).mean()
    assert block_gain(frequency, 7) == pytest.approx(by_hand, abs=1e-12)
    assert block_gain(1.0, 7) == 1.0


@pytest.mark.parametrize(
    "series", [np.zeros(300), np.full(300, 0.1), np.arange(20.0), np.full(300, np.nan), np.empty(0)]
)
def test_nothing_to_whiten(series):
    found = whiten(series, 1.0, SPAN)
    assert np.isnan(found.residual).all()
    assert len(found.residual) == len(series)
    assert found.lines == ()

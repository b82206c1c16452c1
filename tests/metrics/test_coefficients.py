"""Noise coefficients: simulated truth, closed forms, coverage."""

import math

import numpy as np
import pytest

from vgyro.metrics import AllanCurve, allan_deviation, model_deviation, noise_coefficients
from vgyro.metrics.allan_model import low_pass_factor

N, B, K = 6.17 / 60, 54.11 / 3600, 294.3 / 216000  # Jiang et al. (2012), table 2, in deg/s units


def exact_curve(n: float, b: float, k: float, seconds: float = 3600.0) -> AllanCurve:
    """The curve that the model itself gives, with the degrees of freedom of white noise, 1.5 T/τ."""
    tau = 2.0 ** (np.arange(-12, 3 * np.log2(seconds / 3)) / 3)
    deviation = np.sqrt(n**2 / tau + 2 * math.log(2) / math.pi * b**2 + k**2 * tau / 3)
    return AllanCurve(tau, deviation, deviation, deviation, np.maximum(1.5 * seconds / tau, 1.0), np.zeros(len(tau)))


def simulate(rng: np.random.Generator, rate_hz: float, seconds: float, n: float, k: float) -> np.ndarray:
    samples = int(rate_hz * seconds)
    return n * math.sqrt(rate_hz) * rng.standard_normal(samples) + k / math.sqrt(rate_hz) * np.cumsum(
        rng.standard_normal(samples)
    )


def test_recovers_its_own_model():
    fit = noise_coefficients(exact_curve(N, B, K))
    assert (fit.N.value, fit.B.value, fit.K.value) == pytest.approx((N, B, K), rel=1e-6)
    assert fit.misfit < 1e-9
    for term, truth in zip((fit.N, fit.B, fit.K), (N, B, K), strict=True):
        assert term.low <= truth <= term.high


def test_terms_that_are_not_there_are_zero():
    fit = noise_coefficients(exact_curve(N, 0.0, 0.0))
    assert fit.N.value == pytest.approx(N, rel=1e-6)
    assert fit.B.value == pytest.approx(0, abs=1e-5)
    assert fit.K.value == pytest.approx(0, abs=1e-5)
    assert fit.B.low == fit.K.low == 0
    assert fit.B.high > 0
    assert fit.K.high > 0


def test_same_seed_same_result():
    curve = exact_curve(N, B, K)
    assert noise_coefficients(curve, seed=3) == noise_coefficients(curve, seed=3)
    assert noise_coefficients(curve, seed=3).K != noise_coefficients(curve, seed=4).K


def test_constant_and_short_curves():
    constant = noise_coefficients(allan_deviation(np.zeros(100), 1.0))
    assert constant.N.value == constant.K.high == 0
    short = noise_coefficients(allan_deviation(np.array([1.0, 2.0, 1.5, 3.0]), 1.0))
    assert math.isnan(short.N.value)
    assert "3 points" in short.note


def test_low_pass_factor_against_simulation():
    # A first-order low-pass of white noise, time constant 0.5 s, sampled 50 times faster than that.
    from scipy.signal import lfilter

    rate_hz, constant = 100.0, 0.5
    decay = math.exp(-1 / (rate_hz * constant))
    white = np.sqrt(rate_hz) * np.random.default_rng(1).standard_normal(400_000)
    curve = allan_deviation(lfilter([1 - decay], [1, -decay], white), rate_hz)
    used = (curve.tau > 0.3) & (curve.tau < 20)
    expected = np.sqrt(low_pass_factor(curve.tau[used], constant) / curve.tau[used])
    np.testing.assert_allclose(curve.deviation[used], expected, rtol=0.05)


def test_white_noise_after_a_known_low_pass():
    # METRICS: bias <= 1 % after a Kalman low-pass; one series of an hour is good to 1.5 %.
    from scipy.signal import lfilter

    rate_hz, bandwidth, gain = 50.0, 1.0, 0.9
    decay = math.exp(-2 * math.pi * bandwidth / rate_hz)
    white = N * np.sqrt(rate_hz) * np.random.default_rng(2).standard_normal(180_000)
    series = gain * lfilter([1 - decay], [1, -decay], white)
    fit = noise_coefficients(allan_deviation(series, rate_hz), bandwidth_hz=bandwidth, dc_gain=gain)
    assert fit.N.value == pytest.approx(N, rel=0.015)
    unaware = noise_coefficients(allan_deviation(series, rate_hz))
    assert fit.tau_from >= 2 / (2 * math.pi * bandwidth) - 0.02
    assert unaware.N.value < 0.96 * N


def test_the_gyros_own_low_pass_is_noticed():
    # A 40 Hz pole sampled at 200 Hz lowers σ at short τ; the fit must not follow it.
    from scipy.signal import lfilter

    rate_hz = 200.0
    decay = math.exp(-2 * math.pi * 40 / rate_hz)
    white = N * np.sqrt(rate_hz) * np.random.default_rng(3).standard_normal(240_000)
    fit = noise_coefficients(allan_deviation(lfilter([1 - decay], [1, -decay], white), rate_hz))
    assert fit.N.value == pytest.approx(N, rel=0.015)
    assert "low-pass" in fit.note


def test_quantisation_is_noticed():
    # Rounding the angle adds 3Q²/τ²; N must stay.
    rng = np.random.default_rng(4)
    angle = np.cumsum(N * np.sqrt(100.0) * rng.standard_normal(200_000)) / 100
    step = 0.1
    rate = np.diff(np.round(angle / step + rng.random()) * step) * 100
    fit = noise_coefficients(allan_deviation(rate, 100.0))
    assert fit.N.value == pytest.approx(N, rel=0.03)
    assert "quantisation" in fit.note


def test_model_deviation_is_the_fitted_curve():
    curve = exact_curve(N, B, K)
    np.testing.assert_allclose(model_deviation(curve.tau, noise_coefficients(curve)), curve.deviation, rtol=1e-5)


def test_one_hour_at_20_hz():
    # Simulated truth; limits of METRICS for N (bias 0.2 %, r.m.s. 0.5 % at 200 Hz) widened for 8 runs at 20 Hz.
    found, inside = [], np.zeros(2)
    for seed in range(8):
        fit = noise_coefficients(allan_deviation(simulate(np.random.default_rng(seed), 20.0, 3600.0, N, K), 20.0))
        found.append(fit.N.value / N - 1)
        inside += [fit.N.low <= N <= fit.N.high, fit.K.low <= K <= fit.K.high]
    assert abs(np.mean(found)) < 0.005
    assert np.sqrt(np.mean(np.square(found))) < 0.008
    assert inside.min() >= 6


@pytest.mark.full
def test_coverage_and_false_claims():
    # METRICS: 95 % intervals of N, K cover in >= 90 %, 85 % of runs; B or K claimed in <= 10 % of white-noise runs.
    inside, claims, runs = np.zeros(2), 0, 100
    for seed in range(runs):
        fit = noise_coefficients(allan_deviation(simulate(np.random.default_rng(seed), 20.0, 3600.0, N, K), 20.0))
        inside += [fit.N.low <= N <= fit.N.high, fit.K.low <= K <= fit.K.high]
        white = noise_coefficients(allan_deviation(simulate(np.random.default_rng(seed), 20.0, 3600.0, N, 0.0), 20.0))
        claims += white.B.low > 0 or white.K.low > 0
    assert inside[0] >= 0.90 * runs
    assert inside[1] >= 0.85 * runs
    assert claims <= 0.10 * runs

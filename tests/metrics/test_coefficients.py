"""Noise coefficients: simulated truth, closed forms, coverage."""

import math
from itertools import pairwise

import numpy as np
import pytest

from vgyro.metrics import AllanCurve, allan_deviation, model_deviation, noise_coefficients
from vgyro.metrics.allan.coefficient_limits import Drawing, Limits, correlation_of
from vgyro.metrics.allan.model import AllanModel, VarianceCurve, fit, low_pass_factor, solve

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


@pytest.mark.parametrize("k", [0.0, K])
def test_an_upper_limit_is_where_the_test_turns(k):
    # By definition: with the limit as the true value, the share of the draws in which less is found is the tail.
    curve = exact_curve(N, 0.0, k)
    whole = VarianceCurve(curve.tau, curve.deviation**2, curve.edf)
    model = AllanModel("NBK", curve.tau, 0.0, 1)
    squares = fit(model, whole)
    limits = Limits(model, whole, squares, Drawing(1000, 1).errors(model, squares, whole.edf), 0.025)
    for term in "NBK":
        high = limits.upper(term)
        assert limits._share_below(term, high) == pytest.approx(0.025, abs=0.012)
        assert high > squares["NBK".index(term)]


def test_how_allan_variances_at_different_tau_scatter_together():
    # Truth: 3000 simulated series of 512 samples, white noise and a random walk of the same Allan variance at 16 s. A
    # correlation of so many series is known to 0.02; the formula is that of an endless series.
    rng, tau = np.random.default_rng(1), 2.0 ** np.arange(7)
    k = math.sqrt(3.0) / 16.0
    rate = rng.standard_normal((3000, 512)) + k * np.cumsum(rng.standard_normal((3000, 512)), axis=1)
    angle = np.concatenate([np.zeros((3000, 1)), np.cumsum(rate, axis=1)], axis=1)
    found = []
    for m in tau.astype(int):
        steps = angle[:, 2 * m :] - 2 * angle[:, m:-m] + angle[:, : -2 * m]
        found.append(np.mean(steps**2, axis=1))
    simulated = np.corrcoef(found)
    squares = np.array([1.0, 0.0, k**2])
    np.testing.assert_allclose(correlation_of(AllanModel("NBK", tau, 0.0, 1), squares), simulated, atol=0.12)


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


@pytest.mark.parametrize("passes", [1, 2])
@pytest.mark.parametrize("x", [0.3, 1.0, 3.0, 20.0])
def test_low_pass_factor_against_the_integral_of_the_spectrum(passes: int, x: float):
    # σ²(τ) = 2 ∫ S(f) 2 sin⁴(πfτ)/(πfτ)² df with S = 1/(1 + (2πf Tc)²)^passes, by quadrature; of white noise 1/τ.
    from scipy.integrate import quad

    def density(f: float) -> float:
        return 4 * math.sin(math.pi * f * x) ** 4 / (math.pi * f * x) ** 2 / (1 + (2 * math.pi * f) ** 2) ** passes

    edges = np.arange(200) / x
    total = sum(quad(density, low or 1e-9, high)[0] for low, high in pairwise(edges))
    # What lies beyond 199/τ: below 4 ∫ f^-2 (πx)^-2 (2πf)^(-2·passes) df.
    assert low_pass_factor(np.array([x]), 1.0, passes)[0] == pytest.approx(x * total, rel=2e-5)


def test_white_noise_after_a_smoother():
    # The same low-pass forward and back, by scipy; the bandwidth is that of both. One series of an hour: 1.5 %.
    from scipy.signal import lfilter

    rate_hz, bandwidth = 50.0, 1.0
    decay = math.exp(-2 * math.pi * bandwidth / math.sqrt(math.sqrt(2) - 1) / rate_hz)
    white = N * np.sqrt(rate_hz) * np.random.default_rng(3).standard_normal(180_000)
    once = lfilter([1 - decay], [1, -decay], white)
    curve = allan_deviation(lfilter([1 - decay], [1, -decay], once[::-1])[::-1], rate_hz)
    fit = noise_coefficients(curve, bandwidth_hz=bandwidth, passes=2, replicates=50)
    assert fit.N.value == pytest.approx(N, rel=0.015)
    assert fit.N.low <= N <= fit.N.high
    np.testing.assert_allclose(model_deviation(curve.tau, fit, bandwidth, 2)[5:15], curve.deviation[5:15], rtol=0.05)
    other = noise_coefficients(curve, bandwidth_hz=bandwidth, passes=0, replicates=50)
    assert other.tau_from >= 1 / math.pi / bandwidth


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
    # Rounding the angle adds 3Q²/τ² with Q = step/√12, the s.d. of a uniform number (IEEE Std 952-1997), where the
    # angle moves by half a step between samples, so that the errors are independent. N must stay.
    rng = np.random.default_rng(4)
    angle = np.cumsum(N * np.sqrt(100.0) * rng.standard_normal(200_000)) / 100
    step = 0.02
    rate = np.diff(np.round(angle / step + rng.random()) * step) * 100
    fit = noise_coefficients(allan_deviation(rate, 100.0))
    assert fit.N.value == pytest.approx(N, rel=0.03)
    assert fit.Q.value == pytest.approx(step / math.sqrt(12), rel=0.01)
    assert fit.Q.low <= step / math.sqrt(12) <= fit.Q.high
    assert "quantisation" in fit.note


def test_quantisation_without_evidence_has_a_limit():
    # White noise alone; the limit is below a tenth of the variance of the first point, 3Q²/τ² = N²/(10τ).
    fit = noise_coefficients(allan_deviation(simulate(np.random.default_rng(5), 50.0, 1200.0, N, 0.0), 50.0))
    assert fit.Q.value == fit.Q.low == fit.R.value == fit.R.low == 0
    assert 0 < fit.Q.high < N * math.sqrt(0.02 / 30)
    assert fit.R.high > 0
    assert fit.note == ""


def test_quantisation_behind_a_low_pass_has_only_room():
    # A low-pass takes as much from 1/τ² as quantisation may add: what is left is 3Q²/τ² <= σ² at every τ.
    rate = simulate(np.random.default_rng(6), 50.0, 1200.0, N, 0.0)
    curve = allan_deviation(rate, 50.0)
    used = curve.tau >= 2 / (2 * math.pi)
    fit = noise_coefficients(curve, bandwidth_hz=1.0, dc_gain=0.5, replicates=50)
    assert fit.Q.value == fit.Q.low == 0
    assert fit.Q.high == pytest.approx(np.min(curve.tau * curve.high / math.sqrt(3), where=used, initial=np.inf) / 0.5)


def test_a_ramp_is_noticed():
    # Known truth: a ramp of 3 deg/s in the hour over white noise. K would else take it up.
    rate = simulate(np.random.default_rng(7), 10.0, 3600.0, N, 0.0)
    ramp = 3 / 3600
    fit = noise_coefficients(allan_deviation(rate + ramp * np.arange(len(rate)) / 10, 10.0))
    assert fit.R.low <= ramp <= fit.R.high
    assert fit.R.value == pytest.approx(ramp, rel=0.02)
    assert fit.K.low == 0
    assert "ramp" in fit.note
    assert fit.N.value == pytest.approx(N, rel=0.02)


def test_only_allan_deviations_are_fitted():
    rate = simulate(np.random.default_rng(8), 10.0, 600.0, N, 0.0)
    robust = noise_coefficients(allan_deviation(rate, 10.0, kind="robust"), replicates=50)
    assert robust.N.low <= N <= robust.N.high
    for kind in ("modified", "hadamard"):
        with pytest.raises(ValueError, match=kind):
            noise_coefficients(allan_deviation(rate, 10.0, kind=kind))


def test_model_deviation_is_the_fitted_curve():
    curve = exact_curve(N, B, K)
    np.testing.assert_allclose(model_deviation(curve.tau, noise_coefficients(curve)), curve.deviation, rtol=1e-5)


def test_terms_that_one_tau_alone_tells_are_no_error():
    """Two columns of one shape have no single solution; every one of them describes the target exactly."""
    columns, target = np.array([[1.0, 1.0], [2.0, 2.0]]), np.array([3.0, 6.0])
    unknowns, _ = solve(columns, target[None], np.ones(2), bounded=2)
    assert columns @ unknowns[0] == pytest.approx(target)
    assert (unknowns[0] >= 0).all()

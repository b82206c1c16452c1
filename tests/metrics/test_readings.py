"""The papers' readings, improvement factors and noise from differences, on simulated truth."""

import math

import numpy as np
import pytest

from vgyro.config import MetricsOptions
from vgyro.metrics import (
    FIGURES,
    AllanCurve,
    LowPass,
    Sampling,
    allan_deviation,
    improvement_factor,
    improvement_of_deviation,
    make_units,
    noise_coefficients,
    noise_from_differences,
    paper_readings,
    resample,
    spectral_density,
)
from vgyro.metrics.static.figures import static_figures
from vgyro.metrics.static.readings import bias_drift, rrw_read

N, K = 6.17 / 60, 294.28 / 216000  # Jiang et al. (2012), table 2
OPTIONS = MetricsOptions(bootstrap=200)


def even(samples: int) -> Sampling:
    return Sampling.of(50.0, np.zeros(samples, dtype=int))


def curve_of(function, seconds: float = 3600.0) -> AllanCurve:
    tau = 2.0 ** (np.arange(-9, 3 * np.log2(seconds / 3)) / 3)
    deviation = function(tau)
    return AllanCurve(tau, deviation, 0.9 * deviation, 1.1 * deviation, 1.5 * seconds / tau, np.zeros(len(tau)))


def test_white_noise_readings():
    rate = N * np.sqrt(50.0) * np.random.default_rng(1).standard_normal(180_000)
    curve = allan_deviation(rate, 50.0)
    found = paper_readings(curve, spectral_density(rate, 50.0), noise_coefficients(curve), 50.0)
    assert found["arw_1s"].low < 6.17 < found["arw_1s"].high
    assert found["arw"].value == pytest.approx(6.17, rel=0.01)
    assert found["noise_density"].value == pytest.approx(6.17 / 60, rel=0.02)
    assert "two-sided" in found["noise_density"].note
    assert found["rrw"].low == 0
    assert "not shown to exist" in found["rrw"].note
    assert "not_shown" in found["rrw"].flags
    assert set(found) <= set(FIGURES)


def test_k_is_read_off_its_line():
    # Closed form: a pure random walk of the rate, σ = K√(τ/3), read exactly; with white noise, read a little high.
    pure = rrw_read(curve_of(lambda tau: K * np.sqrt(tau / 3)))
    assert pure.value == pytest.approx(294.28, rel=1e-6)
    assert pure.low < 294.28 < pure.high
    mixed = rrw_read(curve_of(lambda tau: np.sqrt(N**2 / tau + K**2 * tau / 3)))
    assert 294.28 < mixed.value < 1.15 * 294.28
    flat = rrw_read(curve_of(lambda tau: N / np.sqrt(tau)))
    assert flat.low == 0
    assert "no rise" in flat.note
    assert flat.flags == {"upper_limit"}


def test_bias_drift_is_the_minimum():
    # Closed form: σ² = N²/τ + K²τ/3 is lowest at τ = √3·N/K, σ² = 2NK/√3.
    drift, tau = bias_drift(curve_of(lambda tau: np.sqrt(N**2 / tau + K**2 * tau / 3)))
    assert drift.value == pytest.approx(3600 * math.sqrt(2 * N * K / math.sqrt(3)), rel=0.01)
    assert tau.value == pytest.approx(math.sqrt(3) * N / K, rel=0.15)
    assert drift.note == ""
    # What a smoother lowers does not count: neither as the floor nor as the foot of the line.
    smoothed = curve_of(lambda tau: np.sqrt(N**2 / tau + K**2 * tau / 3) * np.minimum(tau / 0.5, 1) ** 6)
    assert bias_drift(smoothed)[1].value < 0.5
    assert bias_drift(smoothed, 1e9)[1].value == smoothed.tau[-1]
    assert math.isnan(rrw_read(smoothed, 1e9).value)
    drift_after, tau_after = bias_drift(smoothed, 0.5)
    assert (drift_after.value, tau_after.value) == (drift.value, tau.value)
    assert rrw_read(smoothed, 0.5).value == pytest.approx(
        rrw_read(curve_of(lambda tau: np.sqrt(N**2 / tau + K**2 * tau / 3))).value
    )
    falling, _ = bias_drift(curve_of(lambda tau: N / np.sqrt(tau)))
    assert "still falls" in falling.note
    assert falling.flags == {"upper_limit"}


def test_average_of_white_gyros_gains_root_n():
    rng = np.random.default_rng(2)
    gyros = 0.02 + N * np.sqrt(50.0) * rng.standard_normal((90_000, 6))
    values = np.column_stack([gyros, gyros.mean(axis=1)])
    found = static_figures(values.T, even(90_000), 6, [LowPass()] * 7, OPTIONS).readings
    for name in ("if_sigma", "if_arw_1s", "if_bias_drift"):
        factor = found[6][name]
        assert factor.low <= math.sqrt(6) <= factor.high, name
    assert found[6]["if_sigma"].value == pytest.approx(math.sqrt(6), rel=0.01)
    assert "not significant" not in found[6]["if_arw_1s"].note
    assert "not_significant" not in found[6]["if_arw_1s"].flags
    assert "not significant" in found[6]["if_mean"].note
    assert "not_significant" in found[6]["if_mean"].flags
    assert "if_sigma" not in found[0]
    for row in found:
        for name, reading in row.items():
            assert math.isnan(reading.low) or reading.low <= reading.value <= reading.high, name


def test_coverage_of_the_factor():
    # White gyros, true factor 2: 95 % limits hold it in 86 % of 100 runs at least.
    inside = 0
    for seed in range(100):
        gyros = np.random.default_rng(seed).standard_normal((600, 4))
        drawn = resample(make_units(np.column_stack([gyros, gyros.mean(axis=1)]), 1.0), 150, seed).sigma
        found = np.column_stack([gyros, gyros.mean(axis=1)]).std(axis=0, ddof=1)
        factor = improvement_factor(found[:4], found[4], drawn[:, :4], drawn[:, 4])
        inside += factor.low <= 2 <= factor.high
    assert inside >= 86


def test_factor_takes_the_magnitude_of_a_mean():
    replicates = np.array([[-1.0, 1.0], [-1.1, 0.9]])
    factor = improvement_factor(np.array([-1.0, 1.0]), -0.5, replicates, np.array([-0.5, -0.4]))
    assert factor.value == pytest.approx(2.0)
    assert factor.note == ""
    assert "zero" in improvement_factor(np.array([1.0]), 0.0, replicates[:, :1], np.zeros(2)).note


def test_factor_of_a_deviation_by_its_errors():
    # Independent figures: the logarithm of the ratio has the sum of both variances. Wholly correlated: nothing is left.
    independent = improvement_of_deviation(np.array([2.0]), 1.0, np.array([0.01, 0.02]), np.eye(2))
    assert independent.value == 2.0
    assert np.log(independent.high / 2.0) == pytest.approx(1.959964 * math.sqrt(0.03), rel=1e-6)
    assert independent.low * independent.high == pytest.approx(4.0)
    same = improvement_of_deviation(np.array([2.0]), 1.0, np.array([0.01, 0.01]), np.ones((2, 2)))
    assert same.high == pytest.approx(2.0)
    none = improvement_of_deviation(np.array([1.05]), 1.0, np.array([0.01, 0.02]), np.eye(2))
    assert "not significant" in none.note
    assert none.flags == {"not_significant"}
    unknown = improvement_of_deviation(np.array([2.0]), 1.0, np.array([0.01, np.inf]), np.eye(2))
    assert math.isnan(unknown.low)


def test_factor_of_a_deviation_by_the_square_of_the_correlation():
    # Closed form: mean squares of Gaussian noise of correlation ρ correlate by ρ² (Isserlis 1918); of unequal data the
    # covariance is ρ² times the smaller variance. By hand: 0.01 + 0.02 - 2·0.25·0.01 = 0.025.
    half = np.array([[1.0, 0.5], [0.5, 1.0]])
    for variance in (np.array([0.01, 0.02]), np.array([0.02, 0.01])):
        found = improvement_of_deviation(np.array([2.0]), 1.0, variance, half)
        assert np.log(found.high / 2.0) == pytest.approx(1.959964 * math.sqrt(0.025), rel=1e-6)
    # Known truth: 4000 pairs of 200 samples of ρ = 0.7. s.d. of the logarithm of the ratio of their s.d.
    rng, ρ = np.random.default_rng(2), 0.7
    first = rng.standard_normal((4000, 200))
    second = ρ * first + math.sqrt(1 - ρ**2) * rng.standard_normal((4000, 200))
    spread = float(np.std(np.log(first.std(axis=1) / second.std(axis=1))))
    found = improvement_of_deviation(np.ones(1), 1.0, np.full(2, 1 / 400), np.array([[1.0, ρ], [ρ, 1.0]]))
    assert np.log(found.high) / 1.959964 == pytest.approx(spread, rel=0.05)
    # Two single gyros have half the mean each; they are independent of each other, and ρ = 0.4 with the virtual one:
    # (1/4)(0.01 + 0.01) + 0.01 - 2·(1/2)·2·(0.16·0.01).
    third = np.array([[1.0, 0.0, 0.4], [0.0, 1.0, 0.4], [0.4, 0.4, 1.0]])
    found = improvement_of_deviation(np.array([1.0, 1.0]), 1.0, np.full(3, 0.01), third)
    assert np.log(found.high) == pytest.approx(1.959964 * math.sqrt(0.015 - 0.0032), rel=1e-6)


def test_poses_do_not_enter_sigma():
    rng = np.random.default_rng(3)
    segment = np.repeat(np.arange(10), 1500)
    values = rng.standard_normal((15_000, 2)) + 5 * rng.standard_normal((10, 1))[segment]
    found = static_figures(values.T, Sampling.of(50.0, segment), 2, [LowPass()] * 2, OPTIONS, poses=True).readings
    assert found[0]["sigma"].value == pytest.approx(1.0, rel=0.02)
    assert "pose" in found[0]["sigma"].note
    joined = static_figures(values.T, Sampling.of(50.0, segment), 2, [LowPass()] * 2, OPTIONS).readings
    assert joined[0]["sigma"].value > 2


def test_constant_series_has_figures():
    values = np.column_stack([np.full(3000, 0.5), np.random.default_rng(4).standard_normal(3000)])
    found = static_figures(values.T, even(3000), 1, [LowPass()] * 2, OPTIONS).readings
    assert found[0]["sigma"].value == 0
    assert found[0]["arw"].value == 0
    assert found[0]["bias_drift"].value == 0
    assert found[1]["if_sigma"].value == 0


def test_noise_from_differences_under_motion():
    # Known truth: common motion of 50 deg/s cancels; gyro 3 is three times as noisy.
    rng = np.random.default_rng(5)
    truth = np.array([1.0, 1.0, 3.0, 1.2]) * N
    motion = 50 * np.sin(np.arange(30_000) / 40)
    rate = motion[:, None] + truth * np.sqrt(50.0) * rng.standard_normal((30_000, 4))
    found, _ = noise_from_differences(rate.T, 50.0)
    np.testing.assert_allclose(found, truth, rtol=0.06)
    one, _ = noise_from_differences(rate.T[:1], 50.0)
    assert math.isnan(one[0])
    two, _ = noise_from_differences(rate.T[:2], 50.0)
    np.testing.assert_allclose(two, N, rtol=0.05)

"""The noise coefficients of METRICS.md's table "Figures to reach", by Monte-Carlo runs of a simulated gyro.

Truth: N = 6.17 deg/√h (two-sided), B = 54.11 deg/h, K = 294.3 deg/h/√h (Jiang et al. 2012, table 2); fixed seeds.
The full tests hold the figures themselves; the short ones have fewer runs, and each of their bounds is widened by three
standard errors of the figure over those runs, nothing else. NBS14 and Stable32 are in test_allan.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from vgyro import units
from vgyro.metrics import (
    AllanCurve,
    LowPass,
    NoiseCoefficients,
    allan_deviation,
    noise_coefficients,
    paper_readings,
    spectral_density,
)
from vgyro.simulate.noise import UnitRandomWalk, unit_flicker

TRUTH = {
    "N": units.arw_deg_s_rt_hz(6.17),
    "B": units.deg_s(54.11),
    "K": units.rrw_deg_s_rt_s(294.3),
}
WHITE = {"N": TRUTH["N"], "B": 0.0, "K": 0.0}
TIME_CONSTANT, BANDWIDTH_HZ = 0.151, 1.053  # s, Hz: the random-walk filter of Jiang et al. (2012), static test
HOUR = 3600.0


def simulate(seed: int, rate_hz: float, seconds: float, truth: dict[str, float]) -> np.ndarray:
    """Rate, deg/s [T]: white noise, flicker and random walk."""
    generator = np.random.default_rng(seed)
    samples = round(rate_hz * seconds)
    rate = truth["N"] * math.sqrt(rate_hz) * generator.standard_normal(samples)
    if truth["B"]:
        rate += truth["B"] * unit_flicker(samples, generator)
    if truth["K"]:
        rate += truth["K"] * UnitRandomWalk(rate_hz, generator).next(samples)
    return rate


def low_passed(rate: np.ndarray, rate_hz: float) -> np.ndarray:
    """What a Kalman filter of fixed gain makes of it: y_k = e^(-T/Tc)·y_{k-1} + (1 - e^(-T/Tc))·x_k."""
    from scipy.signal import lfilter

    keep = math.exp(-1 / (rate_hz * TIME_CONSTANT))
    return lfilter([1 - keep], [1, -keep], rate)


@dataclass(frozen=True)
class Runs:
    """Coefficients fitted to independent simulated series of one truth."""

    fits: tuple[NoiseCoefficients, ...]
    truth: dict[str, float]

    def errors(self, term: str) -> np.ndarray:
        """Relative errors of a coefficient, one a run."""
        return np.array([getattr(fit, term).value for fit in self.fits]) / self.truth[term] - 1

    def coverage(self, term: str) -> float:
        """Share of the runs whose limits hold the truth."""
        found = [getattr(fit, term) for fit in self.fits]
        return float(np.mean([one.low <= self.truth[term] <= one.high for one in found]))

    def claims(self, *terms: str) -> float:
        """Share of the runs in which one of the terms is said to exist."""
        return float(np.mean([any(getattr(fit, term).low > 0 for term in terms) for fit in self.fits]))


@cache
def runs(
    number: int, rate_hz: float, seconds: float, noise: str = "all", filtered: bool = False, replicates: int = 100
) -> Runs:
    truth = {"all": TRUTH, "white": WHITE}[noise]
    fits = []
    for seed in range(number):
        rate = simulate(seed, rate_hz, seconds, truth)
        if filtered:
            rate = low_passed(rate, rate_hz)
        curve = allan_deviation(rate, rate_hz)
        fits.append(noise_coefficients(curve, BANDWIDTH_HZ if filtered else None, replicates=replicates))
    return Runs(tuple(fits), truth)


def check_bias_and_rmse(errors: np.ndarray, bias: float, rmse: float, widened: bool) -> None:
    """Mean and r.m.s. of relative errors; widened : by three standard errors of each over these runs."""
    squares = errors**2
    found = math.sqrt(squares.mean())
    more = 3 / math.sqrt(len(errors)) if widened else 0.0
    assert abs(errors.mean()) <= bias + more * errors.std(ddof=1)
    assert found <= rmse + more * squares.std(ddof=1) / (2 * found)


def check_share(share: float, least: float, number: int, widened: bool) -> None:
    """A share of runs, at least a figure; widened : by three binomial standard errors at that figure."""
    assert share >= least - (3 * math.sqrt(least * (1 - least) / number) if widened else 0.0)


@pytest.fixture(params=[pytest.param(False, id="short"), pytest.param(True, id="full", marks=pytest.mark.full)])
def full(request: pytest.FixtureRequest) -> bool:
    """Do the figures themselves stand, over many runs?"""
    return bool(request.param)


def of_an_hour_at_1_hz(full: bool) -> Runs:
    return runs(400, 1.0, HOUR, replicates=500) if full else runs(60, 1.0, HOUR)


def test_an_hour_at_200_hz(full: bool):
    # METRICS: N, 1 h at 200 Hz: bias <= 0.2 %, RMSE <= 0.5 %. B and K have the same hour, whatever the rate.
    found = runs(120, 200.0, HOUR, replicates=500) if full else runs(12, 200.0, HOUR, replicates=50)
    check_bias_and_rmse(found.errors("N"), 0.002, 0.005, widened=not full)
    if full:
        check_bias_and_rmse(found.errors("B"), 0.10, 0.35, widened=False)
        check_coverage(found, widened=False)


def check_coverage(found: Runs, widened: bool) -> None:
    # METRICS: coverage of 95 % intervals: N >= .90, B >= .88, K >= .85.
    for term, least in (("N", 0.90), ("B", 0.88), ("K", 0.85)):
        check_share(found.coverage(term), least, len(found.fits), widened)


def test_an_hour_at_1_hz(full: bool):
    # METRICS: N, 1 h at 1 Hz: bias <= 1 %, RMSE <= 2.5 %.
    check_bias_and_rmse(of_an_hour_at_1_hz(full).errors("N"), 0.01, 0.025, widened=not full)


def test_b_of_an_hour(full: bool):
    # METRICS: B, 1 h: bias <= 10 %, RMSE <= 35 %.
    check_bias_and_rmse(of_an_hour_at_1_hz(full).errors("B"), 0.10, 0.35, widened=not full)


def test_k_of_an_hour(full: bool):
    # METRICS: K, 1 h: median within 10 %, RMSE <= 55 %. The s.e. of a median is √(π/2) times that of a mean.
    errors = of_an_hour_at_1_hz(full).errors("K")
    more = 0.0 if full else 3 * math.sqrt(math.pi / 2 / len(errors)) * errors.std(ddof=1)
    assert abs(np.median(errors)) <= 0.10 + more
    check_bias_and_rmse(errors, math.inf, 0.55, widened=not full)


def test_coverage_of_an_hour(full: bool):
    check_coverage(of_an_hour_at_1_hz(full), widened=not full)


def test_twelve_hours_at_1_hz(full: bool):
    # METRICS: 12 h at 1 Hz: N 1 %, B 10 %, K 15 %, taken as r.m.s. errors, which hold the bias.
    found = runs(200, 1.0, 12 * HOUR, replicates=500) if full else runs(30, 1.0, 12 * HOUR, replicates=50)
    for term, figure in (("N", 0.01), ("B", 0.10), ("K", 0.15)):
        check_bias_and_rmse(found.errors(term), figure, figure, widened=not full)
    if full:
        check_coverage(found, widened=False)


@pytest.mark.parametrize("rate_hz", [1.0, pytest.param(20.0, marks=pytest.mark.full)])
def test_white_noise_claims_nothing_else(full: bool, rate_hz: float):
    # METRICS: white noise only: B or K claimed non-zero in <= 10 % of runs. Q and R: <= 1 %, the size of their test.
    found = runs(400, rate_hz, HOUR, "white", replicates=500) if full else runs(60, rate_hz, HOUR, "white")
    number = len(found.fits)
    check_share(1 - found.claims("B", "K"), 0.90, number, widened=not full)
    # One in a hundred has a standard error of half of itself at 400 runs: both keep it.
    check_share(1 - found.claims("Q"), 0.99, number, widened=True)
    check_share(1 - found.claims("R"), 0.99, number, widened=True)


def test_after_a_kalman_low_pass(full: bool):
    # METRICS: N after a Kalman low-pass: bias <= 1 %, RMSE <= 1.5 %; what is read at 1 s is lower by 12 % (J).
    if full:
        found = runs(120, 200.0, HOUR, filtered=True, replicates=500)
        check_share(found.coverage("N"), 0.90, 120, widened=False)
    else:
        found = runs(12, 200.0, HOUR, filtered=True, replicates=50)
    check_bias_and_rmse(found.errors("N"), 0.01, 0.015, widened=not full)


def test_the_reading_at_1_s_is_said_to_be_band_limited():
    # Closed form: σ(1 s) falls to √(1 - (Tc/2)(3 - 4e^(-1/Tc) + e^(-2/Tc))) = 0.880 of the white level.
    rate = low_passed(simulate(1, 200.0, 1200.0, TRUTH), 200.0)
    curve = allan_deviation(rate, 200.0)
    fitted = noise_coefficients(curve, BANDWIDTH_HZ, replicates=50)
    found = paper_readings(curve, spectral_density(rate, 200.0), fitted, 200.0, LowPass(BANDWIDTH_HZ))
    assert "band-limited" in found["arw_1s"].note
    assert "0.88" in found["arw_1s"].note
    assert found["arw_1s"].value == pytest.approx(0.88 * 6.17, rel=0.06)
    assert found["arw"].low <= 6.17 <= found["arw"].high
    assert fitted.tau_from >= 2 * TIME_CONSTANT


def test_the_hour_is_the_limit_and_not_the_method():
    # Cramér-Rao bound of the periodogram (Whittle): no estimator of B and K from an hour scatters less, to first order.
    angular = 2 * np.pi * np.arange(1, 1800) / HOUR
    parts = np.array([np.full_like(angular, TRUTH["N"] ** 2), TRUTH["B"] ** 2 / angular, (TRUTH["K"] / angular) ** 2])
    shares = parts / parts.sum(axis=0)
    bound = np.sqrt(np.diag(np.linalg.inv(shares @ shares.T))) / 2
    found = of_an_hour_at_1_hz(False)
    for term, least in zip("NBK", bound.tolist(), strict=True):
        assert found.errors(term).std(ddof=1) <= 1.15 * least * (1 + 3 / math.sqrt(2 * len(found.fits)))


def test_the_simulated_noise_has_its_closed_form():
    # (2 ln2/π)B², K²τ/3 and N²/τ up to a third of the series: B and K would else be biased by their simulation. Four
    # standard errors of the mean of 400 series. The walk is sampled, not averaged: 1 + 1/(2m²) times that at m samples.
    taus = np.array([8.0, 32.0, 128.0, 512.0])
    forms = {"N": 1 / taus, "B": np.full(4, 2 * math.log(2) / math.pi), "K": taus / 3 * (1 + 1 / (2 * taus**2))}
    for term, form in forms.items():
        truth = {name: float(name == term) for name in TRUTH}
        squares = [allan_deviation(simulate(seed, 1.0, 1536.0, truth), 1.0, taus).deviation ** 2 for seed in range(400)]
        ratio = np.array(squares) / form
        assert np.all(np.abs(ratio.mean(axis=0) - 1) <= 0.01 + 4 * ratio.std(axis=0, ddof=1) / 20), term


def curve_with(seed: int, quantised: float = 0.0, ramp: float = 0.0) -> AllanCurve:
    """An hour at 1 Hz with angle noise of `quantised` deg and a ramp of `ramp` deg/s²."""
    rate = simulate(seed, 1.0, HOUR, TRUTH)
    angle = quantised * np.random.default_rng(1000 + seed).standard_normal(len(rate) + 1)
    return allan_deviation(rate + np.diff(angle) + ramp * np.arange(len(rate)), 1.0)


@pytest.mark.parametrize(("term", "truth"), [("Q", 0.1), ("R", 5e-4)])
def test_evidence_of_quantisation_and_ramp(full: bool, term: str, truth: float):
    # Known truth. Q: 3Q² is three times N² at 1 s. R: the ramp is 1.8 deg/s in the hour, 22 times the random walk.
    number = 200 if full else 12
    keyword = {"Q": "quantised", "R": "ramp"}[term]
    fits = tuple(
        noise_coefficients(curve_with(seed, **{keyword: truth}), replicates=200 if full else 50)
        for seed in range(number)
    )
    found = Runs(fits, TRUTH | {term: truth})
    check_share(found.claims(term), 0.95, number, widened=not full)
    check_share(found.coverage(term), 0.90, number, widened=not full)
    check_share(found.coverage("N"), 0.90, number, widened=not full)
    assert abs(np.median(found.errors(term))) <= 0.05

"""The oracle is the posterior: its s.d. is that of its errors, and no combination is better."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy.oracle import _inverse_diagonal, _precision, oracle
from benchmarks.accuracy.scenario import Motion, Scenario, load
from benchmarks.accuracy.scores import errors_of, honesty_of, inner
from benchmarks.accuracy.simulate import simulate

SEEDS = range(1, 9)


EXACT = [
    "plain", "motion_only", "pairs_m80", "all_nine", "noise_growing", "stuck", "gaps", "rate_1000", "two", "volatility",
    "bandwidth_late", "outliers", "jitter", "sixteen",
]  # fmt: skip


@pytest.mark.parametrize("name", EXACT)
def test_its_nees_is_one(name: str) -> None:
    one = load(name).shorter(60.0, 200.0)
    found = []
    for seed in SEEDS:
        recording = simulate(one, seed).motion
        known = oracle(recording, one)
        found.append(honesty_of(known.rate, known.sd, recording.truth, recording.time).nees)
    # The common bias has the right mean square over eight seeds; the rest is some hundred independent errors a seed.
    assert np.mean(found) == pytest.approx(1.0, abs=0.15 if one.gyros <= 8 else 0.3)


def test_at_rest_it_is_the_best_linear_combination() -> None:
    one = Scenario.model_validate({"rest_s": 200.0, "rrw": 0.0, "groups": [{"gyros": [0, 1], "rho": 0.5}]})
    recording = simulate(one, 1).rest
    assert recording is not None
    error = errors_of(oracle(recording, one).rate, recording.truth, recording.time, recording.rate_hz)
    correlation = np.eye(6)
    correlation[0, 1] = correlation[1, 0] = 0.5
    arw = np.asarray(one.arw)
    least = 1.0 / np.linalg.inv(np.outer(arw, arw) * correlation).sum()
    assert error.sd == pytest.approx(np.sqrt(50.0 * least), rel=0.03)


def test_between_motion_it_knows_the_rate_to_be_zero() -> None:
    one = load("sparse_free").shorter(60.0, 300.0)
    recording = simulate(one, 1).motion
    known = oracle(recording, one)
    assert (known.rate[recording.at_rest] == 0.0).all()
    moving = ~recording.at_rest & inner(recording.time)
    assert np.mean(((known.rate - recording.truth)[moving] / known.sd[moving]) ** 2) == pytest.approx(1.0, abs=0.4)


def test_an_excluded_gyro_and_known_scales_leave_the_error_as_it_is() -> None:
    plain, seed = load("plain").shorter(60.0, 120.0), 2
    errors = {}
    for name in ("plain", "scale", "one_absurd_sample", "temperature_unlogged"):
        one = load(name).shorter(60.0, 120.0).model_copy(update={"motion": plain.motion})
        recording = simulate(one, seed).motion
        errors[name] = errors_of(oracle(recording, one).rate, recording.truth, recording.time, recording.rate_hz).sd
    for name, error in errors.items():
        assert error == pytest.approx(errors["plain"], rel=0.05), name


def test_the_precision_is_the_inverse_covariance_of_the_motion() -> None:
    motion = Motion(sd=3.0, poles=2)
    band = _precision(motion, 0.7, 60)
    whole = np.diag(band[0]) + sum(
        np.diag(band[lag, : 60 - lag], -lag) + np.diag(band[lag, : 60 - lag], lag) for lag in (1, 2)
    )
    covariance = np.linalg.inv(whole)
    assert covariance[30, 30] == pytest.approx(9.0, rel=1e-3)
    # Two equal poles: autocorrelation (1 + k·(1 - a²)/(1 + a²))·a^k.
    assert covariance[30, 33] / covariance[30, 30] == pytest.approx((1 + 3 * 0.51 / 1.49) * 0.7**3, rel=1e-3)
    assert _inverse_diagonal(band) == pytest.approx(np.diag(covariance), rel=1e-9)

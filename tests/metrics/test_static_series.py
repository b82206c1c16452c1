"""Figures of series with lost samples, outliers, quantisation and drift, and what they say of each other."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vgyro.config import MetricsOptions
from vgyro.metrics import (
    Coefficient,
    LowPass,
    Reading,
    RestRecording,
    Sampling,
    noise_coefficients,
    paper_readings,
    spectral_density,
)
from vgyro.metrics.static import figures
from vgyro.metrics.static.figures import static_figures
from vgyro.metrics.static.readings import density_ratio
from vgyro.metrics.static.series import replaced

RATE_HZ = 50.0
N = 0.1
OPTIONS = MetricsOptions(bootstrap=100, welch_s=20.0)


def white(samples: int, seed: int = 1) -> np.ndarray:
    return N * math.sqrt(RATE_HZ) * np.random.default_rng(seed).standard_normal(samples)


def readings_of(values: np.ndarray, sampling: Sampling, low_pass: LowPass | None = None, **options: object) -> dict:
    chosen = OPTIONS.model_copy(update=options)
    return RestRecording.of(sampling, chosen).measure(values, low_pass or LowPass()).readings


def test_short_losses_are_counted_and_do_not_break_the_curve():
    # One frame in a hundred lost: cut at each of them, the longest average would be a few seconds.
    rate = white(60_000, 2)
    there = np.random.default_rng(2).random(len(rate)) > 0.01
    position = np.flatnonzero(there)
    segment = np.cumsum(np.diff(position, prepend=position[0] - 1) != 1)
    sampling = Sampling.of(RATE_HZ, segment, position)
    shared = RestRecording.of(sampling, OPTIONS)
    found = shared.measure(rate[there], LowPass())
    assert found.readings["missing"].value == position[-1] - position[0] + 1 - len(position)
    assert found.curve.tau[-1] > 300
    assert found.readings["arw"].low < 60 * N < found.readings["arw"].high
    whole = readings_of(rate, Sampling.of(RATE_HZ, np.zeros(len(rate), int)))
    assert found.readings["arw"].value == pytest.approx(whole["arw"].value, rel=0.003)
    # Almost every second is there for the covariances, too.
    assert len(found.seconds) > 1150


def test_the_lowest_low_pass_is_felt_in_the_drift(monkeypatch):
    # By definition: τ below some time constants 1/(2π·f) of the lowest low-pass say nothing of the drift.
    shortest = []
    monkeypatch.setattr(figures, "fit_drift", lambda *given: shortest.append(given[2]))
    sampling = Sampling.of(RATE_HZ, np.zeros(6000, int))
    filters = [LowPass(), LowPass(2.0), LowPass(0.5)]
    static_figures([white(6000, seed) for seed in range(3)], sampling, 2, filters, OPTIONS)
    static_figures([white(6000, seed) for seed in range(2)], sampling, 2, filters[:1] * 2, OPTIONS)
    assert shortest[0] == pytest.approx(figures.SETTLED / (2 * math.pi * 0.5))
    assert shortest[1] <= shortest[0]


def test_outliers_are_counted_and_change_no_coefficient():
    # One sample in a thousand 30 to 60 σ off: by itself it would raise N by 60 %.
    rate = white(60_000)
    rng = np.random.default_rng(3)
    at = 500 + 1000 * np.arange(59) + rng.integers(0, 400, 59)
    struck = rate.copy()
    struck[at] += rng.choice([-1, 1], 59) * rng.uniform(30, 60, 59) * N * math.sqrt(RATE_HZ)
    sampling = Sampling.of(RATE_HZ, np.zeros(len(rate), int))
    clean, found = readings_of(rate, sampling), readings_of(struck, sampling)
    assert (clean["outliers"].value, found["outliers"].value) == (0, 59)
    for name in ("arw", "arw_1s", "noise_density", "rrw", "bias_instability", "angle_drift_60s"):
        assert clean[name].low <= found[name].value <= clean[name].high, name
    kept = readings_of(struck, sampling, outlier_threshold=None)
    assert "outliers" not in kept
    assert kept["arw"].value > 1.2 * clean["arw"].value
    # Mean and 1σ are of all samples.
    every = static_figures(struck[None], sampling, 1, [LowPass()], OPTIONS).readings[0]
    assert every["sigma"].value == pytest.approx(np.std(struck, ddof=1))
    assert every["mean"].value == pytest.approx(np.mean(struck))


def test_what_stands_for_an_outlier():
    # By hand: the mean of ten on either side that are no outliers and of the same stretch.
    values = np.arange(30.0)
    mask = np.isin(np.arange(30), [0, 14, 15])
    segment = np.repeat([0, 1], [16, 14])
    found = replaced(values, mask, segment)
    assert found[0] == np.mean(np.arange(1, 11))
    assert found[14] == np.mean(np.arange(4, 14))
    assert found[15] == np.mean(np.arange(5, 14))
    np.testing.assert_array_equal(found[~mask], values[~mask])
    alone = replaced(values, np.arange(30) == 3, np.where(np.arange(30) == 3, 1, 0))
    assert alone[3] == 3.0


def test_density_and_n_agree_for_white_noise_and_are_told_apart_else():
    sampling = Sampling.of(RATE_HZ, np.zeros(180_000, int))
    rate = white(180_000)
    agrees = readings_of(rate, sampling)["density_ratio"]
    # METRICS.md: through √2 within 1 %, which an hour at 50 Hz can show.
    assert agrees.value == pytest.approx(1.0, abs=0.02)
    assert agrees.note == ""
    # A series whose gain for a constant is a half has half the density; N was divided by that gain.
    halved = readings_of(rate / 2, sampling, LowPass(None, 0.5))["density_ratio"]
    assert halved.value == pytest.approx(agrees.value, rel=1e-6)
    off = density_ratio(Reading(0.11, 0.109, 0.111), Coefficient(0.1, 0.099, 0.101), 0.95)
    assert off.value == pytest.approx(1.1)
    assert off.low == pytest.approx(1.1 * math.exp(-math.hypot(math.log(111 / 109) / 2, math.log(101 / 99) / 2)))
    assert "differ" in off.note
    assert density_ratio(Reading(0.1005, 0.1004, 0.1006), Coefficient(0.1, 0.0999, 0.1001), 0.95).note == ""
    assert math.isnan(density_ratio(Reading(0.1, 0.1, 0.1), Coefficient(0.0, 0.0, 0.1), 0.95).value)


def test_quantisation_and_ramp_only_on_evidence():
    sampling = Sampling.of(RATE_HZ, np.zeros(60_000, int))
    plain = readings_of(white(60_000), sampling)
    for name in ("quantisation", "rate_ramp"):
        assert plain[name].value == 0
        assert plain[name].high > 0
        assert "not shown to exist" in plain[name].note
    # Units by hand: 1 deg/s an hour is 3600 deg/h².
    found = RestRecording.of(sampling, OPTIONS).measure(white(60_000), LowPass())
    fitted = noise_coefficients(found.curve, replicates=100)
    shown = replace(fitted, Q=Coefficient(1e-3, 9e-4, 1.1e-3), R=Coefficient(1 / 3600, 0.5 / 3600, 2 / 3600))
    readings = paper_readings(found.curve, found.spectrum, shown, RATE_HZ)
    assert readings["quantisation"].value == 1e-3
    assert readings["rate_ramp"].low == pytest.approx(1800)
    assert readings["rate_ramp"].value == pytest.approx(3600)


def test_other_curves_where_they_are_asked_for():
    sampling = Sampling.of(RATE_HZ, np.zeros(20_000, int))
    shared = RestRecording.of(sampling, OPTIONS.model_copy(update={"curves": ("modified", "robust")}))
    curves = shared.measure(white(20_000), LowPass()).curves
    assert list(curves) == ["overlapping", "modified", "robust"]
    assert all(curve.kind == kind for kind, curve in curves.items())


def test_angle_drift_beside_its_bound():
    # Closed form: ∫ over 60 s of white noise has 1σ = N·√60, less what the mean of 1200 s takes off: √(1 - 60/1200).
    sampling = Sampling.of(RATE_HZ, np.zeros(60_000, int))
    found = readings_of(white(60_000, 5), sampling)
    wanted = N * math.sqrt(60) * math.sqrt(1 - 60 / 1200)
    for name in ("angle_drift_60s", "angle_bound_60s"):
        assert found[name].low <= wanted <= found[name].high, name


def test_a_low_pass_leaves_n_and_lowers_the_reading_at_one_second():
    # Tc = 0.151 s, as the issue has it: N within 1 %, σ(1 s) shown as band-limited.
    from scipy.signal import lfilter

    bandwidth = 1 / (2 * math.pi * 0.151)
    keep = math.exp(-1 / (0.151 * 200.0))
    rate = N * math.sqrt(200.0) * np.random.default_rng(6).standard_normal(720_000)
    rate = lfilter([1 - keep], [1, -keep], rate)
    sampling = Sampling.of(200.0, np.zeros(len(rate), int))
    curve_readings = readings_of(rate, sampling, LowPass(bandwidth))
    assert curve_readings["arw"].value == pytest.approx(60 * N, rel=0.01)
    assert "band-limited" in curve_readings["arw_1s"].note
    assert curve_readings["arw_1s"].value < 0.9 * 60 * N


def test_readings_by_themselves():
    # Without the measuring of a whole series: the same function, the same figures.
    rate = white(20_000)
    sampling = Sampling.of(RATE_HZ, np.zeros(len(rate), int))
    found = RestRecording.of(sampling, OPTIONS).measure(rate, LowPass())
    fitted = noise_coefficients(found.curve, None, 1.0, OPTIONS.bootstrap, OPTIONS.seed)
    alone = paper_readings(found.curve, spectral_density(rate, RATE_HZ, 20.0), fitted, RATE_HZ)
    assert {name: found.readings[name] for name in alone} == alone

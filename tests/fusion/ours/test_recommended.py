"""The rows that put the stages together: smoothed combinations and the recommended method."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import METHODS, FilterParameters, SampleWeights
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.motion.lowpass import pole_times
from vgyro.fusion.motion.models import Motion
from vgyro.fusion.motion.smoother import Smoothed
from vgyro.fusion.noise.parity import shared_variances
from vgyro.fusion.ours import prepared
from vgyro.fusion.ours import smoothed as smoothed_rows
from vgyro.fusion.ours.array_estimate import analysed, shared_motion
from vgyro.fusion.ours.recommended import static_weights
from vgyro.fusion.ours.smoothed import Signal, without_pole

RATE_HZ = 200.0
STILL = FilterParameters(bandwidth_hz=1.0)
MOVING = FilterParameters(in_motion=True, bandwidth_hz=5.0)
SMOOTHED = ("average_smoothed", "median_smoothed", "parity_smoothed", "residual_smoothed", "recommended")
ROBUST = ("residual_weights", "residual_smoothed", "recommended_unsmoothed", "recommended")


def motion(samples: int, rate_hz: float = RATE_HZ, seed: int = 3) -> np.ndarray:
    """20 deg/s of random motion up to 0.5 Hz, simulated."""
    spectrum = np.zeros(samples // 2 + 1, dtype=complex)
    inside = slice(1, int(0.5 * samples / rate_hz))
    number = inside.stop - 1
    spectrum[inside] = np.random.default_rng(seed).standard_normal((number, 2)) @ [1, 1j]
    values = np.fft.irfft(spectrum, samples)
    return values * (20.0 / values.std())


def every(weights) -> np.ndarray:
    return np.concatenate(list(weights.pieces()))


def two_sided(values: np.ndarray, bandwidth_hz: float) -> np.ndarray:
    """Closed form: Σ a^|j|·x(t-j)·(1-a)/(1+a), whose gain falls to -3 dB at bandwidth_hz; not at the ends."""
    # |G(f)| = (1-a)²/(1 - 2a·cos ω + a²) = 1/√2, solved for a.
    cosine = math.cos(2 * math.pi * bandwidth_hz / RATE_HZ)
    c = (math.sqrt(2) - cosine) / (math.sqrt(2) - 1)
    a = c - math.sqrt(c * c - 1)
    reach = 4000
    kernel = a ** np.abs(np.arange(-reach, reach + 1)) * (1 - a) / (1 + a)
    return np.convolve(values, kernel, mode="same")


def test_at_rest_the_smoother_is_a_two_sided_exponential(make_array):
    array = make_array(20_000, [0.1, 0.1, 0.1])
    fused = METHODS["average_smoothed"].fuse(array, STILL)
    middle = slice(5000, 15_000)
    expected = two_sided(array.rate.mean(axis=1), 1.0)
    np.testing.assert_allclose(fused.rate[middle], expected[middle], atol=1e-7)


@pytest.mark.parametrize("name", SMOOTHED)
def test_where_the_bandwidth_is_above_the_samples_nothing_is_smoothed(make_array, name):
    array = make_array(600, [0.1, 0.1, 0.2, 0.1], rate_hz=1.0)
    fused = METHODS[name].fuse(array, STILL)
    weighed = {"average_smoothed": "average", "median_smoothed": "median", "recommended": "recommended_unsmoothed",
               "parity_smoothed": "parity_weights", "residual_smoothed": "residual_weights"}  # fmt: skip
    np.testing.assert_allclose(fused.rate, METHODS[weighed[name]].fuse(array, STILL).rate, atol=1e-9)


def test_posterior_deviation_at_rest_follows_the_noise(make_array):
    # Simulated truth: no rate, no bias; every gyro is five times as noisy in the second half.
    errors = []
    for seed in range(8):
        array = make_array(24_000, [0.1, 0.1, 0.1, 0.1], seed=seed)
        array.rate[12_000:] *= 5.0
        fused = METHODS["recommended"].fuse(array, STILL)
        halves = (fused.rate.reshape(2, -1) / fused.sd.astype(float).reshape(2, -1)) ** 2
        errors.append(halves.mean(axis=1))
    # Some 60 independent values of 1 Hz bandwidth a half, 8 seeds; the bias' own deviation is part of the posterior.
    first, second = np.mean(errors, axis=0)
    assert 0.6 < first < 1.3
    assert 0.7 < second < 1.3


def test_posterior_deviation_at_rest_counts_the_colour(make_array):
    # Simulated truth: no rate, no bias; white noise through a pole of 40 Hz, whose long-run density is that of the
    # white noise: the deviation of the smoothed rate is that without the pole.
    keep = math.exp(-2 * math.pi * 40 / RATE_HZ)
    values = []
    for seed in range(8):
        array = make_array(24_000, [0.1, 0.1, 0.1, 0.1], seed=seed)
        for t in range(1, len(array.rate)):
            array.rate[t] = keep * array.rate[t - 1] + (1 - keep) * array.rate[t]
        fused = METHODS["recommended"].fuse(array, STILL)
        values.append(np.mean((fused.rate / fused.sd.astype(float)) ** 2))
    assert 0.7 < np.mean(values) < 1.3


def test_posterior_deviation_at_rest_is_of_the_noise_not_of_a_vibration(make_array):
    """Simulated truth: a vibration of .5 deg/s that all see, which is passed; the noise is what is left."""
    errors = []
    for seed in range(4):
        array = make_array(24_000, [0.2, 0.2, 0.2, 0.2], seed=seed)
        truth = 0.5 * np.sin(2 * math.pi * 5.0 * np.arange(24_000) / RATE_HZ)
        fused = METHODS["recommended"].fuse(replace(array, rate=array.rate + truth[:, None]), STILL)
        errors.append(np.mean(((fused.rate - truth) / fused.sd)[1000:-1000] ** 2))
    assert np.mean(errors) == pytest.approx(1.0, abs=0.35)


def test_the_motion_is_chosen_once(make_array):
    array = make_array(12_000, [0.1, 0.1, 0.2, 0.1], truth=motion(12_000), at_rest=False)
    chosen = shared_motion(array, MOVING)
    assert shared_motion(array, MOVING) is chosen
    notes = [METHODS[name].fuse(array, MOVING).note for name in SMOOTHED]
    assert all(note.startswith(chosen.text) for note in notes)
    copied = replace(array, rate=array.rate + 1.0)
    assert shared_motion(copied, MOVING) is not chosen


def test_of_unequal_gyros_less_remains_than_of_the_average(make_array):
    # Simulated truth. The smoothed best combination is better than the smoothed average by at least half of what the
    # weights gain, √(Σ1/σ²·Σσ²)/N = 2.2: a smoother's error falls with the noise to the power 0.8 or so.
    truth = motion(24_000)
    array = make_array(24_000, [0.05, 0.1, 0.1, 0.4], truth=truth, at_rest=False)
    error = {name: np.std(METHODS[name].fuse(array, MOVING).rate - truth) for name in SMOOTHED}
    assert error["recommended"] < error["average_smoothed"] / 1.5
    assert error["recommended"] < 1.02 * min(error.values())
    assert error["median_smoothed"] < error["average_smoothed"]


def test_the_pole_of_the_sensors_is_undone(make_array):
    # Closed form: a sinusoid through 1/(1 + iωτ) lags by atan(ωτ); afterwards it does not.
    array = make_array(4000, [0.1, 0.1], rate_hz=500.0)
    omega, tau = 2 * math.pi * 0.25, float(pole_times(np.array([math.exp(-2 * math.pi * 40 / 500)]), 1 / 500.0)[0])
    assert tau == pytest.approx(1 / (2 * math.pi * 40))
    time = np.arange(4000) / 500.0
    gain = 1 / (1 + 1j * omega * tau)
    seen = (gain * np.exp(1j * omega * time)).imag
    undone = without_pole(array, seen, tau)
    np.testing.assert_allclose(undone, np.sin(omega * time), atol=1e-6)


@pytest.mark.parametrize(
    "motion",
    [
        Motion(
            "oscillator",
            {"frequency_hz": 0.35, "damping": 18.6, "second_hz": 0.21, "second_damping": 0.1, "sd": 0.01},
            RATE_HZ,
        ),
        Motion("markov", {"tau_s": 0.1, "sd": 0.05}, RATE_HZ),
        Motion("random_walk", {"q": 0.01}, RATE_HZ),
    ],
    ids=lambda motion: motion.model,
)
@pytest.mark.parametrize("standing", [False, True])
def test_a_constant_rate_is_passed_whatever_the_model(make_array, monkeypatch, motion, standing):
    """Gain 1 at zero frequency: models without an integrator return to the mean of the motion, and not to zero."""
    monkeypatch.setattr(smoothed_rows, "shared_motion", lambda *_: motion)
    array = make_array(12_000, [0.1, 0.1, 0.1, 0.1])
    at_rest = np.zeros(12_000, dtype=bool)
    at_rest[:3000] = standing
    rates = [array.rate + (constant * ~at_rest)[:, None] for constant in (0.0, 0.5)]
    fused = [METHODS["recommended"].fuse(replace(array, rate=one, at_rest=at_rest), MOVING).rate for one in rates]
    # Not beside the end of the standstill, where the rate jumps.
    assert float(np.mean((fused[1] - fused[0])[6000:])) == pytest.approx(0.5, abs=2e-3)


@pytest.mark.parametrize(("part_of_pole", "undone"), [(0.49, True), (0.51, False)])
def test_the_pole_is_undone_only_below_half_its_frequency(make_array, monkeypatch, part_of_pole, undone):
    array, pole_hz = make_array(600, [0.1, 0.1, 0.1]), 40.0
    rate = np.arange(600.0)
    found = Smoothed(rate, np.ones(600), Motion("none", {}, RATE_HZ), part_of_pole * pole_hz, 1.0, 0, "")
    monkeypatch.setattr(smoothed_rows, "_in_motion", lambda *_: found)
    late_s = 1 / (2 * math.pi * pole_hz)
    fused = smoothed_rows.smoothed(array, MOVING, Signal(rate, 1.0, 0.0, None, "", late_s=late_s))
    # Of a ramp of 1 deg/s a sample the derivative is known.
    np.testing.assert_allclose(fused.rate, rate + undone * late_s * RATE_HZ, rtol=1e-9)
    assert fused.delay_s == pytest.approx(-late_s * undone)
    assert ("its delay stays" in fused.note) != undone


def test_recommended_has_no_delay_behind_a_pole(make_array):
    # Simulated: rate and noise through one low-pass of 40 Hz at 500 Hz, 4 ms late; delay by the slope of the error.
    rate_hz, samples = 500.0, 30_000
    truth = motion(samples, rate_hz)
    keep = math.exp(-2 * math.pi * 40 / rate_hz)
    late = np.interp(np.arange(samples) / rate_hz - 1 / (2 * math.pi * 40), np.arange(samples) / rate_hz, truth)
    white = make_array(samples, [0.1] * 4, rate_hz=rate_hz).rate
    for t in range(1, samples):
        white[t] = keep * white[t - 1] + (1 - keep) * white[t]
    array = replace(
        make_array(samples, [0.1] * 4, rate_hz=rate_hz, at_rest=False), rate=late[:, None] + white,
        lowpass_hz=np.full(4, 40.0),
    )  # fmt: skip
    slope = np.gradient(truth, 1 / rate_hz)
    delay = {}
    for name in ("parity_smoothed", "recommended"):
        fused = METHODS[name].fuse(array, MOVING)
        error = (fused.rate - truth)[1000:-1000]
        delay[name] = -float(error @ slope[1000:-1000] / (slope[1000:-1000] @ slope[1000:-1000]))
    assert delay["parity_smoothed"] == pytest.approx(4e-3, rel=0.15)
    assert abs(delay["recommended"]) < 4e-4
    assert METHODS["recommended"].fuse(array, MOVING).delay_s == pytest.approx(-4e-3, rel=0.1)


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("name", ROBUST)
def test_a_gyro_at_fault_has_no_weight(make_array, name, moving):
    truth = motion(12_000) if moving else 0.0
    array = make_array(12_000, [0.1, 0.1, 0.1, 0.1], truth=truth, at_rest=not moving)
    array.rate[4000:8000, 2] += 3.0
    faulty = replace(array, faults=(FaultEvent(2, "step", 4000, 8000, 30.0, 3.0, "deg/s"),))
    fused = METHODS[name].fuse(faulty, MOVING if moving else STILL)
    weights = every(fused.weights)
    assert weights[4000:8000, 2].max() < 1e-12
    assert weights[:3900, 2].min() > 0.1
    assert weights[8100:, 2].min() > 0.1


def test_variance_by_dcc_is_that_of_its_weights_and_deviations(make_array):
    # Closed form: n·Σw²h of a block of n samples; the smoothed rate is that of the weights.
    samples, seconds = 12_000, 60
    block = np.repeat(np.arange(seconds, dtype=np.int32), 200)
    rng = np.random.default_rng(5)
    weights = SampleWeights.of(rng.dirichlet(np.ones(3), seconds), block)
    table = rng.uniform(0.05, 0.15, (seconds, 3))
    key = ("dcc", "in_sample", "residual")
    array = make_array(samples, [0.1, 0.1, 0.1], weights={key: weights})
    array = replace(array, deviations={key: SampleWeights.of(table, block)})
    fused = METHODS["dcc_smoothed"].fuse(array, STILL)
    middle = slice(4500, 7500)
    expected = two_sided(weights.combine(array.rate)[0], 1.0)
    np.testing.assert_allclose(fused.rate[middle], expected[middle], atol=1e-6)


def test_static_weights_are_those_of_the_true_covariance(make_array):
    # Expected: R⁻¹1/(1'R⁻¹1) of the simulated R; 60 s at 200 Hz tell a variance to 1.3 %.
    arw, rho = np.array([0.05, 0.1, 0.1, 0.2]), 0.2
    correlation = np.full((4, 4), rho) + (1 - rho) * np.eye(4)
    array = make_array(12_000, arw, correlation=correlation)
    solved = np.linalg.solve(np.outer(arw, arw) * correlation, np.ones(4))
    expected = np.maximum(solved, 0)
    np.testing.assert_allclose(static_weights(array, STILL), expected / expected.sum(), atol=0.06)
    assert analysed(array, STILL) is analysed(array, STILL)
    other = analysed(array, replace(STILL, temperature="off"))
    assert other is not analysed(array, STILL), "other parameters, another analysis"


def test_constant_and_changing_variances_are_kept_apart(make_array):
    array = make_array(6000, [0.1, 0.1, 0.1])
    array.rate[3000:] *= 5.0
    constant, changing = (shared_variances(array, STILL, one) for one in (False, True))
    assert np.ptp(constant.variance[:, 0]) == 0
    assert changing.variance[-1, 0] > 10 * changing.variance[0, 0]


@pytest.mark.parametrize("part", ["response", "clipped", "tails"])
@pytest.mark.parametrize("moving", [False, True])
def test_what_is_mended_beforehand(monkeypatch, make_array, part, moving):
    # Rule: each part where it is not left out; answers to the motion in motion only.
    asked = []
    for name, of in (("response", "without_relative"), ("clipped", "without_clipped"), ("tails", "_without_tails")):
        found = (None, "") if name == "response" else ("",)
        monkeypatch.setattr(
            prepared, of, lambda array, *_, name=name, found=found: asked.append(name) or (array, *found)
        )
    array = make_array(400, [0.1, 0.1, 0.1], at_rest=not moving)
    prepared._prepared(array, replace(MOVING if moving else STILL, without=frozenset({part})))
    every = ["clipped", "response", "tails"] if moving else ["clipped", "tails"]
    assert asked == [name for name in every if name != part]

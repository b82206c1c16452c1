"""Answers of the gyros to the motion: scale factors, delays and poles of simulated arrays whose truth is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from vgyro.fusion.baselines.fixed import average
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.motion.lowpass import array_delay, pole_times
from vgyro.fusion.motion.relative import (
    Relative,
    motion_terms,
    relative_response,
    relative_variance,
    without_relative,
)
from vgyro.fusion.noise.reference_rate import reference, used
from vgyro.fusion.ours.recommended import recommended, recommended_unsmoothed
from vgyro.fusion.types import ArrayNoise, ArrayRates, FilterParameters

RATE_HZ, FINER = 50.0, 8
NOISE = np.array([0.02, 0.03, 0.03, 0.035, 0.04, 0.025])
"""ARW, deg/s/√Hz."""


def motion(seed: int, sd: float, seconds: int = 300) -> np.ndarray:
    """Three poles of 0.15 Hz in a row, driven by white noise, at 8 times the sample rate, deg/s."""
    finer = RATE_HZ * FINER
    settle = int(60 * finer)
    keep = math.exp(-2 * math.pi * 0.15 / finer)
    rate = np.random.default_rng(seed).standard_normal(int(seconds * finer) + settle)
    for _ in range(3):
        rate = lfilter([1 - keep], [1, -keep], rate)
    rate = rate[settle:]
    return rate * (sd / rate.std())


def array_of(seed: int, rates: list[np.ndarray], **more: object) -> ArrayRates:
    """Gyros that see `rates`, at the finer rate, with white noise, a walk of 5e-4 deg/s/√s and a bias of 0.05 deg/s."""
    rng = np.random.default_rng(1000 + seed)
    columns = []
    for one, noise in zip(rates, NOISE, strict=False):
        seen = one[::FINER]
        walk = np.cumsum(rng.standard_normal(len(seen))) * 5e-4 / math.sqrt(RATE_HZ)
        columns.append(seen + walk + noise * math.sqrt(RATE_HZ) * rng.standard_normal(len(seen)) + 0.05 * rng.normal())
    rate = np.asfortranarray(np.column_stack(columns))
    gyros = rate.shape[1]
    unknown = ArrayNoise(np.full(gyros, np.nan), np.full(gyros, np.nan), np.eye(gyros))
    none = np.zeros(len(rate), dtype=int)
    return ArrayRates(rate, RATE_HZ, none, none.astype(bool), unknown, **more)  # type: ignore[arg-type]


def scales(seed: int) -> np.ndarray:
    """Scale errors of 1-3 % of random sign [6]."""
    rng = np.random.default_rng(2000 + seed)
    return rng.uniform(0.01, 0.03, 6) * rng.choice([-1.0, 1.0], 6)


def test_scale_errors_are_within_their_intervals() -> None:
    """Of 100 recordings with scale errors of 1-3 % and 50 deg/s at least 90 % of the 95 % intervals hold the truth."""
    inside = []
    for seed in range(100):
        errors, rate = scales(seed), motion(seed, 50.0, 120)
        found = relative_response(array_of(seed, [(1 + one) * rate for one in errors]))
        assert found is not None
        truth = (1 + errors) / (1 + errors.mean()) - 1
        inside.append(np.abs(found.value[:, 0] - truth) < 1.96 * np.sqrt(np.diagonal(found.covariance[0])))
    assert np.mean(inside) >= 0.9
    assert np.mean(inside) < 0.995


def test_scale_errors_cost_nothing() -> None:
    """No worse than the average of all scales corrected to their mean: its error is the best that parity allows."""
    for seed in range(3):
        errors, rate = scales(seed), motion(seed, 50.0)
        array, truth = array_of(seed, [(1 + one) * rate for one in errors]), rate[::FINER]
        corrected = np.mean(array.rate / (1 + errors) * (1 + errors.mean()), axis=1) - truth
        moving = FilterParameters(in_motion=True)
        for method in (recommended_unsmoothed, recommended):
            assert np.std(method(array, moving).rate - truth) <= 1.002 * np.std(corrected)


def test_without_scale_errors_nothing_is_taken_off() -> None:
    """What is found is within four times the standard error of the noisiest gyro, σ/(r.m.s. rate·√samples) = 1e-4."""
    rate = motion(5, 20.0)
    array = array_of(5, [rate] * 6)
    ready, found, _ = without_relative(array)
    assert found is not None
    assert np.abs(found.value[:, 0]).max() < 4e-4
    assert np.abs(ready.rate - array.rate).max() < 0.03


def test_the_average_stays_what_it_is() -> None:
    rate = motion(6, 50.0)
    array = array_of(6, [(1 + one) * rate for one in scales(6)])
    ready, _, _ = without_relative(array)
    parameters = FilterParameters()
    np.testing.assert_allclose(average(ready, parameters).rate, average(array, parameters).rate, atol=1e-9)


def test_a_late_gyro() -> None:
    """Six samples of 400 Hz, 15 ms."""
    rate = motion(7, 20.0)
    late = np.concatenate([rate[:6], rate[:-6]])
    found = relative_response(array_of(7, [rate, rate, rate, rate, late, rate]))
    assert found is not None
    error = np.sqrt(found.covariance[1, 4, 4])
    assert found.value[4, 1] == pytest.approx(0.015 * 5 / 6, abs=4 * error)
    assert error < 0.004


def test_a_gyro_at_fault_has_no_say() -> None:
    rate = motion(8, 50.0)
    seen = [rate.copy() for _ in range(6)]
    seen[2][len(rate) // 2 :] = 0.0
    samples = len(rate) // FINER
    dead = FaultEvent(2, "dropout", samples // 2, samples, math.inf, math.nan, "")
    found = relative_response(array_of(8, seen, faults=(dead,)))
    assert found is not None
    assert np.abs(found.value[:, 0]).max() < 5e-4


def test_no_motion_no_answer() -> None:
    assert relative_response(array_of(9, [np.zeros(60 * 400)] * 6)) is None


def test_common_part_is_that_of_a_mean() -> None:
    """Posterior variance of a normal mean under the density 1/σ: σ²/N·(N - 1)/(N - 3)."""
    one = Relative(np.zeros((6, 3)), np.zeros((3, 6, 6)), np.array([0.02, 0.0, 0.0]), 1)
    assert one.common[0] == pytest.approx(0.02**2 / 6 * 5 / 3)


def of_delays(delay: list[float], error: float = 1e-5) -> Relative:
    value = np.zeros((len(delay), 3))
    value[:, 1] = np.array(delay) - np.mean(delay)
    return Relative(value, np.array([1e-9, error**2, 1e-9])[:, None, None] * np.eye(len(delay)), np.full(3, 1e-3), 1)


UNKNOWN = np.full(6, np.nan)
FORTY, TWENTY = 1 / (2 * math.pi * 40), 1 / (2 * math.pi * 20)
MIXED = [FORTY, FORTY, TWENTY, TWENTY, FORTY, FORTY]


def colours(tau: list[float]) -> np.ndarray:
    return np.exp(-0.005 / np.array(tau))


def test_colour_alone_is_no_delay() -> None:
    """All gyros of one colour, none later than another: noise may be coloured where the motion is not."""
    found = array_delay(of_delays([0.0] * 6), colours([FORTY] * 6), 0.005, UNKNOWN)
    late, note = found.late_s, found.note
    assert late == 0.0
    assert "lowpass_hz" in note


def test_colours_that_differ_without_delays_are_no_delay() -> None:
    assert array_delay(of_delays([0.0] * 6), colours(MIXED), 0.005, UNKNOWN).late_s == 0.0


def test_delays_that_follow_the_colours() -> None:
    late = array_delay(of_delays(MIXED), colours(MIXED), 0.005, UNKNOWN).late_s
    assert late == pytest.approx(np.mean(MIXED), rel=1e-9)


@pytest.mark.parametrize(("error_ms", "undone"), [(1.1, True), (1.3, False)])
def test_delays_follow_the_colours_only_if_they_are_sure(error_ms: float, undone: bool) -> None:
    """Without one of the late gyros, χ² of four at 3.979 ms and one at 7.958 is .8·(3.979 ms/error)²: 9 at 1.186."""
    late = array_delay(of_delays(MIXED, error_ms / 1000.0), colours(MIXED), 0.005, UNKNOWN).late_s
    assert (late > 0.0) == undone


@pytest.mark.parametrize(("other_ms", "undone"), [(2.0, True), (4.5, False)])
def test_delays_that_have_another_cause_are_no_evidence(other_ms: float, undone: bool) -> None:
    """Delays of two gyros that no colour explains: the χ² left is below half of all, or above."""
    delays = np.array(MIXED) + np.array([other_ms, -other_ms, 0, 0, 0, 0]) / 1000.0
    late = array_delay(of_delays(delays.tolist()), colours(MIXED), 0.005, UNKNOWN).late_s
    assert (late > 0.0) == undone


def test_one_gyro_may_be_late_by_itself() -> None:
    delays = np.array(MIXED) + np.array([0, 0, 0, 0, 0.015, 0])
    late = array_delay(of_delays(delays.tolist()), colours(MIXED), 0.005, UNKNOWN).late_s
    assert late == pytest.approx(np.mean(delays), rel=1e-9)


def test_a_declared_low_pass_is_believed() -> None:
    found = array_delay(of_delays([0.0] * 6), np.zeros(6), 0.005, np.full(6, 40.0))
    late, note = found.late_s, found.note
    assert late == pytest.approx(FORTY)
    assert "declared" in note


def test_one_declared_low_pass_is_enough() -> None:
    """The others are as late about it as the motion shows; one gyro is late by itself."""
    declared = np.array([np.nan, 40.0, 20.0, np.nan, 40.0, 40.0])
    delays = np.array(MIXED) + np.array([0, 0, 0, 0, 0.015, 0])
    late = array_delay(of_delays(delays.tolist()), np.zeros(6), 0.005, declared).late_s
    assert late == pytest.approx(np.mean(delays), rel=1e-9)


def test_how_well_the_delay_is_known() -> None:
    """The low-passes' tolerance, the errors of the delays, and how far the gyros are apart, of a median of six."""
    tolerance = 0.1 * FORTY
    exact = array_delay(of_delays([0.0] * 6, 1e-9), np.zeros(6), 0.005, np.full(6, 40.0))
    assert exact.sd == pytest.approx(tolerance)
    noisy = array_delay(of_delays([0.0] * 6, 1e-3), np.zeros(6), 0.005, np.full(6, 40.0))
    assert noisy.sd == pytest.approx(math.hypot(tolerance, 1e-3 * math.sqrt(math.pi / 12)))
    apart = np.array([-2.0, -1.0, -1.0, 1.0, 1.0, 2.0]) * 1e-3
    spread = array_delay(of_delays(apart.tolist(), 1e-9), np.zeros(6), 0.005, np.full(6, 40.0))
    assert spread.sd == pytest.approx(math.hypot(tolerance, 1.4826e-3 * math.sqrt(math.pi / 12)))
    assert math.isnan(array_delay(of_delays([0.0] * 6), colours([FORTY] * 6), 0.005, UNKNOWN).sd)


def test_a_known_delay_counts_with_its_own_error() -> None:
    rng = np.random.default_rng(3)
    motion = np.convolve(rng.standard_normal(60 * 400 + 79), np.hanning(80) / 3.0, "valid")
    array = array_of(3, [motion] * 6)
    found = replace(of_delays([0.0] * 6), window=11)
    shares = np.full(6, 1 / 6)
    known, unknown = (relative_variance(array, found, shares, sd) for sd in (2e-3, math.nan))
    terms = np.square(motion_terms(array, reference(array, used(array))[0], 11)[:, 1])
    np.testing.assert_allclose(unknown - known, terms * (1e-6 / 6 * 5 / 3 - 4e-6), rtol=1e-6, atol=1e-12)


def test_pole_times() -> None:
    """φ = e^(-T/τ); 0 where there is no colour."""
    np.testing.assert_allclose(pole_times(np.array([0.0, math.exp(-0.005 / FORTY)]), 0.005), [0.0, FORTY])

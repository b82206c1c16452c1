"""Clocks of two streams from their common motion."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from moving_arrays import NOISE, Motion, Recorded, random_motion, record

from vgyro.alignment import (
    AMBIGUOUS,
    FOUND,
    NO_COMMON_MOTION,
    TOO_SHORT,
    AlignedStream,
    ClockFit,
    noise_gain,
    positions,
    refuse_clock,
    relative_clock,
    resample,
    stretches,
)

DATA = Path(__file__).parent / "data"
# samples, ppm, offset_s, bias of own_clock_0 … 2.csv (cases/logs/EXPECTED.json); noise 0.08 deg/s
OWN_CLOCKS = ((12000, 0.0, 0.0, 0.2), (12002, 180.0, 0.34, -0.4), (11997, -240.0, -0.11, 0.1))
BOTH_ENDS = ((10.0, 3.0), (110.0, 3.0))


def own_clock(number: int) -> AlignedStream:
    rate = np.load(DATA / "own_clocks.npz")[f"gyro_{number}"] / 1e4
    return AlignedStream(np.arange(len(rate)) / 100, rate, 100.0)


def pair(
    rng: np.random.Generator, motion: Motion | None, most_offset: float = 1.0, samples: tuple[int, int] = (12000, 12000)
) -> tuple[Recorded, Recorded, float, float]:
    """Two records of a motion, and the true offset, s, and drift, ppm, of the second against the first."""
    start, (one, two) = rng.uniform(-most_offset, most_offset), rng.uniform(-300, 300, 2)
    first = record(rng, motion, ppm=one, samples=samples[0])
    second = record(rng, motion, start=start, ppm=two, samples=samples[1])
    return first, second, start * (1 + 1e-6 * one), 1e6 * ((1 + 1e-6 * two) / (1 + 1e-6 * one) - 1)


def fitted(first: Recorded, second: Recorded) -> ClockFit:
    return relative_clock(first.stream, second.stream)


@pytest.mark.parametrize(("one", "two"), [(0, 1), (0, 2), (2, 1)])
def test_the_own_clock_files(one: int, two: int) -> None:
    (_, ppm, start, bias), (_, other_ppm, other_start, other_bias) = OWN_CLOCKS[one], OWN_CLOCKS[two]
    a, b = own_clock(one), own_clock(two)
    fit = relative_clock(a, b)
    assert (fit.status, bool(fit.significant)) == (FOUND, True)
    assert fit.offset_s == pytest.approx(other_start - start, abs=5e-4)
    assert fit.drift_ppm == pytest.approx(other_ppm - ppm, abs=5)
    assert fit.offset_high - fit.offset_low < 1e-3
    difference = resample(b, fit.on_other(a.time)) - a.rate - (other_bias - bias)
    middle = difference[2000:10000]  # in motion
    gain = noise_gain(positions(b, fit.on_other(a.time[2000:10000]))).mean()
    assert middle.std() == pytest.approx(NOISE * math.sqrt(1 + gain), rel=0.03)


def test_a_stream_against_itself_later_is_not_significant() -> None:
    rng = np.random.default_rng(3)
    motion = random_motion(rng, 10)
    fit = fitted(record(rng, motion), record(rng, motion))
    assert fit.status == FOUND
    assert not fit.significant


@pytest.mark.parametrize("seed", range(3))
def test_the_average_of_three_is_as_good_as_on_one_clock(seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = random_motion(rng, 10)
    first = record(rng, motion, scale_error=0)
    rates = [first.stream.rate - first.bias]
    for _ in range(2):
        other = record(rng, motion, scale_error=0, start=rng.uniform(-1, 1), ppm=rng.uniform(-300, 300))
        rates.append(resample(other.stream, fitted(first, other).on_other(first.stream.time)) - other.bias)
    error = np.nanstd(np.mean(rates, axis=0) - motion.at(first.true_time))
    assert error <= 1.05 * NOISE / math.sqrt(3)


@pytest.mark.parametrize(
    ("bursts", "most_offset", "samples", "rms"),
    [
        ((), 1.0, (12000, 12000), 10.0),
        ((), 1.0, (12000, 12000), 0.3),
        (BOTH_ENDS, 1.0, (12000, 12000), 10.0),
        (((30.0, 5.0), (75.0, 5.0), (100.0, 5.0)), 25.0, (12000, 9000), 10.0),
    ],
)
def test_offsets_and_drifts_within_2_ms_and_15_ppm(
    bursts: tuple, most_offset: float, samples: tuple[int, int], rms: float
) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        first, second, offset, drift = pair(rng, random_motion(rng, rms, bursts), most_offset, samples)
        fit = fitted(first, second)
        assert fit.status == FOUND
        assert fit.offset_s == pytest.approx(offset, abs=2e-3)
        assert fit.drift_ppm == pytest.approx(drift, abs=15 if rms > 1 else 45)


@pytest.mark.full
@pytest.mark.parametrize("kind", ["random", "weak", "both ends", "tens of seconds", "one burst"])
def test_95_percent_intervals_cover_in_90_of_100_seeds(kind: str) -> None:
    bursts, most_offset, samples, rms = {
        "random": ((), 1.0, (12000, 12000), 10.0),
        "weak": ((), 1.0, (12000, 12000), 0.1),
        "both ends": (BOTH_ENDS, 1.0, (12000, 12000), 10.0),
        "tens of seconds": (((30.0, 5.0), (75.0, 5.0), (100.0, 5.0)), 25.0, (12000, 9000), 10.0),
        "one burst": (((60.0, 3.0),), 1.0, (12000, 12000), 10.0),
    }[kind]
    covered = np.zeros(2)
    for seed in range(100):
        rng = np.random.default_rng(seed)
        first, second, offset, drift = pair(rng, random_motion(rng, rms, bursts), most_offset, samples)
        fit = fitted(first, second)
        covered += fit.offset_low <= offset <= fit.offset_high, fit.drift_low <= drift <= fit.drift_high
    print(kind, covered)
    assert covered.min() >= 90


def test_drift_is_claimed_only_where_both_ends_move() -> None:
    widths = []
    for bursts, rms in ((BOTH_ENDS, 2.0), (((10.0, 2.0),), 2.0), (((10.0, 1.0),), 0.5)):
        rng = np.random.default_rng(5)
        first, second, offset, drift = pair(rng, random_motion(rng, rms, bursts))
        fit = fitted(first, second)
        assert fit.status == FOUND
        assert fit.offset_low <= offset <= fit.offset_high
        assert fit.drift_low <= drift <= fit.drift_high
        widths.append(fit.drift_high - fit.drift_low)
        # The error of the mapping grows away from the motion.
        near, far = fit.error_s(first.stream.time[[1000, -1]])
        assert far > near
    assert widths[0] < 20
    assert widths[1] > 10 * widths[0]
    assert widths[2] == 2000  # the bounds of the search: nothing is known


def no_motion(kind: str, rng: np.random.Generator) -> tuple[Recorded, Recorded]:
    moves = {
        "noise": lambda: None,
        "motion": lambda: random_motion(rng, 10),
        "bursts": lambda: random_motion(rng, 10, BOTH_ENDS, 0.5, 2),
        "one burst": lambda: random_motion(rng, 10, ((50.0, 2.0),), 0.8, 1.5),
    }[kind]
    return record(rng, moves()), record(rng, moves())


@pytest.mark.parametrize("kind", ["noise", "motion", "bursts", "one burst"])
def test_nothing_in_common_is_refused(kind: str) -> None:
    for seed in range(3):
        fit = fitted(*no_motion(kind, np.random.default_rng(seed)))
        assert fit.status == NO_COMMON_MOTION
        assert not fit.significant
        assert math.isnan(fit.offset_s)


@pytest.mark.full
@pytest.mark.parametrize("kind", ["noise", "motion", "bursts", "one burst"])
def test_nothing_in_common_is_refused_in_300_recordings(kind: str) -> None:
    statuses = [fitted(*no_motion(kind, np.random.default_rng(seed))).status for seed in range(300)]
    print(kind, {status: statuses.count(status) for status in set(statuses)})
    assert sum(status != NO_COMMON_MOTION for status in statuses) <= 2


def test_the_rate_of_false_alarms_is_the_bound() -> None:
    rng = np.random.default_rng(8)
    first, second, *_ = pair(rng, random_motion(rng, 0.05))
    chance = fitted(first, second).evidence.chance_log10
    assert chance < -3
    above = relative_clock(first.stream, second.stream, false_alarm=10 ** (chance + 0.1))
    below = relative_clock(first.stream, second.stream, false_alarm=10 ** (chance - 0.1))
    assert (above.status, below.status) == (FOUND, NO_COMMON_MOTION)


@pytest.mark.parametrize(("rms", "status"), [(0.025, NO_COMMON_MOTION), (0.05, FOUND)])
def test_motion_of_the_size_of_the_noise_is_not_enough(rms: float, status: str) -> None:
    # In the band of the search the noise is about 0.025 deg/s; a correlation of 0.7 needs one and a half of that.
    rng = np.random.default_rng(8)
    first, second, *_ = pair(rng, random_motion(rng, rms))
    fit = fitted(first, second)
    assert fit.status == status
    assert fit.evidence.chance_log10 < -3
    assert (abs(fit.evidence.correlation) >= 0.7) == (status == FOUND)


def test_a_sinusoid_is_ambiguous_and_two_are_not() -> None:
    for hz, status in (([1.3], AMBIGUOUS), ([0.3], AMBIGUOUS), ([0.3, 1.7 / math.sqrt(2)], FOUND)):
        rng = np.random.default_rng(2)
        motion = Motion(np.array(hz), rng.uniform(0, 6, len(hz)), 10.0, () if len(hz) == 1 else ((60.0, 20.0),))
        first, second, *_ = pair(rng, motion)
        fit = fitted(first, second)
        assert fit.status == status
        assert (fit.evidence.rival_odds < 20) == (status == AMBIGUOUS)
        if status == AMBIGUOUS:
            assert not fit.significant
            # Half a period with the other sign would fit as well.
            apart = abs(fit.evidence.rival_s - fit.offset_s) * hz[0] * 2
            assert apart == pytest.approx(round(apart), abs=0.1)


def test_stamps_that_do_not_begin_at_zero_and_another_rate() -> None:
    rng = np.random.default_rng(4)
    motion = random_motion(rng, 10)
    first = record(rng, motion, origin=1.7e9)
    second = record(rng, motion, origin=50.0, start=0.4, rate_hz=170.0, samples=19000, ppm=200)
    fit = fitted(first, second)
    assert fit.offset_s == pytest.approx(0.4, abs=1e-3)
    assert fit.drift_ppm == pytest.approx(200, abs=5)
    true = 50 + (first.true_time - 0.4) * (1 + 200e-6)
    np.testing.assert_allclose(fit.on_other(first.stream.time), true, atol=1e-3)
    np.testing.assert_allclose(fit.on_reference(fit.on_other(first.stream.time)), first.stream.time, atol=1e-6)


def test_gaps_and_nan_are_left_out() -> None:
    rng = np.random.default_rng(6)
    motion = random_motion(rng, 10)
    first, second = record(rng, motion), record(rng, motion, start=0.3, ppm=-150)
    kept = np.r_[0:3000, 3500:12000]
    broken = AlignedStream(second.stream.time[kept], second.stream.rate[kept].copy(), 100.0)
    broken.rate[rng.integers(0, len(kept), 100)] = np.nan
    fit = relative_clock(first.stream, broken)
    assert fit.offset_s == pytest.approx(0.3, abs=1e-3)
    assert fit.drift_ppm == pytest.approx(-150, abs=10)
    aligned = resample(broken, fit.on_other(first.stream.time))
    assert np.isnan(aligned[3060:3500]).all()
    assert stretches(broken.time, 100.0).max() == 1


def test_a_gyro_mounted_the_other_way_has_a_negative_scale() -> None:
    rng = np.random.default_rng(7)
    first, second, offset, _ = pair(rng, random_motion(rng, 10))
    turned = second.stream._replace(rate=-second.stream.rate)
    fit = relative_clock(first.stream, turned)
    assert fit.evidence.scale == pytest.approx(-1, abs=0.07)
    assert fit.offset_s == pytest.approx(offset, abs=1e-3)


def test_most_offset_bounds_the_search() -> None:
    rng = np.random.default_rng(9)
    motion = random_motion(rng, 10)
    first, second = record(rng, motion), record(rng, motion, start=5.0)
    assert relative_clock(first.stream, second.stream, most_offset_s=5.5).status == FOUND
    assert relative_clock(first.stream, second.stream, most_offset_s=4.5).status == NO_COMMON_MOTION


def test_short_and_empty_streams() -> None:
    nothing = AlignedStream(np.zeros(0), np.zeros(0), 100.0)
    short = AlignedStream(np.arange(50) / 100, np.zeros(50), 100.0)
    dead = AlignedStream(np.arange(5000) / 100, np.zeros(5000), 100.0)
    assert relative_clock(nothing, dead).status == TOO_SHORT
    assert relative_clock(dead, short).status == TOO_SHORT
    assert relative_clock(dead, dead).status == NO_COMMON_MOTION


@pytest.mark.parametrize("status", [NO_COMMON_MOTION, AMBIGUOUS, TOO_SHORT])
def test_the_refusal_says_what_to_record(status: str) -> None:
    dead = AlignedStream(np.arange(5000) / 100, np.zeros(5000), 100.0)
    text = str(refuse_clock(relative_clock(dead, dead)._replace(status=status), "left.csv, right.csv"))
    assert text.startswith("left.csv, right.csv: ")
    assert "at the beginning and the end of the recording" in text


@pytest.mark.full
def test_an_hour_that_moves_at_both_ends() -> None:
    rng = np.random.default_rng(1)
    first, second, offset, drift = pair(
        rng, random_motion(rng, 10, ((30.0, 5.0), (3300.0, 5.0))), 25.0, (360_000, 345_000)
    )
    fit = fitted(first, second)
    assert fit.offset_s == pytest.approx(offset, abs=1e-3)
    assert fit.drift_ppm == pytest.approx(drift, abs=0.2)

"""Streams, their stretches and their low-passed copies."""

from __future__ import annotations

import numpy as np
import pytest

from vgyro.alignment import AlignedStream, positions, resample, stretches
from vgyro.alignment.streams import highest_cutoff, low_pass


@pytest.mark.parametrize(("rate_hz", "cutoff"), [(100.0, 1.0), (100.0, 20.0), (1000.0, 3.0), (97.3, 7.0)])
@pytest.mark.parametrize("share", [0.1, 0.95])
def test_the_pass_band_is_kept_with_its_derivative(rate_hz: float, cutoff: float, share: float) -> None:
    time = 5 + np.arange(int(30 * rate_hz)) / rate_hz
    turn = 2 * np.pi * share * cutoff
    band = low_pass(AlignedStream(time, 3 + np.sin(turn * time), rate_hz), cutoff)
    np.testing.assert_allclose(band.rate, 3 + np.sin(turn * band.time), atol=2e-3)
    np.testing.assert_allclose(band.derivative / turn, np.cos(turn * band.time), atol=1e-2)
    np.testing.assert_allclose(np.diff(band.time), band.step_s, atol=1e-9)


def test_above_twice_the_cut_off_nothing_is_left() -> None:
    time = np.arange(3000) / 100
    band = low_pass(AlignedStream(time, np.sin(2 * np.pi * 8.2 * time), 100.0), 4.0)
    assert np.abs(band.rate).max() < 2e-3


def test_stretches_end_at_gaps_of_more_than_one_and_a_half_periods() -> None:
    time = np.cumsum([0, 0.01, 0.0149, 0.01, 0.0151, 0.01, -1.0, 0.01])
    np.testing.assert_array_equal(stretches(time, 100.0), [0, 0, 0, 0, 1, 1, 2, 2])


@pytest.mark.parametrize(("hole", "parts"), [(3, 1), (4, 2)])
def test_holes_of_three_samples_are_bridged_for_the_estimate(hole: int, parts: int) -> None:
    time = np.arange(2000) / 100
    rate = np.sin(time)
    rate[1000 : 1000 + hole] = np.nan
    band = low_pass(AlignedStream(time, rate, 100.0), 4.0)
    assert len(np.unique(band.segment)) == parts
    np.testing.assert_allclose(band.rate, np.sin(band.time), atol=2e-3)


def test_a_stretch_shorter_than_the_filter_gives_nothing() -> None:
    assert len(low_pass(AlignedStream(np.arange(90) / 100, np.zeros(90), 100.0), 4.0).time) == 0
    assert len(low_pass(AlignedStream(np.arange(95) / 100, np.zeros(95), 100.0), 4.0).time) == 1
    assert len(low_pass(AlignedStream(np.arange(95) / 100, np.full(95, np.nan), 100.0), 4.0).time) == 0


def test_jitter_of_stamps_averages_out() -> None:
    rng = np.random.default_rng(1)
    even = np.arange(3000) / 100
    band = low_pass(AlignedStream(even + rng.uniform(-0.002, 0.002, 3000), np.sin(even), 100.0), 2.0)
    assert np.std(band.rate - np.sin(band.time)) < 5e-4


def test_the_highest_cut_off_is_a_fifth_of_the_rate() -> None:
    assert highest_cutoff(100.0) == 20.0


def test_resampling_reads_nothing_across_a_gap() -> None:
    time = np.concatenate((np.arange(100), np.arange(150, 300))) / 100 + 7
    wanted = np.array([6.99, 7.505, 7.995, 8.2, 8.505, 9.0, 9.99, 10.0])
    result = resample(AlignedStream(time, np.sin(time), 100.0), wanted)
    np.testing.assert_array_equal(np.isnan(result), [True, False, True, True, False, False, False, True])
    np.testing.assert_allclose(result[[1, 4, 5]], np.sin(wanted[[1, 4, 5]]), atol=2e-4)
    assert positions(AlignedStream(time, time, 100.0), np.array([7.505]))[0] == pytest.approx(50.5)

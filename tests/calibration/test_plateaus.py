"""Plateaus found in a logged reference, and averaged."""

import numpy as np
import pytest

from vgyro.calibration import DIRECTION_NAMES, average_plateaus, find_plateaus

RATES = [0.0, 50.0, 100.0, -100.0, -50.0, 0.0]


def table(ramp_s: float, hold_s: float, rate_hz: float, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    pieces = []
    for before, after in zip(RATES, [*RATES[1:], RATES[-1]], strict=True):
        pieces += [np.full(int(hold_s * rate_hz), before), np.linspace(before, after, int(ramp_s * rate_hz))]
    reference = np.concatenate(pieces)
    time = np.arange(reference.size) / rate_hz
    return reference + noise * np.random.default_rng(1).standard_normal(reference.size), time


@pytest.mark.parametrize(("rate_hz", "noise"), [(10.0, 0.0), (200.0, 0.0), (200.0, 0.05)])
def test_all_plateaus_are_found(rate_hz: float, noise: float):
    found = find_plateaus(*table(2.0, 12.0, rate_hz, noise))
    assert len(found) == len(RATES)
    for (start, stop, rate), truth, begin in zip(found, RATES, np.arange(6) * 14.0, strict=True):
        assert rate == pytest.approx(truth, abs=0.02)
        assert begin + 0.5 <= start <= begin + 2.5
        assert stop <= begin + 12.5 or truth == 0
        assert stop - start > 8


def test_a_sinusoid_has_no_plateau():
    time = np.arange(20_000) / 100.0
    assert find_plateaus(50 * np.sin(2 * np.pi * 0.25 * time), time) == []


def test_empty_and_short_logs():
    assert find_plateaus(np.empty(0), np.empty(0)) == []
    assert find_plateaus(np.zeros(20), np.arange(20) / 10) == []


def test_plateau_means_and_their_standard_error():
    # White noise of 10 counts, 8 s at 200 Hz: standard error 10/√1600 = 0.25.
    rng = np.random.default_rng(6)
    time = np.arange(4000) / 200.0
    counts = np.where(time < 10, 100.0, 500.0)[:, None] + 10 * rng.standard_normal((4000, 40))
    found = average_plateaus(counts, time, [(1.0, 9.0, 0.0), (11.0, 19.0, 20.0), (30.0, 40.0, 0.0)])
    assert found.samples.tolist() == [1601, 1601, 0]
    np.testing.assert_allclose(found.mean[:2].mean(axis=1), [100, 500], atol=0.2)
    assert np.median(found.standard_error[:2]) == pytest.approx(0.25, rel=0.1)
    assert np.isnan(found.mean[2]).all()
    assert found.turns.tolist() == [0, 0, 0]


def test_batch_means_count_slow_noise():
    # Steps of 0.2 s: 80 independent values in 16 s, however many samples there are.
    rng = np.random.default_rng(8)
    counts = np.repeat(10 * rng.standard_normal((80, 60)), 20, axis=0)
    found = average_plateaus(counts, np.arange(1600) / 100.0, [(0.0, 16.0, 0.0)])
    assert np.median(found.standard_error) == pytest.approx(10 / np.sqrt(80), rel=0.1)


def test_whole_turns_cancel_what_turns_with_the_table():
    # 3 counts of horizontal Earth rate. 10 s at 50 deg/s are 1.39 turns: one turn, 7.2 s, is averaged.
    time = np.arange(1100) / 100.0
    counts = (200 + 3 * np.sin(np.radians(50) * time + 0.4))[:, None]
    plateau = [(0.5, 10.5, 50.0)]
    found = average_plateaus(counts, time, plateau)
    assert found.turns.tolist() == [1]
    assert (found.seconds[0], found.time[0], found.samples[0]) == (pytest.approx(7.2), pytest.approx(4.1), 720)
    assert found.mean[0, 0] == pytest.approx(200, abs=1e-9)
    everything = average_plateaus(counts, time, plateau, whole_turns=False)
    assert everything.turns.tolist() == [0]
    assert abs(everything.mean[0, 0] - 200) > 0.3


def test_direction_and_temperature_of_a_plateau():
    time = np.arange(700) / 10.0
    plateaus = [(10.0 * k, 10.0 * k + 9, rate) for k, rate in enumerate([0.0, 0.0, 20.0, 10.0, -20.0, 0.0])]
    warm = 20 + time / 10
    counts = np.zeros((700, 2))
    found = average_plateaus(counts, time, plateaus, temperature=warm)
    assert [DIRECTION_NAMES[value] for value in found.direction.tolist()] == [
        "none",
        "none",
        "up",
        "down",
        "down",
        "up",
    ]
    np.testing.assert_allclose(found.temperature[:, 1], 20 + (10 * np.arange(6) + 4.5) / 10)
    own = average_plateaus(counts, time, plateaus, temperature=np.column_stack([warm, warm + 5]))
    np.testing.assert_allclose(own.temperature[:, 1] - own.temperature[:, 0], 5)
    assert np.isnan(average_plateaus(counts, time, plateaus).temperature).all()


def test_a_clipped_plateau_is_left_out_for_that_gyro():
    time = np.arange(1000) / 100.0
    counts = np.tile([[5.0, 5.0]], (1000, 1)) + np.random.default_rng(7).standard_normal((1000, 2))
    counts[500, 1] = 32767
    found = average_plateaus(counts, time, [(0.0, 9.0, 0.0)], (-32768, 32767))
    assert np.isfinite(found.mean[0, 0])
    assert np.isnan(found.mean[0, 1])

"""Plateaus found in a logged reference."""

import numpy as np
import pytest

from vgyro.calibration import find_plateaus

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

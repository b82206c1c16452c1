"""Noise in the quiet frequencies: what changes no weights, and windows in which a gyro is at fault."""

from __future__ import annotations

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.noise.parity import parity_variances

RATE_HZ, SAMPLES, GYROS = 50.0, 30_000, 6
MOVING = FilterParameters(in_motion=True)


def simulated(correlation: float, seed: int, faults: tuple[FaultEvent, ...] = ()) -> ArrayRates:
    """White gyros of variance 1, correlated in pairs, so that equal weights stay the best; a slow motion."""
    rng = np.random.default_rng(seed)
    time = np.arange(SAMPLES) / RATE_HZ
    rate = 200.0 * np.sin(2 * np.pi * 0.1 * time)[:, None]
    rate = rate + np.sqrt(1.0 - correlation) * rng.standard_normal((SAMPLES, GYROS))
    rate += np.sqrt(correlation) * np.repeat(rng.standard_normal((SAMPLES, GYROS // 2)), 2, axis=1)
    noise = ArrayNoise(np.full(GYROS, np.nan), np.full(GYROS, np.nan), np.eye(GYROS))
    none = np.zeros(SAMPLES, dtype=bool)
    segment = np.zeros(SAMPLES, dtype=np.int32)
    return ArrayRates(np.asfortranarray(rate), RATE_HZ, segment, none, noise, faults=faults)


@pytest.mark.parametrize(("correlation", "counted"), [(0.05, False), (0.3, True), (0.8, True)])
def test_correlations_that_change_no_weights_count_in_the_variance(correlation: float, counted: bool) -> None:
    """Closed form: Var Σu·n = (1 + ρ)/6 of three pairs; 1.1 times 1/6 is asked for."""
    found = parity_variances(simulated(correlation, 1), MOVING)
    expected = (1.0 + correlation * counted) / GYROS
    assert float(np.mean(found.combined_variance())) == pytest.approx(expected, rel=0.06)
    assert ("frequencies at which the motion is small" in found.note) == counted


def test_a_gyro_at_fault_now_and_then_does_not_let_the_motion_in() -> None:
    """Spectra of unlike windows do not cancel in a motion of 200 deg/s: those in which all are good are taken."""
    faults = tuple(
        FaultEvent(gyro, "noise", begin, begin + 200, 50.0, 5.0, "1")
        for gyro, begin in ((0, 2000), (3, 9000), (3, 15_000), (5, 22_000))
    )
    found = parity_variances(simulated(0.5, 2, faults), MOVING)
    assert "frequencies at which the motion is small" in found.note
    assert float(np.median(found.combined_variance())) == pytest.approx(1.5 / GYROS, rel=0.06)

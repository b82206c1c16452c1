"""`recommended` where every gyro is at the end of its range, and where the array's delay is known."""

from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import METHODS, ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.ours import recommended as module
from vgyro.fusion.ours.array_estimate import analysed

MOVING, SAMPLES, RATE_HZ, GYROS = FilterParameters(in_motion=True), 6000, 50.0, 3


def turning(size, end=np.inf, lowpass_hz=None):
    rng = np.random.default_rng(4)
    wide = np.convolve(rng.standard_normal(SAMPLES + 119), np.hanning(120), "valid")
    rate = size * (wide / wide.std())[:, None] + 0.2 * rng.standard_normal((SAMPLES, GYROS))
    noise = ArrayNoise(np.full(GYROS, 0.03), np.full(GYROS, 1e-3), np.eye(GYROS))
    return ArrayRates(
        np.clip(rate, -end, end), RATE_HZ, np.zeros(SAMPLES, int), np.zeros(SAMPLES, bool), noise,
        lowpass_hz=lowpass_hz,
    )  # fmt: skip


def test_what_the_model_of_the_motion_says_within_the_range_is_not_believed(monkeypatch):
    array = turning(60.0, end=100.0)
    real = module.smoothed
    monkeypatch.setattr(module, "smoothed", lambda *given: replace(real(*given), rate=np.zeros(SAMPLES)))
    fused = METHODS["recommended"].fuse(array, MOVING)
    gone = (np.abs(array.rate) == 100.0).all(axis=1)
    assert gone.sum() > 100
    assert np.abs(fused.rate[gone]) == pytest.approx(100.0)
    assert not fused.rate[~(np.abs(array.rate) == 100.0).any(axis=1)].any()


def test_a_declared_low_pass_makes_the_common_delay_known():
    """Gyros late by as much and one that is later: what all share is as sure as data sheets are, not as the spread."""
    known, unknown = (analysed(turning(20.0, lowpass_hz=one), MOVING) for one in (np.full(GYROS, 4.0), None))
    assert known.late_sd == pytest.approx(0.1 / (2 * np.pi * 4.0), rel=0.5)
    assert np.isnan(unknown.late_sd)
    shares = known.variances.weights()
    wide = replace(known, late_sd=10.0 * known.late_sd)
    assert np.mean(wide.answer_variance(shares)) > 50.0 * np.mean(known.answer_variance(shares))

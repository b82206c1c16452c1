"""Noise in the band that passes: against closed forms of AR(1) noise, and nothing where the gyros are alike."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.noise import band
from vgyro.fusion.noise.band import in_band
from vgyro.fusion.noise.parity import parity_variances
from vgyro.fusion.ours.recommended import recommended

RATE_HZ, SAMPLES = 50.0, 60000
PHI = np.array([-0.6, -0.6, 0.0, 0.0, 0.0, 0.4])


def simulated(phi, seed=0, truth=0.0, at_rest=True):
    """Gyros of AR(1) noise of variance 1, one φ each."""
    white = np.random.default_rng(seed).standard_normal((SAMPLES, len(phi)))
    noise = np.column_stack([lfilter([math.sqrt(1 - p**2)], [1, -p], x) for p, x in zip(phi, white.T, strict=True)])
    rate = np.asfortranarray(noise + np.broadcast_to(truth, SAMPLES)[:, None])
    gyros = len(phi)
    record = ArrayNoise(np.full(gyros, 0.14), np.full(gyros, 1e-6), np.eye(gyros))
    return ArrayRates(rate, RATE_HZ, np.zeros(SAMPLES, dtype=np.int32), np.full(SAMPLES, at_rest), record)


def level(phi, n):
    """Variance of the mean of n samples times n, over that of a sample: Σ (1 - |k|/n)·φ^|k|."""
    lag = np.arange(1 - n, n)
    return float(np.sum((1 - np.abs(lag) / n) * np.power(phi, np.abs(lag))))


@pytest.mark.parametrize("truth", [0.0, 30.0 * np.sin(np.arange(SAMPLES) / 40.0)])
@pytest.mark.parametrize("bandwidth_hz", [0.5, 5.0])
def test_levels_are_those_of_the_closed_form(truth, bandwidth_hz):
    # Expected: as `level`, relative to the others; known to about 4 % from 1200 means of a second.
    array = simulated(PHI, truth=truth, at_rest=False)
    variances = parity_variances(array, FilterParameters(in_motion=True), changing=False)
    found, note = in_band(array, variances, bandwidth_hz)
    factor = (found.variance / variances.variance)[0]
    length = round(RATE_HZ / (2 * bandwidth_hz))
    expected = np.array([level(phi, length) for phi in PHI])
    np.testing.assert_allclose(factor / factor[2:5].mean(), expected / expected[2:5].mean(), rtol=0.15)
    assert f"means of {length} samples" in note


@pytest.mark.parametrize("phi", [0.0, 0.7])
def test_alike_gyros_keep_their_weights(phi):
    # Expected: nothing changes; one false alarm in a thousand. A colour that all have is none of one gyro.
    for seed in range(8):
        array = simulated(np.full(6, phi), seed)
        variances = parity_variances(array, FilterParameters(), changing=False)
        found, note = in_band(array, variances, 1.0)
        assert found is variances
        assert note == ""


def test_everything_passes():
    # Expected: the weights of the samples: no band is left out.
    variances = parity_variances(simulated(PHI), FilterParameters(), changing=False)
    for bandwidth_hz in (math.nan, 20.0, 100.0):
        assert in_band(simulated(PHI), variances, bandwidth_hz)[1] == ""


def test_an_excluded_gyro_does_not_matter():
    # Expected: the levels of the others as ever, none of its own.
    array = simulated(PHI)
    loud = array.rate.copy()
    loud[:, 5] = 0.0
    variances = parity_variances(replace(array, rate=loud), FilterParameters(), changing=False)
    found, note = in_band(replace(array, rate=loud), variances, 1.0)
    factor = (found.variance / variances.variance)[0]
    assert note
    assert factor[5] == 1.0
    assert factor[0] / factor[2] == pytest.approx(level(-0.6, 25), rel=0.15)


def test_recommended_weighs_the_band_that_passes():
    # Expected: s.d. of the density at f = 0, Σu²·(1 + φ)/(1 - φ), with weights of least variance there. Equal
    # ones are what the variances of the samples give.
    array = simulated(PHI, 3)
    density = (1 + PHI) / (1 - PHI)
    best = math.sqrt((1.0 / np.sum(1.0 / density)) / (density.sum() / 36.0))
    found = recommended(array, FilterParameters(bandwidth_hz=1.0))
    smooth = np.exp(-2 * np.pi * 1.0 / math.sqrt(math.sqrt(2) - 1) / RATE_HZ)
    average = array.rate.mean(axis=1)
    for _ in range(2):
        average = lfilter([1 - smooth], [1, -smooth], average)[::-1]
    cut = slice(200, -200)
    assert found.rate[cut].std() / average[cut].std() == pytest.approx(best, rel=0.06)
    assert "which pass" in found.note


@pytest.mark.parametrize("size", [2.55, 2.45])
def test_levels_are_drawn_together(monkeypatch, size):
    # By hand: levels of equal error about a mean of 0, F = Σ level²/(6 - 1), bound F(0.001; 5, 15) = 7.57 (tables);
    # then (1 - 1/F) of each is kept (James & Stein 1961).
    level = size * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    monkeypatch.setattr(band, "_log_levels", lambda *_: (0.5 + 0.1 * level, np.full(6, 0.1)))
    array = simulated(np.zeros(6))
    variances = parity_variances(array, FilterParameters(), changing=False)
    found, note = in_band(array, variances, 1.0)
    ratio = 6.0 * size**2 / 5.0
    assert bool(note) == (ratio > 7.57)
    expected = np.exp(0.1 * level * (1.0 - 1.0 / ratio)) if ratio > 7.57 else np.ones(6)
    np.testing.assert_allclose((found.variance / variances.variance)[0], expected, rtol=1e-9)

"""DCC or EWMA: which of two forecasts is better, where the truth is known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters, SampleWeights
from vgyro.fusion.analysed import DCC, analysed
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.parity import parity_variances
from vgyro.fusion.parity_dcc import prefer_dcc

KEY = ("dcc", "causal", "residual")
SAMPLES, RATE_HZ, LENGTH = 30000, 10.0, 10
"""3000 blocks of one second, of ten samples."""


def unsteady(blocks, gyros, seed):
    """Variances h [M, N] that no past shows, and standard normal z [M, N]."""
    rng = np.random.default_rng(seed)
    return np.exp(0.8 * rng.standard_normal((blocks, gyros))), rng.standard_normal((blocks, gyros))


def array_of(means, deviation, truth=0.0, faults=()):
    """An array whose block means are `means` [M, N], with the forecasts `deviation` [M, N] of them."""
    rng = np.random.default_rng(99)
    inside = rng.standard_normal((len(means), LENGTH, means.shape[1]))
    inside -= inside.mean(axis=1, keepdims=True)
    rate = (means[:, None] + inside).reshape(-1, means.shape[1]) + np.asarray(truth)[..., None]
    block = np.repeat(np.arange(len(means), dtype=np.int32), LENGTH)
    gyros = means.shape[1]
    noise = ArrayNoise(np.ones(gyros), np.ones(gyros), np.eye(gyros))
    zeros = np.zeros(len(rate), dtype=np.int32)
    deviations = {KEY: SampleWeights.of(deviation, block)}
    return ArrayRates(rate, RATE_HZ, zeros, zeros.astype(bool), noise, deviations=deviations, faults=faults)


def score(array, parameters=None):
    parameters = parameters or FilterParameters(in_motion=True)
    return prefer_dcc(array, parameters, parity_variances(array, parameters))


def test_the_true_variances_are_preferred():
    # Expected: the true h, which the past does not show, forecast better than any EWMA, in motion, too.
    h, z = unsteady(3000, 5, 1)
    truth = 30.0 * np.sin(np.arange(SAMPLES) / 37.0)
    found = score(array_of(np.sqrt(h) * z, np.sqrt(h), truth))
    assert found.prefer
    assert found.t > 3
    assert found.dcc < found.ewma
    # Expected: E(Σ log h + log Σ 1/h) and a χ² of N - 1; its standard error over 3000 blocks is 0.05.
    expected = np.mean(np.log(h).sum(axis=1) + np.log((1 / h).sum(axis=1))) + 4
    assert found.dcc == pytest.approx(expected, abs=0.2)
    assert "EWMA" in found.note


@pytest.mark.parametrize("what", ["wrong variances", "white noise"])
def test_ewma_is_kept_where_dcc_is_no_better(what):
    # Expected: forecasts that belong to other blocks, or that vary where nothing does, are not preferred.
    h, z = unsteady(3000, 5, 2)
    means = z if what == "white noise" else np.sqrt(h) * z
    found = score(array_of(means, np.sqrt(np.roll(h, 900, axis=0))))
    assert not found.prefer
    assert found.t < 0


def test_false_preferences_are_rare():
    # Expected: forecasts that are the true value but for 1 % of noise: t > 2 by chance in 2.3 % of cases.
    prefer = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        means = rng.standard_normal((600, 3))
        prefer.append(score(array_of(means, 1.0 + 0.01 * rng.standard_normal((600, 3)))).prefer)
    assert sum(prefer) <= 2


def test_blocks_without_forecast_and_faults_do_not_count():
    h, z = unsteady(3000, 4, 3)
    deviation = np.sqrt(h)
    deviation[500:700] = np.nan
    means = np.sqrt(h) * z
    means[1000:1200, 2] = 300.0
    faults = (FaultEvent(2, "step", 10000, 12000, 99.0, 300.0, "deg/s"),)
    array = array_of(means, deviation, faults=faults)
    found = score(array)
    assert found.prefer
    assert 2700 <= found.blocks <= 2800
    block = array.deviations[KEY].block.copy()
    block[:2000] = -1
    part = replace(array, deviations={KEY: SampleWeights.of(deviation, block)})
    assert 2500 <= score(part).blocks <= 2600


def test_no_more_blocks_than_memory_allows(monkeypatch):
    h, z = unsteady(900, 3, 6)
    monkeypatch.setattr("vgyro.fusion.parity_dcc.MOST_BLOCKS", 400)
    assert 380 <= score(array_of(np.sqrt(h) * z, np.sqrt(h))).blocks <= 400


def test_only_causal_deviations_were_made():
    # Expected: where DCC wins, R_t is that of the causal deviations; of the in-sample ones where there are some.
    h, z = unsteady(3000, 5, 1)
    array = array_of(np.sqrt(h) * z, np.sqrt(h))
    assert score(array).prefer
    parameters = FilterParameters(in_motion=True)
    found = analysed(array, parameters).variances
    block = (found.start + found.stop) // 2 // LENGTH
    np.testing.assert_allclose(found.variance, LENGTH * h[block], rtol=1e-6)
    in_sample = {**array.deviations, DCC: SampleWeights.of(2.0 * np.sqrt(h), array.deviations[KEY].block)}
    both = analysed(replace(array, deviations=in_sample), parameters).variances
    np.testing.assert_allclose(both.variance, 4.0 * LENGTH * h[block], rtol=1e-6)


def test_nothing_to_compare():
    h, z = unsteady(120, 3, 4)
    array = array_of(np.sqrt(h) * z, np.sqrt(h))
    found = score(replace(array, deviations={}))
    assert not found.prefer
    assert math.isnan(found.t)
    assert "no causal deviations of DCC" in found.note
    assert "fewer than 100" in score(array.part(slice(0, 900))).note

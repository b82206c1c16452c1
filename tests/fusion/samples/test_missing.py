"""Values that a gyro lacks, filled from the others."""

import numpy as np
import pytest

from vgyro.fusion import METHODS, ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.samples import missing as module
from vgyro.fusion.samples.missing import fill_missing

RATE_HZ, SIGMA = 100.0, 0.05
BIAS = np.array([1.0, -2.0, 0.5, 3.0])


def array(samples: int = 6000, kind: type = float) -> np.ndarray:
    """Four gyros in motion, [T, N], each contiguous."""
    rng = np.random.default_rng(1)
    time = np.arange(samples) / RATE_HZ
    rate = BIAS + 30 * np.sin(time)[:, None] + SIGMA * rng.standard_normal((samples, 4))
    return np.asfortranarray(rate.astype(kind))


def test_nothing_is_touched_where_nothing_is_missing():
    rate = array()
    before = rate.copy()
    assert fill_missing(rate, RATE_HZ) is None
    np.testing.assert_array_equal(rate, before)


@pytest.mark.parametrize("kind", [np.float32, float])
def test_the_others_at_the_own_offset(kind):
    truth = array(kind=kind)
    rate = truth.copy(order="F")
    rate[2000:2500, 1] = np.nan
    rate[::2, 3] = np.nan
    missing = fill_missing(rate, RATE_HZ)
    assert missing is not None
    assert missing.sum() == 500 + 3000
    np.testing.assert_array_equal(rate[~missing], truth[~missing])
    # The mean of two or three others has 0.05/√2 deg/s at most, the offsets 0.05/√500, beside the gyro's own 0.05.
    assert np.abs(rate - truth)[missing].std() < 1.3 * SIGMA
    assert np.abs((rate - truth)[missing[:, 1], 1].mean()) < 5 * SIGMA / np.sqrt(500)
    assert np.abs((rate - truth)[missing[:, 3], 3].mean()) < 5 * SIGMA / np.sqrt(3000)


def test_a_mean_leaves_the_gyro_out():
    rate = array() - BIAS
    others = np.delete(rate, 2, axis=1).mean(axis=1)
    rate[3000:, 2] = np.nan
    fill_missing(rate, RATE_HZ)
    # What is left is the offset of zero biases, known from ten seconds.
    assert np.abs(rate[3000:].mean(axis=1) - others[3000:]).max() < 5 * SIGMA / np.sqrt(1000)


def test_offsets_that_drift_are_followed():
    rate = array()
    rate[:, 0] += np.linspace(0, 5, len(rate))
    truth = rate.copy()
    rate[1::2, 0] = np.nan
    fill_missing(rate, RATE_HZ)
    assert np.abs((rate - truth)[2000:4000, 0].mean()) < 0.02


@pytest.mark.parametrize("gone", [slice(3000, 3003), slice(0, 5), slice(5990, 6000)])
def test_rows_without_any_value_are_a_straight_line(gone):
    rate = array()
    rate[gone] = np.nan
    missing = fill_missing(rate, RATE_HZ)
    assert missing is not None
    assert missing.all(axis=1).sum() == gone.stop - gone.start
    assert np.isfinite(rate).all()
    common = rate.mean(axis=1)[max(gone.start - 1, 0) : gone.stop + 1]
    inside = common[1:-1] if gone.start else common[:-1]
    assert common.min() - 0.1 <= inside.min()
    assert inside.max() <= common.max() + 0.1


def test_gyros_that_are_never_there_together():
    rate = array() - 30 * np.sin(np.arange(6000) / RATE_HZ)[:, None]
    rate[::2, :2] = np.nan
    rate[1::2, 2:] = np.nan
    fill_missing(rate, RATE_HZ)
    assert np.isfinite(rate).all()
    np.testing.assert_allclose(rate.mean(axis=0), BIAS, atol=0.02)


def test_no_value_at_all():
    rate = np.full((100, 2), np.nan, order="F")
    assert fill_missing(rate, RATE_HZ).all()
    np.testing.assert_array_equal(rate, 0.0)
    rate = array(500)
    rate[:, 1] = np.nan
    fill_missing(rate, RATE_HZ)
    np.testing.assert_allclose(rate[:, 1], (np.delete(rate, 1, axis=1) - BIAS[[0, 2, 3]]).mean(axis=1), atol=2)


def test_pieces_change_nothing(monkeypatch):
    whole, parts = array(), array()
    for rate in (whole, parts):
        rate[1000:3000, 0] = np.nan
        rate[2990:3010] = np.nan
    fill_missing(whole, RATE_HZ)
    monkeypatch.setattr(module, "PIECE", 700)
    fill_missing(parts, RATE_HZ)
    np.testing.assert_allclose(parts, whole, atol=1e-9)


@pytest.mark.parametrize("kind", ["dropout", "stuck"])
def test_a_gyro_that_is_out_from_the_first_sample_to_the_last(kind):
    # Its bias is never seen: the others go on with theirs.
    rate = np.asfortranarray(array()[:, :4] - 30 * np.sin(np.arange(6000) / RATE_HZ)[:, None])
    noise = ArrayNoise(np.full(4, SIGMA / 10), np.full(4, 1e-4), np.eye(4))
    fault = FaultEvent(1, kind, 0, 6000, np.inf, np.nan, "")
    whole = ArrayRates(rate, RATE_HZ, np.zeros(6000, np.int32), np.ones(6000, bool), noise, faults=(fault,))
    for name in ("recommended", "recommended_unsmoothed"):
        fused = METHODS[name].fuse(whole, FilterParameters())
        assert np.isfinite(fused.rate).all()
        assert fused.rate.std() < SIGMA

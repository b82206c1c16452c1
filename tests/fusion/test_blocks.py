"""Weights of blocks and their way to the samples, piece by piece."""

from dataclasses import replace

import numpy as np
import pytest

from vgyro.fusion import METHODS, FilterParameters, SampleWeights, block_of_sample, blocks
from vgyro.fusion.baselines import fixed
from vgyro.fusion.blocks import combined, cut


def test_blocks_reach_their_samples():
    # 4 Hz samples; blocks of 1 s; a gap after 2.5 s; the second stretch begins at 10.1 s.
    time = np.concatenate([np.arange(10) / 4, 10.1 + np.arange(6) / 4])
    block = block_of_sample(time, np.array([0.0, 1.0, 10.1]), 1.0, 4.0)
    assert block.tolist() == [0, 0, 0, 0, 1, 1, 1, 1, -1, -1, 2, 2, 2, 2, -1, -1]
    weights = np.array([[1.0, 0.0], [0.3, 0.7], [0.0, 1.0]])
    (expanded,) = SampleWeights.of(weights, block).pieces()
    assert expanded[0].tolist() == [1.0, 0.0]
    assert expanded[7].tolist() == [0.3, 0.7]
    assert expanded[8].tolist() == [0.5, 0.5], "a sample in no block has equal weights"


def test_block_borders_survive_rounded_time_stamps():
    # One hour at 200 Hz, time stamps that accumulate rounding: every block must have its 200 samples.
    time = np.cumsum(np.full(200 * 3600, 0.005)) - 0.005
    block = block_of_sample(time, np.arange(3600.0), 1.0, 200.0)
    assert (np.bincount(block) == 200).all()


def test_no_blocks_at_all():
    assert block_of_sample(np.arange(3.0), np.empty(0), 1.0, 1.0).tolist() == [-1, -1, -1]


def test_search_piece_by_piece(monkeypatch):
    # Expected: the last block that began before, by a search over all of them.
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.choice([0.1, 0.1, 0.1, 3.0], 5000))
    begins = time[np.sort(rng.permutation(5000)[:700])]
    monkeypatch.setattr(blocks, "PIECE", 64)
    found = block_of_sample(time, begins, 1.0, 10.0)
    late = time + 0.05
    last = np.searchsorted(begins, late, side="right") - 1
    expected = np.where((last >= 0) & (late - begins[np.maximum(last, 0)] < 1.0), last, -1)
    np.testing.assert_array_equal(found, expected)
    assert (found == -1).any()


def test_pieces_do_not_cut_a_block(monkeypatch):
    monkeypatch.setattr(blocks, "PIECE", 4)
    block = np.array([-1, 0, 0, 0, 0, 0, -1, -1, -1, -1, -1, 1, 2, 2, -1])
    parts = [((s.start, s.stop), (b.start, b.stop)) for s, b in cut(block)]
    assert parts == [((0, 6), (0, 1)), ((6, 10), (1, 1)), ((10, 14), (1, 3)), ((14, 15), (3, 3))]


def test_weighted_sums_in_double_precision(monkeypatch):
    # Expected: einsum over the whole array, in double precision.
    monkeypatch.setattr(blocks, "PIECE", 7)
    rng = np.random.default_rng(4)
    rate = rng.standard_normal((50, 3)).astype(np.float32)
    for weights in (rng.standard_normal(3), rng.standard_normal((50, 3))):
        expected = (rate.astype(float) * weights).sum(axis=1)
        np.testing.assert_allclose(combined(rate, weights), expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("gyros", [1, 2, 3, 4, 5, 6, 7, 12])
def test_median_of_any_number_of_gyros(gyros):
    # Expected: np.median, with ties, infinities and values that are not a number.
    rate = np.round(np.random.default_rng(gyros).standard_normal((400, gyros)), 1)
    rate[5, 0], rate[6, -1], rate[7, gyros // 2] = np.inf, -np.inf, np.nan
    columns = fixed.sorted_columns(rate)
    low, high = columns[(gyros - 1) // 2], columns[gyros // 2]
    np.testing.assert_array_equal((low + high) / 2, np.median(rate, axis=1))


@pytest.mark.parametrize("name", ["rolling_moment", "ewma_causal", "ewma_two_sided"])
@pytest.mark.parametrize("block_hz", [200.0, 10.0])
def test_moments_do_not_depend_on_the_pieces(make_array, monkeypatch, name, block_hz):
    # Gaps, rest and motion, a channel that dies: the same weights from one piece as from many.
    segment = np.repeat([0, 1, 2, 3], [2005, 7, 1900, 88])
    array = make_array(4000, [0.05, 0.3, 0.1], segment=segment)
    array.rate[1000:, 2] = 0.0
    resting = np.arange(4000) % 1000 < 700
    array = replace(array, at_rest=resting, rate=np.asfortranarray(array.rate))
    parameters = FilterParameters(block_hz=block_hz, moment_window_s=2.0, ewma_time_s=1.0)
    whole = METHODS[name].fuse(array, parameters)
    monkeypatch.setattr(blocks, "PIECE", 33)
    pieces = METHODS[name].fuse(array, parameters)
    weights = [np.concatenate(list(fused.weights.pieces())) for fused in (whole, pieces)]
    np.testing.assert_allclose(weights[1], weights[0], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(pieces.rate, whole.rate, rtol=1e-10, atol=1e-13)
    assert pieces.note == whole.note

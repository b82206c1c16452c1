"""Blocks of samples: what is far from the middle of its block is cut off, written out."""

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates
from vgyro.fusion.faults.block_sums import BlockSums, _cut, block_sums
from vgyro.fusion.faults.residuals import residuals_of, usual_variance

NAN = np.nan


def lower_median(values):
    return sorted(values)[(len(values) - 1) // 2]


def cut(blocks):
    """Four deviations of the block, or of the calmest quarter of the blocks that have a sample, from its median."""
    levels = [lower_median(one) if one else 0.0 for one in blocks]
    sizes = [lower_median([abs(x - level) for x in one]) / 0.6745 if one else 0.0
             for one, level in zip(blocks, levels, strict=True)]  # fmt: skip
    calm = np.quantile([size for size, one in zip(sizes, blocks, strict=True) if one], 0.25)
    return [
        [min(max(x, level - 4.0 * max(size, calm)), level + 4.0 * max(size, calm)) for x in one]
        for one, level, size in zip(blocks, levels, sizes, strict=True)
    ]


@pytest.mark.parametrize("single", [[1.0, NAN, NAN, NAN, NAN], [1.0, 1.5, NAN, NAN, NAN], [NAN] * 5])
def test_samples_far_from_their_block_are_cut_off(single):
    blocks = [single, [-0.1, 0.1, 0.0, 10.0, 0.05], [1.0, -1.0, 2.0, -2.0, 0.0], [3.0, 2.0, 4.0, 2.5, 30.0]]
    known = [[x for x in one if not np.isnan(x)] for one in blocks]
    away = np.array([np.concatenate(blocks)])
    _cut(away, np.arange(0, 20, 5))
    found = [[x for x, given in zip(row, one, strict=True) if not np.isnan(given)]
             for row, one in zip(away.reshape(4, 5).tolist(), blocks, strict=True)]  # fmt: skip
    for one, expected in zip(found, cut(known), strict=True):
        np.testing.assert_allclose(one, expected, atol=1e-12)
    # What is not known is the median of its block.
    lost = away.reshape(4, 5)[0][np.isnan(single)]
    np.testing.assert_allclose(lost, lower_median(known[0]) if known[0] else 0.0)


def test_nothing_known_at_all():
    away = np.full((1, 10), NAN)
    _cut(away, np.array([0, 5]))
    assert not away.any()


def by_hand(variance, motion):
    """Sums over 40 blocks of five gyros without means: variances [5] of their own, and that of the motion, the same."""
    gyros = len(variance)
    moment = np.zeros((gyros + 1, gyros + 1))
    apart = np.eye(gyros) - 1.0 / gyros
    moment[:gyros, :gyros] = apart @ np.diag(variance) @ apart
    moment[:gyros, gyros] = moment[gyros, :gyros] = apart @ variance / gyros
    moment[gyros, gyros] = motion + np.sum(variance) / gyros**2
    blocks = 40
    return BlockSums(
        np.arange(blocks + 1) * 20, np.full(blocks, 20), np.zeros((blocks, gyros + 1)), np.tile(moment, (blocks, 1, 1)),
        np.zeros(blocks, dtype=int), np.ones((blocks, gyros), dtype=bool),
    )  # fmt: skip


@pytest.mark.parametrize(("times", "moves"), [(24.0, False), (26.0, True)])
def test_a_block_moves(times, moves):
    # Rule: what the gyros share has 25 times the variance of the noise of the others' combination, here 1/4.
    sums = by_hand(np.ones(5), times / 4.0)
    found = residuals_of(sums, np.ones(5), np.ones((40, 5)), [])
    assert (found.moving == moves).all()
    np.testing.assert_allclose(found.variance, 1.25)
    np.testing.assert_allclose(found.energy, times / 4.0 + 0.25)
    np.testing.assert_allclose(found.product, 0.0, atol=1e-12)


def test_usual_variances_closed_form():
    # Expected: the variances that are put in, whatever the motion is, once the shares have settled.
    variance = np.array([1.0, 1.5, 2.0, 3.0, 8.0])
    np.testing.assert_allclose(usual_variance(by_hand(variance, 100.0)), variance, rtol=1e-6)
    # A gyro that is not there has none of its own: the middle one's.
    sums = by_hand(variance, 100.0)
    sums.alive[:, 4] = False
    np.testing.assert_allclose(usual_variance(sums)[:4], variance[:4], rtol=1e-6)


def test_a_noisy_gyro_does_not_spoil_what_the_others_are_found_to_be():
    # Truth: four gyros of variance 1 and one of 400. With equal shares its noise would be in all residuals, 26 times
    # their own, and what is left of each would scatter by some 10 %; with those of inverse variance it does by 3 %.
    # Tails are cut off, and a block's variance is 19/20 of the noise's, less in the median: a fifth in all.
    sd = np.array([1.0, 1.0, 1.0, 1.0, 20.0])
    rate = np.random.default_rng(1).standard_normal((400 * 20, 5)) * sd
    noise = ArrayNoise(sd, sd, np.eye(5))
    array = ArrayRates(rate, 20.0, np.zeros(len(rate), np.int32), np.ones(len(rate), bool), noise)
    found = usual_variance(block_sums(array, 20, 60.0))
    assert np.std(found[:4]) < 0.06 * np.mean(found[:4])
    np.testing.assert_allclose(found / sd**2, 0.85, atol=0.15)

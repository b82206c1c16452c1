"""Moving-block bootstrap: block length, units, coverage."""

import numpy as np
import pytest
from scipy.signal import lfilter

from vgyro.metrics import Sampling, allan_deviation, block_length, make_units, moments, read_curve, resample
from vgyro.metrics.intervals.bootstrap import percentile_limits, sampled_grid, scale_limits


def first_order(rho: float, samples: int, seed: int) -> np.ndarray:
    return lfilter([1], [1, -rho], np.random.default_rng(seed).standard_normal(samples + 500))[500:]


def test_block_length_of_an_autoregressive_series():
    # The rule of Carlstein for AR(1), ρ = 0.6, U = 4096: (√6·0.6/0.64)^(2/3)·16 = 27.9.
    lengths = [block_length(first_order(0.6, 4096, seed)) for seed in range(9)]
    assert 20 <= np.median(lengths) <= 36


def test_block_length_has_bounds():
    assert block_length(np.random.default_rng(1).standard_normal(1000)) >= 10
    assert block_length(np.cumsum(np.random.default_rng(2).standard_normal(1000))) <= 125
    assert block_length(np.zeros(1000)) == 10


def test_units_hold_all_samples_and_no_gap():
    rate = np.random.default_rng(3).standard_normal((1050, 2))
    segment = np.repeat([0, 1], [530, 520])
    units = make_units(rate, 100.0, segment)
    assert units.count.tolist() == [100, 100, 100, 100, 130, 100, 100, 100, 100, 120]
    np.testing.assert_allclose(units.total.sum(axis=0), rate.sum(axis=0))
    np.testing.assert_allclose(units.squares.sum(axis=0), (rate**2).sum(axis=0))
    # Their second differences are those of the overlapping Allan variance; at 7 Hz no part of a second is longer than a
    # sample, and no difference is left out.
    slow = make_units(rate, 7.0, segment)
    curve = allan_deviation(rate[:, 0], 7.0, np.array([1.0]), segment)
    assert slow.steps[:, 0].sum() / slow.step_count.sum() == pytest.approx(curve.deviation[0] ** 2)


def test_units_of_samples_with_short_losses():
    # By hand, at 4 Hz: slots 0-7 without 5, then 20-23 in another stretch. A unit keeps the samples of its second.
    position = np.array([0, 1, 2, 3, 4, 6, 7, 20, 21, 22, 23])
    grid = sampled_grid(Sampling(4.0, position, np.repeat([0, 1], [7, 4]).astype(np.int32)))
    units = grid.units_of(np.arange(11.0))
    assert units.count.tolist() == [4, 3, 4]
    assert units.total[:, 0].tolist() == [6, 15, 34]
    places, seconds = grid.seconds()
    assert len(places) == 2  # the second unit lacks a quarter
    assert seconds.stretch.tolist() == [0, 1]
    np.testing.assert_allclose(grid.means_of(grid.sums_of(np.arange(11.0))[0], places), [1.5, 8.5])
    assert units.step_count.sum() == 0


def test_each_statistic_has_its_own_blocks():
    # A random walk under white noise: the mean has a long memory, the squared differences at 1 s have none.
    rng = np.random.default_rng(7)
    units = make_units(rng.standard_normal((4000, 1)) + np.cumsum(rng.standard_normal((4000, 1)))[:, None] / 10, 1.0)
    blocks = resample(units, 10, 1).blocks
    assert blocks["mean"] > 10 * blocks["adev_1s"]
    assert blocks["adev_1s"] < 40


def test_same_seed_same_replicates():
    units = make_units(np.random.default_rng(4).standard_normal((3000, 2)), 10.0)
    np.testing.assert_array_equal(resample(units, 100, 1).mean, resample(units, 100, 1).mean)
    assert not np.array_equal(resample(units, 100, 1).mean, resample(units, 100, 2).mean)


def test_a_large_bias_does_not_cancel():
    rate = 1e6 + np.random.default_rng(5).standard_normal((5000, 1))
    sigma = moments(make_units(rate, 10.0), 0, 200, 1, 0.95)["sigma"]
    assert sigma.value == pytest.approx(rate.std(ddof=1), rel=1e-4)
    assert sigma.low < 1 < sigma.high


def test_limits_of_the_mean_cover_the_truth_in_correlated_noise():
    # AR(1), ρ = 0.6 between units: a plain bootstrap covers in about 67 %, blocks in about 90 %.
    inside = plain = 0
    for seed in range(150):
        units = make_units(first_order(0.6, 1000, seed)[:, None], 1.0)
        mean = moments(units, 0, 200, seed, 0.95)["mean"]
        inside += mean.low <= 0 <= mean.high
        narrow = moments(units, 0, 200, seed, 0.95, block=1)["mean"]
        plain += narrow.low <= 0 <= narrow.high
    assert inside >= 0.86 * 150
    assert plain < 0.80 * 150


def test_replicates_of_the_allan_deviation_have_its_spread():
    # Against chi²: standard error of σ(1 s) is σ/√(2 edf).
    rate = np.random.default_rng(6).standard_normal((60_000, 1))
    curve = allan_deviation(rate[:, 0], 20.0, np.array([1.0]))
    drawn = resample(make_units(rate, 20.0), 400, 1).adev_1s[:, 0]
    assert drawn.mean() == pytest.approx(read_curve(curve, 1.0)[0], rel=0.02)
    assert drawn.std() == pytest.approx(curve.deviation[0] / np.sqrt(2 * curve.edf[0]), rel=0.25)


def test_limits_of_a_size_surround_the_size_that_blocks_lose():
    # By hand: percentiles 0.75 and 0.85 about a median of 0.8, moved by 1/0.8 to the size of 1.
    replicates = np.linspace(0.7, 0.9, 101)
    low, high = scale_limits(1.0, replicates, 0.5)
    assert (low, high) == pytest.approx((0.75 / 0.8, 0.85 / 0.8))
    assert scale_limits(0.0, np.zeros(5), 0.95) == (0.0, 0.0)


def test_percentiles():
    # By hand: 2.5 % and 97.5 % of 0 … 1000, and 5 % and 95 % of minus that.
    replicates = np.column_stack([np.arange(1001.0), -np.arange(1001.0)])
    low, high = percentile_limits(replicates, 0.95)
    np.testing.assert_allclose([low, high], [[25.0, -975.0], [975.0, -25.0]])
    low, high = percentile_limits(replicates, 0.9)
    np.testing.assert_allclose([low, high], [[50.0, -950.0], [950.0, -50.0]])


def test_a_replicate_of_the_whole_has_its_figures():
    # Expected: numpy: of one block as long as the series every replicate is the series itself.
    rate = np.random.default_rng(1).standard_normal((30, 2)) + 5.0
    found = resample(make_units(rate, 1.0), 3, 1, block=30)
    np.testing.assert_allclose(found.mean, np.tile(rate.mean(axis=0), (3, 1)))
    np.testing.assert_allclose(found.sigma, np.tile(rate.std(axis=0, ddof=1), (3, 1)))

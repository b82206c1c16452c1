"""Block means and the definitions of r_t, on examples worked out by hand."""

from itertools import pairwise

import numpy as np
import pytest

from vgyro.errors import ConfigError
from vgyro.volatility import Window, block_means, detrended, window_residuals
from vgyro.volatility.batches import WindowPlaces, fitted_batch, window_batch
from vgyro.volatility.blocks import BlockMeans, RunFinder
from vgyro.volatility.windowed import fitted_residuals


def column(*values):
    return np.array(values, dtype=float)[:, None]


def test_blocks_by_hand():
    rate = np.column_stack([np.arange(10.0), 10 * np.arange(10.0)])
    series = block_means(rate, 4.0, 2.0)
    np.testing.assert_array_equal(series.values[:, 0], [0.5, 2.5, 4.5, 6.5, 8.5])
    np.testing.assert_array_equal(series.values[:, 1], [5, 25, 45, 65, 85])
    np.testing.assert_array_equal(series.time, [0, 0.5, 1, 1.5, 2])
    assert series.rate_hz == 2.0


def test_no_block_crosses_a_gap_or_leaves_rest():
    rate = column(*range(12))
    segment = np.array([0] * 5 + [1] * 7)
    rest = np.array([1, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 1], dtype=bool)
    time = np.concatenate([np.arange(5), 100.0 + np.arange(7)])
    series = block_means(rate, 1.0, 0.5, segment, rest, time)
    # Stretches: samples 0-4, 5-6, 8-11; the odd sample 4 is in no block.
    np.testing.assert_array_equal(series.values[:, 0], [0.5, 2.5, 5.5, 8.5, 10.5])
    np.testing.assert_array_equal(series.segment, [0, 0, 1, 1, 1])
    np.testing.assert_array_equal(series.stretch, [0, 0, 1, 2, 2])
    np.testing.assert_array_equal(series.time, [0, 2, 100, 103, 105])


def test_a_few_lost_samples_do_not_break_the_series():
    # Blocks of four slots; slot 5 is lost, then slots 12 to 14, then the board restarts with no time between.
    slots = np.array([0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 15, 16, 17, 18, 19, 20, 21, 22, 23])
    segment = np.array([0] * 5 + [1] * 6 + [2] * 5 + [3] * 4)
    series = block_means(slots[:, None].astype(float), 1.0, 0.25, segment, time=slots.astype(float))
    np.testing.assert_array_equal(series.values[:, 0], [1.5, 17 / 3, 9.5, 16.5, 20.5 + 1])
    np.testing.assert_array_equal(series.stretch, [0, 0, 0, 1, 2])
    np.testing.assert_array_equal(series.time, [0, 4, 8, 15, 20])


def test_full_rate_and_rates_that_do_not_divide():
    rate = np.random.default_rng(0).standard_normal((1000, 2))
    np.testing.assert_array_equal(block_means(rate, 50.0, "full").values, rate)
    odd = block_means(rate, 819.2, 100.0)
    assert odd.rate_hz == pytest.approx(819.2 / 8)
    assert odd.values.shape == (125, 2)
    with pytest.raises(ConfigError, match="200"):
        block_means(rate, 100.0, 200.0)


def test_nothing_at_rest_gives_an_empty_series():
    series = block_means(np.zeros((10, 3)), 1.0, 1.0, rest=np.zeros(10, dtype=bool))
    assert series.values.shape == (0, 3)


VALUES = np.column_stack([[1.0, 2.0, 4.0, 8.0, 16.0, 32.0], [3.0, 2.0, 1.0, 0.0, 1.0, 2.0]])


def test_definitions_by_hand():
    window = Window(1, 4)
    np.testing.assert_array_equal(window_residuals(VALUES, window, "level"), VALUES[1:4])
    demeaned = window_residuals(VALUES, window, "demeaned", ahead=1)
    # The window's mean, 14/3 and 1, also for the sample after it.
    np.testing.assert_allclose(demeaned[:, 0], [2 - 14 / 3, 4 - 14 / 3, 8 - 14 / 3, 16 - 14 / 3])
    np.testing.assert_allclose(demeaned[:, 1], [1, 0, -1, 0], atol=1e-15)
    known = window_residuals(VALUES, window, "difference", segment_start=0)
    np.testing.assert_array_equal(known[:, 0], [1, 2, 4])
    unknown = window_residuals(VALUES, window, "difference")
    assert np.isnan(unknown[0]).all()
    np.testing.assert_array_equal(unknown[1:, 0], [2, 4])


def test_residual_by_hand():
    # Three gyros; the medians are 1, 2, 3, 10, 5; span 3, so means over up to three of them.
    median = np.array([1.0, 2.0, 3.0, 10.0, 5.0])
    values = median[:, None] + np.array([-1.0, 0.0, 7.0])
    inside = window_residuals(values, Window(0, 3), "residual", span=3, ahead=2)
    # Window 0-2: (1+2)/2, (1+2+3)/3, (2+3)/2; ahead, nothing later than t: (3+10)/2, (10+5)/2.
    first_pass = np.array([1.5, 2.0, 2.5, 6.5, 7.5])
    np.testing.assert_allclose(inside, values - first_pass[:, None])


def test_residuals_keep_a_correlation_that_can_be_inverted():
    # The plain mean as first pass would make them sum to zero at every t.
    values = np.random.default_rng(1).standard_normal((300, 6))
    r = window_residuals(values, Window(0, len(values)), "residual", 15)
    assert np.linalg.eigvalsh(np.corrcoef(r.T))[0] > 0.3


def test_residual_removes_slow_motion():
    t = np.arange(600)
    motion = 0.05 * t + np.sin(2 * np.pi * t / 200)
    noise = 0.01 * np.random.default_rng(2).standard_normal((600, 4))
    r = window_residuals(noise + motion[:, None], Window(0, 600), "residual", 15)[10:-10]
    np.testing.assert_allclose(r.std(axis=0), 0.01, rtol=0.35)


def test_the_future_of_a_window_does_not_enter_it():
    values = np.random.default_rng(3).standard_normal((200, 3))
    changed = values.copy()
    changed[120:] += 100.0
    for definition in ("level", "demeaned", "difference", "residual"):
        before = window_residuals(values, Window(20, 100), definition, 15, ahead=20)
        after = window_residuals(changed, Window(20, 100), definition, 15, ahead=20)
        np.testing.assert_array_equal(before, after)


def test_detrended():
    # A line minus its centred mean is zero but for the ends, where the mean is one-sided.
    line = column(*np.arange(20.0))
    rest = detrended(line, 5)
    np.testing.assert_allclose(rest[2:-2], 0, atol=1e-12)
    np.testing.assert_allclose(rest[[0, -1], 0], [-1, 1])


def lossy(rng, samples):
    """Time, segment and rest of a recording that loses samples, restarts and moves now and then."""
    slots = np.cumsum(1 + (rng.random(samples) < 0.1) * rng.integers(0, 6, samples))
    lost = np.diff(slots, prepend=slots[:1]) > 1
    segment = np.cumsum(lost | (rng.random(samples) < 0.02)).astype(np.int32)
    rest = np.repeat(rng.random(samples // 7 + 1) < 0.8, 7)[:samples]
    return slots / 10, segment, rest


@pytest.mark.parametrize("length", [1, 4, 7])
def test_blocks_do_not_depend_on_the_pieces(length):
    # Expected: the whole recording in one piece. Whole numbers, so that every sum is exact.
    rng = np.random.default_rng(length)
    for _ in range(20):
        rate = rng.integers(-50, 50, (120, 2)).astype(float)
        time, segment, rest = lossy(rng, 120)
        whole = block_means(rate, 10.0, "full" if length == 1 else 10 / length, segment, rest, time)
        cuts = [0, *np.sort(rng.integers(0, 121, 4)), 120]
        pieces = [slice(start, stop) for start, stop in pairwise(cuts)]
        finder = RunFinder(10.0, length)
        for piece in pieces:
            finder.add(time[piece], segment[piece], rest[piece])
        means = BlockMeans(finder.runs())
        found = [means.add(list(rate[piece].T), time[piece], segment[piece]) for piece in pieces]
        found += [last] if (last := means.rest()) is not None else []
        for name in ("values", "time", "segment", "stretch"):
            joined = np.concatenate([getattr(part, name) for part in found])
            np.testing.assert_array_equal(joined, getattr(whole, name))


@pytest.mark.parametrize("definition", ["level", "demeaned", "difference", "residual"])
def test_many_windows_at_once_are_the_windows_one_by_one(definition):
    # Expected: window_residuals and fitted_residuals, bit for bit.
    rng = np.random.default_rng(0)
    values = rng.standard_normal((200, 3))
    values[60:110, 1] = 0.3
    starts, stretch_starts = np.array([20, 60, 65, 90, 152]), np.array([20, 20, 20, 90, 90])
    found = window_batch(values, WindowPlaces(starts, 40, 8, stretch_starts), definition, 7)
    for r, start, first in zip(found, starts, stretch_starts, strict=True):
        np.testing.assert_array_equal(r, window_residuals(values, Window(start, start + 40), definition, 7, 8, first))
    for begins in (starts == stretch_starts, starts > stretch_starts):
        fitted = fitted_batch(values, starts[begins], 40, definition, 7, stretch_starts[begins])
        for r, start, first in zip(fitted, starts[begins], stretch_starts[begins], strict=True):
            expected = fitted_residuals(values, Window(start, start + 40), definition, 7, first)
            np.testing.assert_array_equal(r, expected)
    stuck = window_batch(values, WindowPlaces(starts[1:2], 40, 0, stretch_starts[1:2]), definition, 7)
    fitted = fitted_batch(values, starts[1:2], 40, definition, 7, stretch_starts[1:2])
    assert not fitted[:, :, 1].any()
    np.testing.assert_array_equal(fitted[:, :, [0, 2]], stuck[:, :, [0, 2]])

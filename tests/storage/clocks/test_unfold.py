"""Wraps, midnights, restarts, damaged and missing stamps."""

import numpy as np
import pytest
from stamps import run

from vgyro.errors import DataError
from vgyro.storage.clocks.unfold import INT_LIMIT, LATEST_S, Unfolder, UnfoldRule, spikes, usable

K = np.arange(8000)


@pytest.mark.parametrize("kind", [np.int64, np.float64])
@pytest.mark.parametrize(
    ("wrap", "unit", "step"),
    [
        (2**16, "us", 10_000),
        (2**16, "ms", 50),
        (2**24, "us", 10_000),
        (2**32, "us", 10_000),
        (60_000, "ms", 20),
        (3600_000, "ms", 20),
        (86_400_000, "ms", 20),
    ],
)
def test_known_wraps(kind, wrap, unit, step):
    record, placed = run(((wrap - 33.5 * step + K * step) % wrap).astype(kind), unit=unit)
    scale = {"us": 1e-6, "ms": 1e-3}[unit]
    assert (record.lost, record.restarts) == (0, 0)
    assert record.wraps >= 1
    assert record.wrap_s == pytest.approx(wrap * scale)
    np.testing.assert_allclose(placed.time, K * step * scale, atol=1e-6)


@pytest.mark.parametrize(("unit", "wraps"), [("ms", 1), ("us", 0)])
def test_millis_of_a_counter_of_microseconds(unit, wraps):
    stamps = (2**32 / 1000 - 400.5 + K * 10.0) % (2**32 / 1000)
    assert run(stamps, unit=unit).record.wraps == wraps


def test_signed_counters_wrap():
    record, placed = run((2**31 - 5000 + K * 1000 + 2**31) % 2**32 - 2**31, unit="us")
    assert (record.wraps, record.restarts) == (1, 0)
    assert placed.time[-1] == pytest.approx(7.999)


@pytest.mark.parametrize(("missing", "wraps", "restarts"), [(0, 1, 0), (1, 1, 0), (2, 0, 1), (100, 0, 1)])
def test_the_first_wrap_must_fit_the_usual_step(missing, wraps, restarts):
    """Two periods at most, if steps are even."""
    kept = np.delete(K, 4000 + np.arange(missing)) if missing else K
    record = run((2**32 - 4000 * 10_000 + kept * 10_000) % 2**32, unit="us").record
    assert (record.wraps, record.restarts) == (wraps, restarts)


def test_a_wrap_that_is_known_may_fall_into_a_gap():
    kept = np.delete(K, 4000 + np.arange(50))
    record = run((5000 - 4000 * 10 + kept * 10) % 5000, unit="ms", wrap=5000).record
    assert (record.lost, record.restarts) == (50, 0)
    assert record.wraps == 15


@pytest.mark.parametrize("lost", [0, 500])
def test_midnight(lost):
    kept = np.delete(K, 4000 + np.arange(lost))
    stamps = (86_400 * 10**9 - 4000 * 10**7 + kept * 10**7) % (86_400 * 10**9)
    record, placed = run(stamps, unit="ns", day=True)
    assert (record.midnights, record.wraps, record.restarts, record.lost) == (1, 0, 0, lost)
    assert placed.time[-1] == pytest.approx(79.99)


@pytest.mark.parametrize(("back", "restarts"), [(2.9, 0), (3.1, 1)])
def test_jitter_takes_a_stamp_back_by_less_than_three_periods(back, restarts):
    unfolder = Unfolder(UnfoldRule(0.01, 1.0, 2.0, 3.0, (), None))
    stamps = np.array([0.0, 1, 2, 3, 4, 5, 5 - back, 6 - back])
    unfolder.feed(stamps, np.zeros(len(stamps), dtype=bool))
    assert unfolder.restarts == restarts


def test_restarts_of_arrival_stamps(rng):
    stamps = np.concatenate([K, K, K]) / 100 + rng.exponential(0.01, 3 * len(K))
    result = run(stamps, unit="s")
    assert (result.record.restarts, result.record.lost, result.placed.segment[-1]) == (2, 0, 2)
    assert result.end_rate == pytest.approx(100, rel=2e-4)
    assert [gap.lost for gap in result.record.gaps] == [None, None]


@pytest.mark.parametrize(("count", "fails"), [(85, False), (95, True)])
def test_stamps_that_always_begin_anew_are_no_clock(count, fails):
    stamps = K.copy()
    for start in np.linspace(50, 7950, count).astype(int):
        stamps[start:] = np.arange(len(K) - start)
    if fails:
        with pytest.raises(DataError, match="begin anew"):
            run(stamps, unit="ms")
    else:
        assert run(stamps, unit="ms").record.restarts == count


@pytest.mark.parametrize("value", [0.0, 99.0, 1e300, np.nan, -np.inf])
def test_one_damaged_stamp_is_interpolated(value):
    stamps = 10 + K / 100
    stamps[3000] = value
    record, placed = run(stamps, unit="s")
    assert (record.bad_stamps, record.lost, record.restarts, record.samples) == (1, 0, 0, len(K))
    assert "1 rows have no usable time stamp" in record.warnings[0]
    np.testing.assert_allclose(placed.time, K / 100, atol=1e-9)


@pytest.mark.parametrize("late", [False, True])
def test_rows_without_a_stamp_are_samples(rng, late):
    stamps = K / 100 + (rng.exponential(0.02, len(K)) if late else 0)
    for gap in (slice(0, 3), slice(500, 600), slice(3000, 3001), slice(-4, None)):
        stamps[gap] = np.nan
    record, placed = run(stamps, unit="s")
    assert (record.samples, record.lost) == (len(K), 0)
    assert record.bad_stamps >= 108
    assert placed.counter[-1] == len(K) - 1
    np.testing.assert_allclose(placed.time, K / 100, atol=0.01 if late else 1e-9)


@pytest.mark.parametrize(("off", "found"), [(4.9, False), (5.1, True)])
def test_a_spike_is_more_than_five_periods_off(off, found):
    stamps = np.array([0.0, 1, 2 + off + 1, 3, 4])
    rule = UnfoldRule(1.0, 1.0, 2.0, 3.0, (), None)
    assert spikes(stamps, np.ones(5, dtype=bool), rule).any() == found


def test_numbers_too_large_to_reckon_with():
    assert usable(np.array([INT_LIMIT - 1, INT_LIMIT, -INT_LIMIT, 1 - INT_LIMIT]), 1).tolist() == [
        True,
        False,
        False,
        True,
    ]
    beyond = np.nextafter(LATEST_S, np.inf)
    assert usable(np.array([0.0, beyond, np.nextafter(LATEST_S, 0)]), 1.0).tolist() == [True, False, True]

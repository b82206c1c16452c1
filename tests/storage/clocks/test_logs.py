"""The shared logs, whose truth is known: see EXPECTED.json beside them."""

import numpy as np
import pytest
from stamps import run

from vgyro.metrics import allan_deviation


def test_gaps_of_an_even_clock(column):
    record, placed = run(column("epoch_seconds.csv"), name="t")
    assert (record.meaning, record.even, record.time_from, record.unit) == ("sampled", True, "stamps", "s")
    assert (record.lost, len(record.gaps), len(placed.time)) == (75, 10, 3925)
    assert placed.time[-1] == pytest.approx(39.99, abs=1e-6)
    assert record.rate_hz == pytest.approx(100, rel=1e-6)
    assert [gap.lost for gap in record.gaps] == [*range(3, 13)]
    assert record.gaps[0].duration == pytest.approx(0.03, abs=1e-6)


def test_bursts_of_a_host_are_arrival_times(column):
    result = run(column("host_bursts.csv"), name="time")
    assert (result.record.meaning, result.record.lost, result.record.restarts) == ("arrival", 0, 0)
    assert result.record.rate_hz == pytest.approx(99.3, abs=0.002)
    assert result.end_rate == pytest.approx(99.3, abs=0.002)
    assert abs(result.record.rate_hz - 99.3) < 5 * result.record.rate_sd_hz


def test_the_allan_deviation_does_not_see_the_bursts(column, rng):
    """An angle read at the sampling times gives the same Allan deviation as at the even times."""
    placed = run(column("host_bursts.csv"), name="time").placed
    rate = rng.normal(size=len(placed.time)) + 0.01 * np.cumsum(rng.normal(size=len(placed.time)))
    even = allan_deviation(rate, 99.3, np.array([1.0])).deviation
    measured = allan_deviation(rate, (len(rate) - 1) / placed.time[-1], np.array([1.0])).deviation
    np.testing.assert_allclose(measured, even, rtol=0.005)
    # Nor does a motion: what is sampled at the placed times is what was sampled at the true ones.
    truth = np.arange(len(rate)) / 99.3
    assert np.abs(placed.time - truth).max() < 1e-4


@pytest.mark.parametrize("kind", [np.float64, np.int64])
def test_a_poll_loop_loses_nothing(column, kind):
    stamps = column("uneven_poll_ms.csv", ";").astype(kind)
    record, placed = run(stamps, name="millis")
    assert (record.meaning, record.even, record.time_from, record.unit) == ("sampled", False, "stamps", "ms")
    assert (record.lost, record.gaps) == (0, [])
    assert record.rate_hz == pytest.approx(95.1574, abs=1e-4)
    assert record.uneven == pytest.approx(0.161, abs=0.002)
    np.testing.assert_allclose(placed.time, (stamps - stamps[0]) * 1e-3, atol=1e-9)


@pytest.mark.parametrize("kind", [np.float64, np.int64])
def test_a_counter_of_32_bits_wraps(column, kind):
    stamps = column("micros_wrap.txt", None).astype(kind)
    record, placed = run(stamps)
    assert (record.unit, record.wraps, record.restarts, record.lost) == ("us", 1, 0, 0)
    assert record.wrap_s == pytest.approx(2**32 * 1e-6)
    assert placed.time[-1] == pytest.approx(29.99)


def test_the_board_restarts_once(column):
    """One line is cut off, so that one sample is missing as well."""
    record, placed = run(column("restart.csv"), name="ms")
    assert (record.restarts, record.lost) == (1, 1)
    again = int(np.flatnonzero(np.diff(placed.segment))[0]) + 1
    assert placed.time[again] - placed.time[again - 1] == pytest.approx(0.01)
    assert placed.counter[again] == placed.counter[again - 1] + 1
    assert (record.gaps[0].duration, record.gaps[0].lost) == (None, None)
    assert placed.counter[-1] / placed.time[-1] == pytest.approx(100)

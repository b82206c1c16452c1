"""Thinning for plots: known series, closed forms."""

import itertools

import numpy as np
import pytest

from vgyro.report.envelope import MAX_POINTS, Envelope, broken, logarithmic, places_of, stretches


def envelope(
    time: np.ndarray, values: np.ndarray, points: int = MAX_POINTS, pieces: tuple[int, ...] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Of one column that comes in pieces with these borders."""
    made = Envelope(len(time), ["x"], points)
    for part, column in zip(np.split(time, pieces), np.split(values, pieces), strict=True):
        made.feed(part, {"x": column})
    at, columns = made.result()
    return at, columns["x"]


def test_no_spike_is_lost_and_no_more_points_than_allowed() -> None:
    time = np.arange(1_000_000) / 100
    values = np.zeros(len(time))
    values[404_607], values[17] = -17.0, 3.0
    at, thinned = envelope(time, values, pieces=(262_144, 524_288, 786_432))
    assert len(at) == len(thinned) == MAX_POINTS
    assert thinned.min() == -17
    assert thinned.max() == 3
    assert abs(at[thinned.argmin()] - 4046.07) < 10
    assert (np.diff(at) >= 0).all()


@pytest.mark.parametrize("pieces", [(), (1, 2, 3), (5000,), (201, 201, 600, 9_999)])
def test_every_value_lies_within_the_envelope_of_its_run(pieces: tuple[int, ...]) -> None:
    values = np.random.default_rng(3).normal(size=10_007)
    at, thinned = envelope(np.arange(10_007.0), values, 100, pieces)
    edges = np.linspace(0, 10_007, 51).astype(int)
    for run, (start, stop) in enumerate(itertools.pairwise(edges)):
        assert thinned[2 * run] == values[start:stop].min()
        assert thinned[2 * run + 1] == values[start:stop].max()
        assert (at[2 * run], at[2 * run + 1]) == (start, stop - 1)


def test_a_short_series_stays_as_it_is_and_runs_without_values_are_nan() -> None:
    time = np.arange(50.0)
    at, thinned = envelope(time, time**2, pieces=(7, 20))
    assert np.array_equal(at, time)
    assert np.array_equal(thinned, time**2)
    values = np.where(np.arange(10_000) < 5_000, np.nan, 1.0)
    _, thinned = envelope(np.arange(10_000.0), values, 100, (2_400, 7_000))
    assert np.isnan(thinned[:50]).all()
    assert (thinned[50:] == 1).all()


def test_thinning_keeps_both_ends() -> None:
    places = places_of(5000, 100)
    assert len(places) == 100
    assert (places[0], places[-1]) == (0, 4999)
    assert np.array_equal(places_of(3, 100), [0, 1, 2])


def test_the_spectrum_keeps_its_narrow_tone() -> None:
    frequency = np.arange(0, 100, 0.01)
    density = np.ones(len(frequency))
    density[6283] = 40.0
    at, thinned = logarithmic(frequency, density, 400)
    assert len(at) <= 400
    assert at[0] > 0
    assert thinned.max() == 40
    assert abs(at[thinned.argmax()] - 62.83) < 2


def test_stretches_of_a_flag() -> None:
    flag = np.array([1, 1, 0, 0, 1, 0, 1, 1], dtype=bool)
    assert stretches(flag) == [(0, 1), (4, 4), (6, 7)]
    assert stretches(np.zeros(3, dtype=bool)) == []


def test_a_gap_in_time_breaks_the_curve() -> None:
    time = np.concatenate([np.arange(100.0), np.arange(200.0, 300.0)])
    at, values = broken(time, np.ones((200, 2)))
    assert len(at) == 201
    assert np.isnan(values[100]).all()
    assert np.isnan(values).sum() == 2

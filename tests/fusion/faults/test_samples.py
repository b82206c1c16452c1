"""Faults that single samples show, on both sides of each rule; arrays of known noise."""

import math

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.faults.candidate import SuspectedFault
from vgyro.fusion.faults.samples.absurd import find_absurd
from vgyro.fusion.faults.samples.copies import find_copies
from vgyro.fusion.faults.samples.ends_of_range import find_ends
from vgyro.fusion.faults.samples.found import _not_dead
from vgyro.fusion.faults.samples.no_rate import _is_dropout, find_dead
from vgyro.fusion.faults.search import _merged

RATE_HZ, SAMPLES = 100.0, 6000


def array_of(rate, missing=None):
    samples, gyros = rate.shape
    noise = ArrayNoise(np.full(gyros, 0.1), np.full(gyros, 0.001), np.eye(gyros))
    zeros = np.zeros(samples, np.int32)
    return ArrayRates(rate, RATE_HZ, zeros, np.ones(samples, bool), noise, missing=missing)


def white(gyros, samples=SAMPLES, seed=1):
    return np.random.default_rng(seed).standard_normal((samples, gyros))


def test_an_absurd_sample_of_one_of_three_gyros():
    # Truth: one sample of a thousand standard deviations; of two gyros none can say whose it is, nor can 999 samples.
    for gyros, samples, found in ((3, 1000, True), (2, 1000, False), (3, 999, False)):
        rate = white(gyros, samples)
        rate[500, 1] += 1000.0
        events = find_absurd(array_of(rate), 100, None, np.zeros(gyros))
        assert [(one.gyro, one.start, one.stop) for one in events] == ([(1, 500, 501)] if found else [])


def test_a_copy_and_its_scale():
    # Truth: the third gyro repeats the first for 30 s, times 0.9 and with a bias of its own.
    rate = white(3)
    rate[1000:4001, 2] = 0.9 * rate[1000:4001, 0] + 3.0
    (found,) = find_copies(array_of(rate))
    assert (found.gyro, found.other, found.start, found.stop) == (2, 0, 1000, 4001)
    assert find_copies(array_of(white(3))) == []


@pytest.mark.parametrize("still", [0, 1, 2])
def test_a_gyro_that_never_changes_is_no_copy_and_hides_none(still):
    # Truth: one gyro stands still; of the other three one repeats another.
    rate = white(4)
    rate[:, still] = 0.5
    first = 0 if still else 1
    rate[:, 3] = rate[:, first]
    found = find_copies(array_of(rate))
    assert [(one.gyro, one.other, one.start, one.stop) for one in found] == [(3, first, 0, SAMPLES)]


def test_values_that_hold_for_some_samples_are_copies_all_the_same():
    # Truth: values that stay for three samples each: two of three changes are none, and count for nothing.
    rate = np.repeat(white(3, SAMPLES // 3), 3, axis=0)
    rate[:, 1] = np.roll(rate[:, 1], 1)
    rate[:, 2] = rate[:, 0]
    found = find_copies(array_of(rate))
    assert [(one.gyro, one.other, one.start, one.stop) for one in found] == [(2, 0, 0, SAMPLES)]


@pytest.mark.parametrize(("beyond", "found"), [(1.05, False), (1.25, True), (1.6, True)])
def test_a_range_that_ends_a_tenth_before_the_others(beyond, found):
    # Rule: a gyro is at fault where the others go on by a tenth of its end: a slow sinusoid of `beyond` times that.
    turning = 100.0 * beyond * np.sin(np.arange(SAMPLES) / 200.0)
    rate = turning[:, None] + 0.2 * white(4)
    rate[:, 1] = np.clip(rate[:, 1], -100.0, 100.0)
    gone, events = find_ends(array_of(rate))
    assert gone is not None
    assert gone[:, 1].any()
    assert [(one.gyro, one.kind, one.size) for one in events] == ([(1, "clipped", 100.0)] if found else [])


def test_an_event_inside_a_dead_stretch_of_the_same_gyro_is_none():
    dead = [FaultEvent(1, "stuck", 100, 200, math.inf, math.nan, "")]

    def left(gyro, start, stop):
        return _not_dead([FaultEvent(gyro, "copy", start, stop, math.inf, math.nan, "", 0)], dead)

    assert left(1, 100, 200) == []
    assert [len(left(*one)) for one in ((0, 100, 200), (1, 99, 200), (1, 100, 201), (2, 120, 130))] == [1, 1, 1, 1]


@pytest.mark.parametrize(("value", "dropout"), [(-0.1, True), (0.1, True), (0.11, False), (-0.11, False)])
def test_a_dropout_is_at_the_count_of_zero(value, dropout):
    # Rule: between the rates of half a count on either side of zero, both included, where these are known.
    rate = white(3)
    rate[3000:3200, 0] = value
    array = array_of(rate)
    assert _is_dropout(array, 0, 3000, 3200, (-0.1, 0.1)) == dropout
    found = find_dead(array, np.array([[-0.1, 0.1]] * 3))
    assert [(one.gyro, one.kind) for one in found] == [(0, "dropout" if dropout else "stuck")]


@pytest.mark.parametrize(("away", "dropout"), [(4.0, False), (8.0, True)])
def test_without_that_a_dropout_is_six_deviations_away(away, dropout):
    # Rule: six standard deviations of a sample from what the gyro gave before, over the others, whose median has 0.5 of
    # its own. One gyro alone, or a run without samples beside it, is stuck.
    rate = 1e-3 * white(5)
    rate[:, 0] += white(1)[:, 0]
    rate[3000:3200, 0] = float(np.median(rate[2980:3220, 0])) + away
    nan = (math.nan, math.nan)
    assert _is_dropout(array_of(rate), 0, 3000, 3200, nan) == dropout
    assert not _is_dropout(array_of(rate[:, :1]), 0, 3000, 3200, nan)
    assert not _is_dropout(array_of(rate), 0, 0, SAMPLES, nan)


@pytest.mark.parametrize(("runs", "found"), [(9, True), (10, False), (15, False)])
def test_ten_runs_make_a_slow_gyro(runs, found):
    # Rule: ten runs of missing values, and at least half as many as values: the usual way of a slow gyro. Each run is
    # longer than a second, no longer than the usual one.
    missing = np.zeros((SAMPLES, 3), dtype=bool)
    missing[:, 1] = True
    missing[np.arange(1, runs) * (SAMPLES // runs), 1] = False
    events = find_dead(array_of(white(3), missing))
    assert bool(events) == found
    assert len(events) == (runs if found else 0)


@pytest.mark.parametrize(("apart", "events"), [(8, 1), (9, 2)])
def test_events_of_a_kind_within_eight_blocks_are_one(apart, events):
    def one(gyro, first, kind="step", size=1.0):
        return SuspectedFault(gyro, kind, first, first + 10, 9.0, size, "deg/s")

    found = _merged([one(1, 100), one(1, 110 + apart, "drift", -2.0), one(2, 112), one(1, 115, "noise")], 20.0)
    steps = [part for part in found if part.kind in ("step", "drift") and part.gyro == 1]
    assert len(steps) == events
    assert len(found) == events + 2
    if events == 1:
        assert (steps[0].first, steps[0].last, steps[0].size) == (100, 128, -2.0)

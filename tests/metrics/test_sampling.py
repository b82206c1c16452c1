"""Sampling: which samples may be averaged together. All expected values are counted by hand."""

import numpy as np
import pytest

from vgyro.metrics.sampling import Sampling


def test_a_short_loss_does_not_end_a_stretch_and_a_long_one_does():
    # At 10 Hz, 0.3 s: three slots lost (3, 4, 5) are bridged, four (8 … 11) are not.
    found = Sampling.of(10.0, np.array([0, 0, 0, 1, 1, 2]), np.array([0, 1, 2, 6, 7, 12]), most_lost_s=0.3)
    np.testing.assert_array_equal(found.stretch, [0, 0, 0, 0, 0, 1])
    np.testing.assert_array_equal(found.segment, [0, 0, 0, 1, 1, 2])
    assert found.missing == 3
    assert len(found) == 6


@pytest.mark.parametrize("restarted", [3, 2, -50])
def test_a_restart_ends_a_stretch_whatever_the_clock_says(restarted: int):
    found = Sampling.of(10.0, np.array([4, 4, 4, 5, 5]), np.array([0, 1, 2, restarted, restarted + 1]))
    np.testing.assert_array_equal(found.stretch, [0, 0, 0, 1, 1])
    assert np.all(np.diff(found.position) >= 1)
    assert found.missing == 0


def test_without_slots_every_segment_is_a_stretch():
    found = Sampling.of(10.0, np.array([7, 7, 8, 8, 8]))
    np.testing.assert_array_equal(found.stretch, [0, 0, 1, 1, 1])
    np.testing.assert_array_equal(found.segment, found.stretch)
    assert found.missing == 0


def test_samples_that_are_taken_out_are_lost():
    whole = Sampling.of(10.0, np.zeros(30, int), np.arange(30), most_lost_s=0.5)
    single = whole.without(np.arange(30) == 4)
    assert (single.missing, single.stretch.max(), single.segment.max(), len(single)) == (1, 0, 1, 29)
    five, six = (whole.without((np.arange(30) >= 4) & (np.arange(30) < 4 + lost)) for lost in (5, 6))
    assert (five.missing, five.stretch.max()) == (5, 0)
    assert (six.missing, six.stretch.max()) == (0, 1)
    # A loss that is there already counts, too: 3 + 3 slots in a row.
    again = whole.without(np.isin(np.arange(30), [4, 5, 6])).without(np.isin(np.arange(27), [4, 5, 6]))
    assert (again.missing, again.stretch.max()) == (0, 1)


def test_slots_within_a_segment_must_rise():
    with pytest.raises(ValueError, match="slot 1 follows slot 1"):
        Sampling.of(10.0, np.zeros(3, int), np.array([0, 1, 1]))
    with pytest.raises(ValueError, match="2 slots for 3"):
        Sampling.of(10.0, np.zeros(3, int), np.array([0, 1]))


def test_no_samples():
    found = Sampling.of(10.0, np.empty(0, int), np.empty(0, int))
    assert (len(found), found.missing, len(found.segment)) == (0, 0, 0)
    assert [part.tolist() for part in found.slots()] == [[], [0]]


def test_slots_leave_out_what_lay_between_two_stretches():
    found = Sampling.of(10.0, np.array([0, 0, 1, 2, 2]), np.array([5, 6, 9, 400, 401]))
    slot, edges = found.slots()
    np.testing.assert_array_equal(slot, [0, 1, 4, 5, 6])
    np.testing.assert_array_equal(edges, [0, 5, 7])

"""What seems wrong in the data: each bound on both of its sides."""

import numpy as np
import pytest

from vgyro.calibration.suspicions import (
    RADIAN,
    outside_recording,
    plateau_shift,
    rate_suspicion,
    relative_scales,
    same_columns,
    scale_suspicions,
    shared_channels,
    unsteady_plateaus,
)

NAMES = ["g1", "g2", "g3"]
SPANS = [(5.0 + 20 * k, 18.0 + 20 * k, rate) for k, rate in enumerate((0.0, 50.0, -50.0, 100.0, -100.0, 20.0))]


def table(noise=0.5, until=130.0):
    """A table that turns at the rates of SPANS from 4 to 19 s, 24 to 39 s, …; counts of two gyros."""
    time = np.arange(0, until, 0.01)
    rate = np.zeros(len(time))
    for start, stop, value in SPANS:
        rate[(time >= start - 1) & (time <= stop + 1)] = value
    rng = np.random.default_rng(1)
    return np.column_stack([10 * rate, -9 * rate]) + rng.normal(0, noise * 10, (len(time), 2)), time


def moved(by):
    return [(start + by, stop + by, rate) for start, stop, rate in SPANS]


def said(found):
    return [(one.message, one.sure) for one in found]


def test_good_scales_say_nothing():
    assert scale_suspicions(NAMES, np.array([1.0, 1.02, 0.97])) == []
    assert scale_suspicions(NAMES, np.full(3, np.nan)) == []


@pytest.mark.parametrize(("scale", "seen"), [(1.1499, False), (1.1501, True), (0.8501, False), (0.8499, True)])
def test_far_from_nominal_is_a_warning(scale, seen):
    found = scale_suspicions(["g1"], np.array([scale]))
    assert bool(found) == seen
    assert not any(one.sure for one in found)


@pytest.mark.parametrize(("scale", "sure"), [(1.99, False), (2.01, True), (0.51, False), (0.49, True)])
def test_a_factor_of_two_is_a_mistake(scale, sure):
    (found,) = scale_suspicions(["g1"], np.array([scale]))
    assert found.sure == sure
    assert found.message.startswith(f"the measured scale of gyro g1 is {scale} times the nominal one")


@pytest.mark.parametrize(("scale", "seen"), [(1.099, False), (1.101, True)])
def test_far_from_the_others_is_a_warning(scale, seen):
    found = scale_suspicions(NAMES, np.array([1.0, 1.0, scale]))
    assert [one.sure for one in found] == [False] * seen
    # Two gyros have no median that says which is wrong.
    assert scale_suspicions(NAMES[:2], np.array([1.0, scale])) == []


@pytest.mark.parametrize(("factor", "seen"), [(1.09, True), (1.11, False), (0.91, True), (0.89, False)])
def test_radians(factor, seen):
    (first, *_) = scale_suspicions(NAMES, np.full(3, factor / RADIAN))
    assert ("look like rad/s: multiply them by 57.29578" in first.message) == seen
    (first, *_) = scale_suspicions(NAMES, np.full(3, factor * RADIAN))
    assert first.message.startswith("the board's scales look like rad/s a count") == seen
    assert first.sure


def test_signs():
    (found,) = scale_suspicions(NAMES, np.array([1.0, -1.0, 1.0]))
    assert said([found]) == [("gyro g2 turns against the table: turn its sign in the board file", True)]
    (found,) = scale_suspicions(NAMES, np.array([-1.0, -1.0, -1.0]))
    assert found.message.startswith("all gyros turn against the table")


def test_relative_scales_of_a_line():
    rates = np.array([-10.0, 0.0, 10.0])
    means = np.column_stack([rates / 0.1, -rates / 0.2 + 7, np.full(3, np.nan)])
    relative = relative_scales(means, rates, [1, -1, 1], [0.1, 0.1, 0.1])
    assert relative[:2] == pytest.approx([1.0, 2.0])
    assert np.isnan(relative[2])


def test_plateaus_where_they_should_be_are_not_shifted():
    assert plateau_shift(*table(), SPANS) is None
    assert plateau_shift(*table(), SPANS[:2]) is None  # too few to tell
    assert plateau_shift(np.empty((0, 2)), np.empty(0), SPANS) is None


@pytest.mark.parametrize("by", [7.0, -3.0, 25.0, 2.4])
def test_shifted_plateaus_are_told_by_how_much(by):
    assert plateau_shift(*table(), moved(by)) == pytest.approx(-by, abs=0.3)


def test_a_small_shift_within_the_settling_says_nothing():
    assert plateau_shift(*table(), moved(0.7)) is None
    assert plateau_shift(*table(), moved(1.6)) is not None


def test_a_recording_that_is_never_steady_gives_no_shift():
    values, time = table()
    noise = np.random.default_rng(2).normal(0, 500, values.shape)
    assert plateau_shift(values + noise, time, moved(7.0)) is None
    assert plateau_shift(noise, time, moved(7.0)) is None


def test_plateaus_after_the_end_may_be_moved_back():
    assert plateau_shift(*table(until=121.0), moved(7.0)) == pytest.approx(-7.0, abs=0.3)


def test_an_unsteady_plateau_is_named():
    values, time = table()
    assert unsteady_plateaus(values, time, SPANS) == []
    early = [(SPANS[0][0], SPANS[0][1], 0.0), (23.5, 38.0, 50.0), *SPANS[2:]]
    (found,) = unsteady_plateaus(values, time, early)
    assert found.message.startswith("the plateau from 23.5 to 38 s is not steady: the gyros vary ")
    assert not found.sure


@pytest.mark.parametrize(("factor", "seen"), [(4.5, False), (5.5, True)])
def test_a_plateau_that_varies_five_times_as_much_is_unsteady(factor, seen):
    time = np.arange(0, 40, 0.01)
    spans = [(10.0 * k, 10.0 * k + 9.9, float(k)) for k in range(4)]
    values = np.random.default_rng(3).normal(0, 1, (len(time), 1)) + 10 * np.floor(time / 10)[:, None]
    last = time >= 30
    values[last] = 30 + (values[last] - 30) * factor
    assert bool(unsteady_plateaus(values, time, spans)) == seen


def test_a_plateau_of_one_sample_says_nothing():
    # Rule: three plateaus of more than one sample; of the one left a spread of zero would make the others unsteady.
    time = np.arange(0, 30, 0.1)
    values = np.random.default_rng(3).normal(0, 1, (len(time), 1)) * np.where(time < 20, 1.0, 9.0)[:, None]
    spans = [(0.0, 9.9, 0.0), (20.0, 29.9, 2.0), (10.0, 10.05, 1.0)]
    assert unsteady_plateaus(values, time, spans) == []
    (found,) = unsteady_plateaus(values, time, [*spans[:2], (10.0, 19.9, 1.0)])
    assert found.message.startswith("the plateau from 20 to 29.9 s")


def test_what_lies_after_the_end():
    assert outside_recording("plateau", [(0, 10), (50, 60.5)], 60.0) == []
    ((number, cut),) = outside_recording("plateau", [(0, 10), (50, 60.6)], 60.0)
    assert (number, cut.sure) == (1, False)
    assert cut.message == "the plateau from 50 to 60.6 s goes on beyond the end of the recording, at 60 s"
    ((_, late),) = outside_recording("rest", [(60, 70)], 60.0)
    assert late.sure
    assert late.message.startswith("the rest from 60 to 70 s lies after the end of the recording, at 60 s")
    ((_, cut),) = outside_recording("rest", [(59.9, 70)], 60.0)
    assert not cut.sure


def test_equal_columns_are_named_and_constant_ones_are_not():
    values = np.random.default_rng(1).integers(0, 9, (50, 3))
    assert same_columns(values, NAMES) == []
    values[:, 2] = values[:, 0]
    (found,) = same_columns(values, NAMES)
    assert found.message.startswith("gyros g1 and g3 give the same numbers in all 50 samples")
    assert same_columns(np.zeros((50, 2)), NAMES) == []
    values[-1, 2] += 1
    assert same_columns(values, NAMES) == []


@pytest.mark.parametrize(
    ("measured", "sure"), [(101.9, None), (102.1, False), (109.9, False), (110.1, True), (98.1, None), (89.9, True)]
)
def test_a_rate_that_the_stamps_contradict(measured, sure):
    found = rate_suspicion(100.0, measured)
    assert (None if found is None else found.sure) == sure


def test_one_channel_of_two_gyros():
    assert shared_channels(NAMES, ["a", "b", "c"]) == []
    (found,) = shared_channels(NAMES, ["a", "b", "a"])
    assert found.message == "gyros g1 and g3 read one channel, a: mend `field` in the board file"

"""Ends of the gyros' ranges, found in the samples, and what stands in where no gyro says anything.

Expected: the simulated range; the moments of a truncated normal variable by numerical integration (scipy).
"""

import numpy as np
import pytest
from scipy.stats import truncnorm

from vgyro.fusion import ArrayNoise, ArrayRates, Fused
from vgyro.fusion.samples.clipped import clipped, without_clipped
from vgyro.fusion.samples.quantised import step_of
from vgyro.fusion.samples.unseen import PART, stand_in

GYROS, SAMPLES, RATE_HZ = 3, 6000, 50.0


def motion(size=60.0, seed=1):
    rng = np.random.default_rng(seed)
    kernel = np.hanning(120)
    wide = np.convolve(rng.standard_normal(SAMPLES + 119), kernel, "valid")
    return size * wide / wide.std()


def array_of(truth, ends=(np.inf,) * GYROS, noise=0.2, step=0.0, missing=None, seed=2):
    rate = truth[:, None] + noise * np.random.default_rng(seed).standard_normal((len(truth), GYROS))
    rate = np.clip(rate, -np.array(ends), np.array(ends))
    if step:
        rate = step * np.rint(rate / step)
    known = ArrayNoise(np.full(GYROS, 0.03), np.full(GYROS, 1e-3), np.eye(GYROS))
    still = np.zeros(len(truth), bool)
    return ArrayRates(rate, RATE_HZ, np.zeros(len(truth), int), still, known, missing=missing)


def test_the_samples_at_both_ends_of_one_gyro():
    array = array_of(motion(), (100.0, np.inf, np.inf))
    found = clipped(array)
    np.testing.assert_array_equal(found[:, 0], np.abs(array.rate[:, 0]) == 100.0)
    assert found[:, 0].sum() > 100
    assert not found[:, 1:].any()


@pytest.mark.parametrize("step", [0.0, 0.02, 0.5])
def test_a_gyro_within_its_range_is_not_clipped(step):
    assert clipped(array_of(motion(), step=step)) is None
    assert clipped(array_of(np.zeros(SAMPLES), step=step)) is None


def test_two_samples_at_an_end_are_too_few_and_a_run_of_five_is_enough():
    def with_run(number):
        truth = 50.0 * np.sin(np.arange(SAMPLES) / 40.0)
        array = array_of(truth)
        array.rate[1000 : 1000 + number, 0] = 70.0
        return clipped(array)

    assert with_run(2) is None
    assert np.flatnonzero(with_run(5)[:, 0]).tolist() == list(range(1000, 1005))


def test_single_samples_at_an_end_by_their_number():
    """As often as chance has it at a crest, and PILE times as often."""
    rng = np.random.default_rng(5)

    def with_singles(number, beside):
        array = array_of(30.0 * np.sin(np.arange(SAMPLES) / 40.0))
        where = rng.choice(np.arange(10, SAMPLES - 10, 4), number + beside, replace=False)
        array.rate[where[:number], 0] = 70.0
        array.rate[where[number:], 0] = 69.95
        return clipped(array)

    assert with_singles(40, 2) is not None
    assert with_singles(40, 20) is None


@pytest.mark.parametrize(("beyond", "found"), [(1.0, False), (4.0, True)])
def test_below_a_step_the_others_must_go_beyond(beyond, found):
    """A rate that is held repeats a value, too.  beyond : of the others, in steps"""
    truth = np.where(np.arange(SAMPLES) % 1000 < 200, 50.0, 0.0)
    array = array_of(truth, noise=0.15, step=0.5)
    array.rate[truth == 50.0, 0] = 50.0
    array.rate[:, 1:] += 0.5 * beyond * (truth[:, None] == 50.0)
    result = clipped(array)
    assert (result is not None and result[:, 0].any()) == found


def test_missing_samples_are_not_at_an_end():
    missing = np.zeros((SAMPLES, GYROS), bool)
    missing[:, 2] = True
    array = array_of(motion(), (100.0, np.inf, 100.0), missing=missing)
    found = clipped(array)
    assert found[:, 0].any()
    assert not found[:, 2].any()


def test_clipped_samples_are_those_of_the_other_gyros_and_missing():
    truth = motion()
    array, note = without_clipped(array_of(truth, (100.0, np.inf, np.inf)))
    gone = array.missing[:, 0]
    assert np.abs(array.rate[gone, 0] - truth[gone]).max() < 1.5
    assert f"gyro 1 ({gone.sum()})" in note
    same, none = without_clipped(array_of(truth))
    assert none == ""
    assert same.missing is None


@pytest.fixture
def all_clipped():
    array, note = without_clipped(array_of(motion(), (100.0,) * GYROS))
    assert "the rate is not measured there" in note
    return array


def test_beyond_the_end_stands_what_a_normal_rate_has_there(all_clipped):
    guess = stand_in(all_clipped, None)
    gone = all_clipped.missing.all(axis=1)
    np.testing.assert_array_equal(guess.places, np.flatnonzero(gone))
    upper = guess.side > 0
    centre, share = np.median(all_clipped.rate[~gone].mean(axis=1)), upper.sum() / ((~gone).sum() + upper.sum())
    place = -truncnorm.ppf(share, -50, 50)
    deviation = (100.0 - centre) / place
    beyond = truncnorm(place, 60, loc=0.0, scale=deviation)
    excess = beyond.mean() - (100.0 - centre)
    assert guess.rate[upper] == pytest.approx(100.0 + excess, rel=0.02)
    first = int(np.argmax(upper))
    runs = np.flatnonzero(np.diff(gone, prepend=False, append=False)).reshape(-1, 2)
    run = next(stop - start for start, stop in runs if start == guess.places[first])
    assert guess.variance[first] == pytest.approx(beyond.var() * run / PART, rel=0.05)
    assert guess.excess[upper] == pytest.approx(np.sqrt(beyond.var() + excess**2), rel=0.02)


def test_a_rate_within_the_range_is_moved_to_its_end(all_clipped):
    guess = stand_in(all_clipped, None)
    rate, sd = np.zeros(SAMPLES), np.full(SAMPLES, 0.5)
    far = guess.places[::2]
    rate[far] = 130.0 * guess.side[::2]
    mended = guess.beyond(Fused(rate, sd=sd))
    np.testing.assert_array_equal(mended.rate[far], rate[far])
    np.testing.assert_array_equal(mended.sd[far], 0.5)
    inside = np.setdiff1d(guess.places, far)
    assert np.abs(mended.rate[inside]) == pytest.approx(100.0)
    assert (mended.sd[inside] > 5.0).all()
    others = np.setdiff1d(np.arange(SAMPLES), guess.places)
    np.testing.assert_array_equal(mended.rate[others], 0.0)
    assert rate[inside].any() == 0  # what was given is as it was
    assert guess.beyond(mended) is mended


def test_samples_that_were_lost_are_likely_anywhere():
    truth, missing = motion(), np.zeros((SAMPLES, GYROS), bool)
    missing[100:150] = True
    array = array_of(truth, missing=missing)
    guess = stand_in(array, missing.all(axis=1))
    assert np.isnan(guess.end).all()
    known = array.rate[~missing.all(axis=1)].mean(axis=1)
    assert guess.rate == pytest.approx(np.median(known))
    assert guess.variance == pytest.approx(known.var() * 50 / PART)
    fused = Fused(np.zeros(SAMPLES))
    assert guess.beyond(fused) is fused
    assert stand_in(array_of(truth), None) is None


@pytest.mark.parametrize(("run", "found"), [(7, False), (8, True)])
def test_a_run_that_chance_would_not_give(run, found):
    # Rule: log of the chance of a run below -(16 + log T), where what is next to the end is no pile. Of steps of 0.02
    # and noise of 0.2 two samples are alike with the chance 0.02/(2·√π·0.2) = 0.0282: each further one adds 3.57 to a
    # run, and 16 + log 6000 = 24.7 are between six of them and seven.
    array = array_of(50.0 * np.sin(np.arange(SAMPLES) / 40.0), step=0.02)
    array.rate[1000 : 1000 + run, 0] = 70.0
    array.rate[2000:2200:20, 0] = 69.9
    assert (clipped(array) is not None) == found


@pytest.mark.parametrize("far", [False, True])
def test_an_end_is_far_from_the_middle(far):
    # Rule: four deviations of the noise from the middle of the gyro's other values: a value that is repeated nearer to
    # them is no end, as of a gyro that is stuck for a while at rest.
    array = array_of(np.zeros(SAMPLES))
    array.rate[:, 0] = np.minimum(array.rate[:, 0], 0.99 if far else 0.59)
    array.rate[1000:1100, 0] = 1.0 if far else 0.6
    assert (clipped(array) is not None) == far


def test_a_grid_finer_than_the_rounding_is_none():
    # Rule: twice the rounding, four units of the last place, is no more than a twentieth of a step. In single precision
    # beside a bias of 1000 that is 0.0191.
    noise = np.random.default_rng(1).standard_normal(5000)
    for step, seen in ((0.018, 0.0), (0.021, 0.021)):
        assert step_of((1000.0 + step * np.rint(noise / step)).astype(np.float32)) == pytest.approx(seen, rel=0.01)
    assert step_of(noise) == 0.0
    assert step_of((0.01 * np.rint(100.0 * noise)).astype(np.float32)) == pytest.approx(0.01, rel=1e-3)
    assert np.isnan(step_of(np.full(100, 3.0)))

"""Samples far off count for less: simulated noise of known tails, and what is left as it is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from vgyro.fusion import ArrayNoise, ArrayRates
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.heavy_tails.robust_rate import (
    Local,
    RateSamples,
    RateSetting,
    _extra,
    _kernel,
    _near,
    _usual,
    _with_neighbours,
    box,
    first_setting,
)
from vgyro.fusion.heavy_tails.samples import WARY, _counts, _look, _stuck, _windows, without_tails
from vgyro.fusion.heavy_tails.scale_mixture import ScaleMixture, histogram
from vgyro.fusion.noise.difference_blocks import STUCK_SAMPLES

RATE_HZ, SAMPLES, GYROS = 50.0, 20_000, 4
NO_STEPS = np.zeros(GYROS)


def array_of(rate, **more):
    gyros = rate.shape[1]
    noise = ArrayNoise(np.full(gyros, 0.1), np.full(gyros, 0.001), np.eye(gyros))
    segment = np.zeros(len(rate), np.int32)
    return ArrayRates(np.asfortranarray(rate), RATE_HZ, segment, np.zeros(len(rate), bool), noise, **more)


def tailed(seed=1):
    """Three normal gyros; noise of the second: Student's t of three degrees of freedom; and the motion."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((SAMPLES, GYROS))
    noise[:, 1] = student.rvs(3, size=SAMPLES, random_state=rng)
    motion = 30.0 * np.sin(np.arange(SAMPLES) / 200.0)
    return noise, noise + motion[:, None]


def test_tails_fall_to_fishers_information():
    # Truth: Student's t of ν = 3: variance 3, Fisher's information (ν + 1)/(ν + 3) = 2/3: no estimator is below a
    # variance of 1.5, and this one is within a tenth of it. The other gyros stay as they are, to the bit.
    noise, rate = tailed()
    found, note = without_tails(array_of(rate), NO_STEPS)
    left = noise[:, 1] + found.rate[:, 1] - rate[:, 1]
    assert 0.97 * 1.5 < np.var(left) < 1.1 * 1.5
    assert abs(np.mean(left)) < 0.05
    assert np.corrcoef(left, noise[:, 0])[0, 1] == pytest.approx(0.0, abs=0.05)
    np.testing.assert_array_equal(found.rate[:, [0, 2, 3]], rate[:, [0, 2, 3]])
    assert note.startswith("heavy tails, and what is left of the deviation without them: gyro 2 (× 0.7")


def test_normal_gyros_are_left_as_they_are():
    array = array_of(np.random.default_rng(2).standard_normal((SAMPLES, GYROS)))
    for one in (array, array_of(tailed()[1][:200]), array_of(tailed()[1][:, 1:2])):
        found, note = without_tails(one, np.zeros(one.rate.shape[1]))
        assert found is one
        assert note == ""


def test_what_is_not_asked_and_not_touched():
    # A gyro with steps above its noise; samples that are missing, or at fault; a gyro that is not there at all.
    _, rate = tailed()
    array = array_of(rate)
    assert without_tails(array, np.array([0.0, 10.0, 0.0, 0.0]))[0] is array
    missing = np.zeros(rate.shape, dtype=bool)
    missing[3000:4000, 1] = missing[:, 3] = True
    faulty = FaultEvent(1, "noise", 5000, 6000, 9.0, 3.0, "1")
    found, note = without_tails(replace(array, missing=missing, faults=(faulty,)), NO_STEPS)
    assert "gyro 2 (" in note
    for rows in (slice(3000, 4000), slice(5000, 6000)):
        np.testing.assert_array_equal(found.rate[rows, 1], rate[rows, 1])
    assert (found.rate[:3000, 1] != rate[:3000, 1]).mean() > 0.5


def test_which_samples_count():
    # By definition: those neither missing nor at fault nor stuck, where one other counts as well.
    rate = np.random.default_rng(1).standard_normal((2000, 3))
    missing = np.zeros(rate.shape, dtype=bool)
    missing[100:200, 0] = missing[100:150, 1] = True
    faulty = FaultEvent(2, "noise", 1500, 1600, 9.0, 3.0, "1")
    array = array_of(rate, missing=missing, faults=(faulty,))
    used = _look(array, slice(0, 2000)).used
    expected = ~missing.T
    expected[2, 1500:1600] = False
    expected[:, 100:150] = False
    np.testing.assert_array_equal(used, expected)
    np.testing.assert_array_equal(_look(array, slice(1550, 1800)).used, expected[:, 1550:1800])


def test_a_gyro_without_steps_is_stuck():
    # Truth: one gyro repeats a value for a thousand samples; the window's half is what its ends are known to.
    values = np.random.default_rng(1).standard_normal((3, 4000))
    values[1, 1000:2000] = values[1, 1000]
    found = _stuck(values)
    assert not found[[0, 2]].any()
    assert found[1, 1000 + STUCK_SAMPLES : 2000 - STUCK_SAMPLES].all()
    assert not found[1, : 1000 - STUCK_SAMPLES].any()
    assert not found[1, 2000 + STUCK_SAMPLES :].any()
    assert not _stuck(values[[0, 2]]).any()


def test_windows_of_a_long_recording():
    # By definition: sixteen windows of a sixteenth of 65,536 samples, and one about each of the two largest steps of
    # each gyro that lie in none of them.
    rate = np.random.default_rng(1).standard_normal((300_000, 2))
    rate[[30_000, 150_000], [0, 1]] += 100.0
    chosen = _windows(array_of(rate))
    assert [(one.stop - one.start) for one in chosen[:16]] == [4096] * 16
    assert (chosen[0].start, chosen[15].stop) == (0, 300_000)
    for place in (30_000, 150_000):
        assert any(one.start <= place < one.stop for one in chosen)
    assert len(chosen) <= 16 + 4
    assert sum(one.stop - one.start for one in _windows(array_of(rate[:60_000]))) == 60_000


def test_squares_hold_the_variance_of_the_rate():
    # By definition: ((y - m - ŵ)² + v)/s² of the samples that are used.
    residual, variance = np.array([[1.0, 2.0, 3.0]]), np.array([0.5, 0.1, 0.2])
    nothing = np.zeros(3)
    local = Local(nothing, variance, nothing, nothing, nothing[None], np.array([[1.0, 2.0, 4.0]]), residual)
    look = RateSamples(residual, np.array([[True, True, False]]), np.empty(0, dtype=np.int64))
    np.testing.assert_array_equal(_counts([look], [local], 0), histogram(np.array([1.5, 4.1 / 4.0])))


def test_sizes_of_gyros_that_do_not_change():
    # Rule: the size of the others stands in for none, then the steps of the values, then 1.
    rng = np.random.default_rng(1)
    values = np.zeros((3, 4000))
    values[2] = 3.0 * rng.standard_normal(4000)
    used = np.ones(values.shape, dtype=bool)

    def usual(values, least):
        looks = [RateSamples(values, used[: len(values)], np.empty(0, dtype=np.int64))]
        return first_setting(looks, RATE_HZ, WARY, np.asarray(least)).usual

    np.testing.assert_allclose(usual(values, [0.0] * 3), 3.0, rtol=0.06)
    np.testing.assert_allclose(usual(values[:2], [0.0, 0.5]), 0.5)
    np.testing.assert_allclose(usual(values[:2], [0.0, 0.0]), 1.0)


def test_usual_variance():
    assert _usual(np.array([2.0, np.inf, 4.0, 6.0])) == 4.0
    assert _usual(np.full(3, np.inf)) == 1.0


def test_neighbours_are_one_more_witness():
    # Closed forms: at rest 2·reach neighbours predict with the variance Σk² of a sample's, k the weights of a parabola;
    # at the ends of a stretch the gyros alone say something.
    samples, reach = 4000, 5
    alone, own = np.random.default_rng(1).standard_normal(samples), np.ones(samples)
    setting = RateSetting([ScaleMixture.normal()], np.ones(1), np.zeros(1), 25, 64, reach)
    values = alone[None]
    look = RateSamples(values, np.ones((1, samples), bool), np.array([2000]))
    before = Local(alone, own, alone, own, np.zeros((1, samples)), np.ones((1, samples)), np.zeros((1, samples)))
    rate, variance = _with_neighbours(look, alone, own, setting, before)
    kernel = _kernel(reach)
    assert kernel[reach] == 0.0
    assert kernel.sum() == pytest.approx(1.0)
    near = _near(look.borders, samples, reach)
    assert near.sum() == 4 * reach
    np.testing.assert_allclose(rate[near], alone[near], rtol=1e-9)
    np.testing.assert_allclose(variance[near], 1.0, rtol=1e-9)
    expected = 1.0 / (1.0 + 1.0 / float(kernel @ kernel))
    assert np.mean(variance[~near]) == pytest.approx(expected, rel=0.1)
    assert np.var(rate[~near]) == pytest.approx(expected, rel=0.1)
    extra = _extra(np.full(samples, 0.1), own, 64)
    assert (extra >= 0.05 * (1 - 1e-9)).all()
    np.testing.assert_allclose(box(np.ones(10), 4)[3:7], 4.0)

"""Slow errors against simulated truth, and the frequency-dependent weights against their closed form."""

import time
from dataclasses import replace
from itertools import accumulate, product

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.stats import t as student
from slow_gyros import ARW, EQUAL, MOVING, RRW, SEEDS, simulated

from vgyro.fusion import ArrayNoise, CannotRun
from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.choice import _Search
from vgyro.fusion.bias.estimate import combined_without, slow_errors, slow_variance
from vgyro.fusion.bias.model import BiasEvidence, BlockNoise, Regressor, Walk
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.ours.frequency_weights import frequency_weights, weights_at
from vgyro.units import rrw_deg_s_rt_s


def interval(values):
    """95 % interval of the mean of independent values."""
    values = np.asarray(values)
    half = student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return values.mean() - half, values.mean() + half


def test_weights_at_a_frequency():
    # Expected: 1/(N² + K²/(2πf)²) by hand; far above and below, the inverse squares of N and of K.
    arw, rrw = np.array([0.1, 0.2, 0.4]), np.array([0.03, 0.01, 0.02])
    found = weights_at(np.array([1e-9, 0.02, 1e9]), arw, rrw, np.eye(3))
    for weights, density in zip(found, (rrw**2, arw**2 + (rrw / (2 * np.pi * 0.02)) ** 2, arw**2), strict=True):
        np.testing.assert_allclose(weights, 1 / density / np.sum(1 / density), rtol=1e-9)


def test_gain_of_one_gyro():
    # Expected: weights_at: in the middle of a long recording sines of one gyro alone come out with its weights there.
    arw, rrw, cycles = np.array([0.05, 0.1, 0.08]), np.array([1.5, 0.5, 1.0]) * 1e-3, np.array([8, 30, 150])
    array, _ = simulated(16_000, 3, arw, rrw)
    matrix = 0.7 * np.eye(3) + 0.3
    array = replace(array, noise=replace(array.noise, correlation=matrix))
    u = weights_at(np.array([1e9]), arw, rrw, matrix)[0]
    waves = 0.1 * np.exp(2j * np.pi * cycles[:, None] * np.arange(16_000) / 8000)
    middle = slice(4000, 12_000)
    expected = weights_at(cycles / 8000, arw, rrw, matrix)
    still = combined_without(array, u, slow_errors(array, MOVING, arw**2, walk=Walk(array.noise.rrw)))
    for gyro in range(3):
        moved = replace(array, rate=array.rate + waves.real.sum(axis=0)[:, None] * (np.arange(3) == gyro))
        z = combined_without(moved, u, slow_errors(moved, MOVING, arw**2, walk=Walk(moved.noise.rrw))) - still
        gain = 2 * (waves.conj()[:, middle] @ z[middle]) / 8000 / 0.01
        np.testing.assert_allclose(gain, expected[:, gyro], atol=1e-3)
    # The weights do change over these frequencies.
    assert np.ptp(expected, axis=0).max() > 0.3


def test_a_motion_passes_the_row():
    # Expected: the motion, to rounding: Σw = 1 at every frequency.
    array, _ = simulated(3000, 1)
    motion = np.cumsum(np.random.default_rng(0).standard_normal(3000))
    one, other = (frequency_weights(a, MOVING) for a in (array, replace(array, rate=array.rate + motion[:, None])))
    np.testing.assert_allclose(other.rate - one.rate, motion, atol=1e-10)
    assert one.dc_gain == 1.0
    assert one.weights.sum() == pytest.approx(1.0)


@pytest.mark.full
def test_less_drift_than_inverse_variance():
    # Expected: true rate known. Inverse variance weights the white noise alone; the gyros drift otherwise than that.
    ratios = []
    for seed in SEEDS:
        array, _ = simulated(3600, seed)
        truth = 20.0 * np.sin(np.arange(3600) / 3.0)
        inverse = ARW**-2 / np.sum(ARW**-2)
        errors = [
            (z - truth).reshape(60, 60).mean(axis=1)
            for z in (frequency_weights(array, MOVING).rate, array.rate @ inverse)
        ]
        ratios.append(np.std(errors[0]) / np.std(errors[1]))
    assert interval(ratios)[1] < 1.0


def test_error_between_two_rests():
    # Expected: the walk that all share is pinned at both ends, a Brownian bridge: the mean of its error over the motion
    # of T has the variance k²T/12 + P/2, at the middle k²T/4 + P/2; k = K/√N, n = ARW/√N, and P = k·n·coth(kτ/n) is
    # what a rest of τ leaves open at its end. 200 recordings: 10 % is the standard deviation of a variance.
    K, arw, rest, motion = rrw_deg_s_rt_s(200.0), 0.02, 60, 1200
    at_rest = np.ones(motion + 2 * rest, dtype=bool)
    at_rest[rest:-rest] = False
    means, middles = [], []
    for seed in range(200):
        array, bias = simulated(len(at_rest), seed, np.full(6, arw), np.full(6, K), at_rest=at_rest)
        blocks = SlowBlocks.of(array, 5.0)
        slow = slow_errors(array, MOVING, array.noise.arw**2, blocks=blocks, walk=Walk(array.noise.rrw))
        error = (slow.at_samples(slow.bias @ EQUAL) - bias @ EQUAL)[~at_rest]
        means.append(error.mean())
        middles.append(error[motion // 2])
    k, n = K / np.sqrt(6), arw / np.sqrt(6)
    end = k * n / np.tanh(k * rest / n) / 2
    assert np.mean(np.square(means)) == pytest.approx(k**2 * motion / 12 + end, rel=0.3)
    assert np.mean(np.square(middles)) == pytest.approx(k**2 * motion / 4 + end, rel=0.3)
    # What it says of itself, without chance; half a block of rest more or less.
    stated = slow_variance(EQUAL, slow)[len(blocks) // 2]
    assert stated == pytest.approx(k**2 * motion / 4 + end, rel=0.02)


def test_errors_are_as_large_as_stated_between_anchors():
    # Expected: error²/variance of 1 on average, over the whole recording (NEES), for two sets of weights.
    at_rest = np.zeros(300, dtype=bool)
    at_rest[:20], at_rest[140:160], at_rest[-20:] = True, True, True
    for weights in (EQUAL, np.array([0.5, -0.2, 0.3, 0.2, 0.1, 0.1])):
        ratios = []
        for seed in range(60):
            array, bias = simulated(300, seed, at_rest=at_rest)
            slow = slow_errors(array, MOVING, ARW**2, walk=Walk(array.noise.rrw))
            ratios.append(np.mean(((slow.bias - bias) @ weights) ** 2 / slow_variance(weights, slow)))
        low, high = interval(ratios)
        assert low < 1.0 < high


def test_differences_are_as_large_as_stated_in_motion():
    # Expected: NEES of 1 on average, of combinations in which what all share has no part.
    weights = np.array([0.5, 0.5, 0.0, 0.0, -0.5, -0.5])
    ratios = []
    for seed in range(60):
        array, bias = simulated(300, seed)
        slow = slow_errors(array, MOVING, ARW**2, walk=Walk(array.noise.rrw))
        ratios.append(np.mean(((slow.bias - bias) @ weights) ** 2 / slow_variance(weights, slow)))
    low, high = interval(ratios)
    assert low < 1.0 < high


def test_the_common_bias_lies_in_its_limits():
    # Expected: the mean bias of all gyros within 1.96 s.d. in about 95 % of 300 recordings (binomial s.d. 1.3 %),
    # though nothing but the gyros' own spread says how large it may be.
    inside = []
    for seed in range(300):
        array, bias = simulated(20, seed, spread=1.0)
        slow = slow_errors(array, MOVING, ARW**2, walk=Walk(array.noise.rrw))
        inside.append(abs((slow.bias - bias) @ EQUAL)[10] < 1.96 * np.sqrt(slow_variance(EQUAL, slow)[10]))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.04)


def common_bias(spread, seconds, off=0.0):
    """error²/variance of the mean bias of the gyros that are not `off` [200], and the mean of its squared error.

    Constant biases, white noise of 0.1 deg/s per second's mean, in 30 blocks.
    """
    arw, weights = np.full(6, 0.1 * np.sqrt(30 / seconds)), np.where(np.arange(6) == 3, off == 0, 1.0)
    ratios, squares = [], []
    for seed in range(200):
        array, bias = simulated(30, seed, arw, np.zeros(6), spread)
        far = off * (np.arange(6) == 3)
        slow = slow_errors(replace(array, rate=array.rate + far), MOVING, arw**2, walk=Walk(np.zeros(6)))
        error = (slow.bias[0] - bias[0] - far) @ weights / weights.sum()
        squares.append(error**2)
        ratios.append(error**2 / slow_variance(weights / weights.sum(), slow)[0])
    return np.array(ratios), np.mean(squares)


@pytest.mark.full
@pytest.mark.parametrize("seconds", [600, 3600])
@pytest.mark.parametrize("spread", [0.005, 0.05, 0.5])
def test_the_common_bias_is_as_large_as_stated(spread, seconds):
    # Expected: NEES of 1 (0.8 to 1.2), within 1.96 s.d. in 95 % (binomial s.d. 1.5 %) of 200 recordings, whether the
    # gyros' spread is above or below the noise of their means, 0.0041 and 0.0017 deg/s.
    ratios, _ = common_bias(spread, seconds)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.2 + 1.96 * np.std(ratios) / np.sqrt(200))
    assert np.mean(ratios < 1.96**2) == pytest.approx(0.95, abs=0.04)


@pytest.mark.full
def test_the_common_bias_with_one_gyro_far_off():
    # Expected: the error of five gyros alone, the spread over √5, and limits that hold. 200 recordings: an s.d. to 5 %.
    ratios, square = common_bias(0.005, 3600, off=1.0)
    assert np.sqrt(square) == pytest.approx(0.005 / np.sqrt(5), rel=0.15)
    assert np.mean(ratios < 1.96**2) > 0.9


def test_one_gyro_far_off_does_not_drag_the_rest():
    # Expected: the rate that the other five give without it, within their own s.d. of the common bias.
    array, bias = simulated(200, 2)
    off = replace(array, rate=array.rate + np.array([0, 0, 0, 5.0, 0, 0]))
    alone = replace(
        array, rate=np.delete(array.rate, 3, axis=1), noise=ArrayNoise(np.delete(ARW, 3), np.delete(RRW, 3), np.eye(5))
    )
    slow = slow_errors(off, MOVING, ARW**2, walk=Walk(off.noise.rrw))
    five = slow_errors(alone, MOVING, alone.noise.arw**2, walk=Walk(alone.noise.rrw))
    shift = np.mean(np.delete(slow.bias[0], 3)) - np.mean(five.bias[0])
    assert abs(shift) < np.sqrt(slow_variance(np.full(5, 0.2), five)[0])
    assert slow.bias[0, 3] - bias[0, 3] == pytest.approx(5.0, abs=0.2)


def test_walks_that_fade():
    # Expected: Gauss-Markov biases of the time 30 s are told from walks, with a level that is theirs throughout: the
    # stated variance of the common bias is the same at both ends, and differences are within theirs (NEES of about 1).
    array, _ = simulated(1500, 5, spread=0.0, rrw=np.zeros(6))
    rng, keep = np.random.default_rng(6), np.exp(-1 / 30)
    noise = rng.standard_normal((1500, 6)) * 0.02 * np.sqrt(1 - keep**2)
    bias = np.array(list(accumulate(noise, lambda before, now: keep * before + now, initial=np.zeros(6)))[1:])
    array = replace(array, rate=array.rate + bias, noise=replace(array.noise, rrw=np.full(6, 1e-3)))
    slow = slow_errors(array, MOVING, ARW**2)
    assert 10 < slow.walk.tau_s < 90
    assert "fading in" in slow.note
    stated = slow_variance(EQUAL, slow)
    assert stated[-1] == pytest.approx(stated[0], rel=0.05)
    difference = np.array([0.5, 0.5, 0.0, 0.0, -0.5, -0.5])
    assert np.mean(((slow.bias - bias) @ difference) ** 2 / slow_variance(difference, slow)) == pytest.approx(
        1, abs=0.3
    )


def test_slope_of_the_likelihood():
    # Expected: differences of the likelihood itself (scipy), with and without regressors of the temperature.
    temperature = 30.0 + 6.0 * np.sin(np.arange(400) / 30.0)
    array, _ = simulated(400, 4, temperature=temperature, slopes=np.linspace(0, 0.1, 6))
    blocks, none = SlowBlocks.of(array), np.zeros(400, dtype=bool)
    noise = 0.8 * np.eye(6) + 0.2
    array = replace(array, noise=replace(array.noise, correlation=noise))
    evidence = BiasEvidence.of(
        array, blocks, BlockNoise(np.broadcast_to(ARW**2, (400, 6)), noise), none, Regressor(temperature - 30.0)
    )
    search = _Search.of(evidence, blocks, RRW, ARW)
    for part, tau in product((search.information, search.information.first_regressors(6)), (np.inf, 40.0)):

        def value(logarithms, part=part, tau=tau):
            return search._likelihood(part, Walk(np.exp(logarithms), tau))

        expected = approx_fprime(np.log(RRW), lambda one, value=value: value(one)[0], 1e-5)
        np.testing.assert_allclose(value(np.log(RRW))[1], expected, atol=2e-2 * abs(expected).max())


@pytest.mark.full
def test_random_walks_by_likelihood():
    # Expected: the true K. Given three times as large, or not at all; the multiplier within 20 % on average.
    known, unknown = [], []
    for seed in SEEDS:
        array, _ = simulated(1500, seed, np.full(6, 0.02), np.full(6, 1e-3))
        for rrw, found in ((np.full(6, 3e-3), known), (np.full(6, np.nan), unknown)):
            given = replace(array, noise=replace(array.noise, rrw=rrw))
            slow = slow_errors(given, MOVING, array.noise.arw**2)
            assert slow.walk.how != "given"
            found.append(np.exp(np.mean(np.log(slow.walk.rrw))) / 1e-3)
    for found in (known, unknown):
        assert np.mean(found) == pytest.approx(1.0, abs=0.2)


def test_a_gyro_that_walks_faster_than_was_known():
    # Expected: its K within a factor of 1.5 of the truth, and an error nearly that of who knows; as given, far larger.
    truth = np.where(np.arange(6) == 3, 2e-2, 5e-4)
    ratios, worse = [], []
    for seed in SEEDS:
        array, bias = simulated(600, seed, np.full(6, 0.05), truth)
        errors = []
        for rrw, chosen in ((truth, False), (np.full(6, 5e-4), True), (np.full(6, 5e-4), False)):
            given = replace(array, noise=replace(array.noise, rrw=rrw))
            slow = slow_errors(given, MOVING, array.noise.arw**2, walk=None if chosen else Walk(rrw))
            errors.append(np.std((slow.bias - bias) @ EQUAL))
            if chosen:
                assert slow.walk.how == "each"
                assert slow.walk.rrw[3] == pytest.approx(2e-2, rel=0.5)
        ratios.append(errors[1] / errors[0])
        worse.append(errors[2] / errors[0])
    assert np.mean(ratios) < 1.25
    assert np.mean(worse) > 3.0


def test_a_bias_that_jumps_while_its_gyro_is_at_fault():
    # Expected: the bias after an event that is left out is found at once, within its s.d.
    array, bias = simulated(600, 1)
    jumped = np.zeros((600, 6))
    jumped[300:, 1] = 2.0
    event = FaultEvent(1, "step", 290, 330, 20.0, 2.0, "deg/s")
    slow = slow_errors(replace(array, rate=array.rate + jumped, faults=(event,)), MOVING, ARW**2)
    difference = np.array([-0.2, 1.0, -0.2, -0.2, -0.2, -0.2])
    error = (slow.bias - bias - jumped) @ difference
    sd = np.sqrt(slow_variance(difference, slow))
    after = slice(330, 340)
    assert np.all(abs(error[after]) < 4 * sd[after])
    assert np.all(sd[after] < 0.05)


def test_the_row_needs_the_white_noise():
    array, _ = simulated(100, 1)
    with pytest.raises(CannotRun, match="noise covariance"):
        frequency_weights(replace(array, noise=replace(array.noise, arw=np.full(6, np.nan))), MOVING)


@pytest.mark.full
def test_a_day_of_blocks():
    # Expected: 86,400 blocks of six gyros, with temperature, in less than 15 s of one processor.
    temperature = 30.0 + 6.0 * np.sin(np.arange(86_400) / 9000.0)
    array, _ = simulated(86_400, 1, temperature=temperature, slopes=np.linspace(0, 0.1, 6))
    start = time.process_time()
    slow = slow_errors(array, MOVING, ARW**2)
    assert time.process_time() - start < 15.0
    assert slow.temperature is not None

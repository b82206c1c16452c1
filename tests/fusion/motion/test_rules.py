"""Rules of the motion's models, each on both sides, where a function shows them by itself."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import savgol_coeffs

from vgyro.errors import DataError
from vgyro.fusion.motion.activity import _beyond
from vgyro.fusion.motion.evidence import gather, spectrum
from vgyro.fusion.motion.lowpass import _follows, pole_times
from vgyro.fusion.motion.models import UNLIMITED, Motion, fixed_bandwidth
from vgyro.fusion.motion.noisy_rate import NoisyRate
from vgyro.fusion.motion.relative import Relative, _parts, smoothing_window
from vgyro.fusion.motion.search import line_price, search, still
from vgyro.fusion.motion.shared import _tapered, shared_lines
from vgyro.fusion.motion.start import wide_start

RATE_HZ = 10.0


@pytest.mark.parametrize(("times", "clear"), [(9.6, False), (10.4, True)])
def test_motion_is_clear_of_ten_times_its_noise(times, clear):
    # Rule: mean square of the smoothed motion over that of its noise, Σc² of the Savitzky-Golay filter of the longest
    # window of 2 s, from which this slow sinusoid comes as it is.
    time = np.arange(20_000) / RATE_HZ
    slow = np.sin(2 * math.pi * 0.005 * time)
    array = SimpleNamespace(rate_hz=RATE_HZ, period=1 / RATE_HZ, stretches=lambda: [slice(0, len(slow))])
    left = float(np.sum(savgol_coeffs(17, 3) ** 2))
    noise = 0.5 / times / left
    assert smoothing_window(array, slow, noise) == (17 if clear else None)


def test_the_window_takes_no_more_than_the_noise():
    # Rule: half as much again as it takes from the noise. A rate of 2 Hz is all lost to windows above 0.5 s.
    time = np.arange(20_000) / RATE_HZ
    fast = 10.0 * np.sin(2 * math.pi * 2.0 * time)
    array = SimpleNamespace(rate_hz=RATE_HZ, period=1 / RATE_HZ, stretches=lambda: [slice(0, len(fast))])
    assert smoothing_window(array, fast, 1e-4) == 1


def test_parts_of_equal_motion():
    # By definition: 24 parts, each with a twenty-fourth of Σw².
    terms = np.random.default_rng(1).standard_normal((48_000, 3)) * np.linspace(0.1, 2.0, 48_000)[:, None]
    parts = _parts(terms)
    assert len(parts) == 24
    energy = np.array([np.sum(terms[part, 0] ** 2) for part in parts])
    np.testing.assert_allclose(energy / energy.sum(), 1 / 24, atol=1e-3)


@pytest.mark.parametrize(("gyros", "factor"), [(2, 3 / 2), (3, 3 / 3), (4, 3 / 4), (6, 5 / 3 / 6)])
def test_what_all_gyros_share(gyros, factor):
    # By definition: spread²/N times (N - 1)/(N - 3), or times 3 for three gyros and two.
    zero = np.zeros((3, gyros, gyros))
    found = Relative(np.zeros((gyros, 3)), zero, np.array([1.0, 2.0, 0.0]), 5).common
    np.testing.assert_allclose(found, factor * np.array([1.0, 4.0, 0.0]))


def test_levels_beyond_the_outermost():
    # Rule: the next level where the path takes the outermost one, to six on either side.
    known = {level: np.zeros(3) for level in (-1, 0, 1)}
    assert _beyond(known, np.array([0, 0])) == []
    assert _beyond(known, np.array([-1, 0])) == [-2]
    assert _beyond(known, np.array([0, 1])) == [2]
    assert _beyond(known, np.array([-1, 1])) == [-2, 2]
    every = {level: np.zeros(3) for level in range(-6, 7)}
    assert _beyond(every, np.array([-6, 6])) == []


def test_pole_times_closed_form():
    # -T/ln φ; none without colour.
    np.testing.assert_allclose(pole_times(np.array([0.0, math.exp(-1), 0.5, -0.2]), 0.1),
                               [0.0, 0.1, 0.1 / math.log(2), 0.0])  # fmt: skip


def test_delays_follow_the_colours():
    # Rules: χ² of the delays falls by 9, to less than half, and every gyro is coloured. Delays of ±d about their mean
    # have χ² of 4·d²/σ² of four gyros; of three none may be late by itself.
    tau = np.array([1.0, 2.0, 3.0])
    error = np.full(3, 0.1)

    def follows(delay, error=error, tau=tau):
        return _follows(np.asarray(delay), tau, np.asarray(error))

    assert follows(tau)
    assert not follows(np.zeros(3))
    assert not follows(tau[::-1])
    assert not follows(tau, error=[0.1, 0.1, 0.0])
    assert not follows(tau, tau=np.array([0.0, 1.0, 2.0]))
    # By hand: delays of τ: χ² of 2/σ²: 8 and 10 on either side of 9, with nothing left.
    assert not follows(tau, error=np.full(3, math.sqrt(2 / 8)))
    assert follows(tau, error=np.full(3, math.sqrt(2 / 10)))
    # By hand: delays of τ beside others of ±s, which are uncorrelated with it: χ² of 2 + 6·s² without the colours, 6·s²
    # with them: half of it at s² = 1/3.
    other = np.array([1.0, -2.0, 1.0])
    assert follows(tau + math.sqrt(0.30) * other, error=np.full(3, 1e-2))
    assert not follows(tau + math.sqrt(0.37) * other, error=np.full(3, 1e-2))


@pytest.mark.parametrize(("share", "smooths"), [(0.3, True), (0.39, True), (0.41, False)])
def test_bandwidths_up_to_two_fifths_of_the_rate(share, smooths):
    assert (fixed_bandwidth(share * RATE_HZ, 1.0, RATE_HZ).model != UNLIMITED) == smooths
    for bandwidth, variance in ((0.0, 1.0), (1.0, 0.0), (math.nan, 1.0), (1.0, math.inf)):
        with pytest.raises(DataError):
            fixed_bandwidth(bandwidth, variance, RATE_HZ)


def test_noise_without_a_variance_is_refused():
    z = np.random.default_rng(1).standard_normal(200)
    r = np.ones(200)
    gather(NoisyRate(z, r, np.zeros(200, dtype=int), RATE_HZ))
    r[100] = 0.0
    with pytest.raises(DataError, match="not above zero"):
        gather(NoisyRate(z, r, np.zeros(200, dtype=int), RATE_HZ))


def test_a_parameter_costs_four():
    # By definition: 4 for each parameter, and for a line of three parameters 2·ln(frequencies) more.
    z = np.random.default_rng(1).standard_normal(4096)
    found = spectrum(gather(NoisyRate(z, 1.0, np.zeros(4096, dtype=int), RATE_HZ)), RATE_HZ)
    assert still(found).price == 0.0
    for family, number in (("random_walk", 1), ("markov", 2), ("resonance", 3)):
        assert search(found, family, (), 0.1).price == pytest.approx(4.0 * number)
    assert line_price(found) == pytest.approx(12.0 + 2.0 * math.log(0.5 * found.weight.sum()))


def test_the_longest_stretch_without_its_mean():
    # By definition: of the longest stretch, tapered, the mean under the taper taken off: the sum is zero.
    segment = np.repeat([0, 1, 2], [100, 400, 200])
    rate = np.random.default_rng(1).standard_normal((700, 3)) + 5.0
    found = _tapered(rate, segment)
    assert found.shape == (400, 3)
    np.testing.assert_allclose(found.sum(axis=0), 0.0, atol=1e-9)
    assert np.abs(found).max() < 6.0
    assert not np.allclose(found, 0.0)


def test_a_line_of_one_gyro_is_not_shared():
    # Truth: 1 deg/s at 1 Hz in all gyros, or in the second alone, in noise of 0.1 deg/s.
    time = np.arange(4096) / RATE_HZ
    line, segment = np.sin(2 * math.pi * 1.0 * time), np.zeros(4096, dtype=int)
    noise = 0.1 * np.random.default_rng(1).standard_normal((4096, 4))
    assert shared_lines(noise + line[:, None], segment, RATE_HZ)(1.0)
    assert not shared_lines(noise + np.outer(line, [0, 1, 0, 0]), segment, RATE_HZ)(1.0)
    assert shared_lines((noise + line[:, None])[:, :1], segment, RATE_HZ)(1.0)


def test_a_start_among_samples_that_say_nothing():
    # By definition: 1e5 times the noise and 100 times the mean square of the steps of the samples that say something.
    z = np.array([math.nan, 1.0, 2.0, math.nan, 4.0])
    r = np.array([math.inf, 0.1, 0.2, math.inf, 0.1])
    model = Motion("random_walk", {"q": 1.0}, RATE_HZ).dynamics()
    mean, spread = wide_start(z, r, model)
    assert mean.tolist() == [1.0]
    assert spread[0, 0] == pytest.approx(1e5 * 0.2 + 100.0 * (1.0 + 4.0) / 2.0)
    assert wide_start(z, np.full(5, math.inf), model) is None
    assert wide_start(z[1:3], np.array(0.1), model)[1][0, 0] == pytest.approx(1e4 + 100.0)

"""A table that swings after a standstill: truth simulated, bounds by what a fit of its parameters leaves."""

import math

import numpy as np
import pytest

from vgyro.config import FusionOptions
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.motion.models import Motion, SpectralLine, fixed_bandwidth
from vgyro.fusion.motion.noisy_rate import NoisyRate, Standstill
from vgyro.fusion.motion.regimes import AfterRest, Regimes, lines_that_end
from vgyro.fusion.motion.smoother import smooth
from vgyro.fusion.ours.recommended import recommended

RATE_HZ, SECONDS, SD = 20.0, 200, 0.3
TIME = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ
MOVING = (TIME >= 60) & (TIME < 160)
REST = fixed_bandwidth(0.5, SD**2, RATE_HZ)
ONE = np.zeros(len(TIME), dtype=int)
NOTHING = AfterRest(np.array([], dtype=int), 1.0)


def swing(phase, offset=0.0, size=30.0, hz=0.4):
    return np.where(MOVING, offset + size * np.sin(2 * math.pi * hz * (TIME - 60) + phase), 0.0)


def rms(values):
    return math.sqrt(np.mean(values**2))


@pytest.mark.parametrize(("phase", "offset"), [(0.0, 0.0), (1.0, 0.0), (math.pi / 2, 20.0)])
@pytest.mark.parametrize("damping", [1e-9, 0.01])
def test_an_oscillator_begins_in_full_swing(phase, offset, damping):
    # As good as the motion's own smoother with the rest cut off, within 5 %. Of the sinusoid, damping 1e-9, that is
    # what a fit of 3 parameters to 2000 samples leaves of noise of 0.3 deg/s: 0.3·√(3/2000) = 0.012.
    truth = swing(phase, offset)
    noisy = NoisyRate(truth + SD * np.random.default_rng(1).standard_normal(len(TIME)), SD**2, ONE, RATE_HZ)
    q = 0.0 if damping < 1e-3 else 1e-6
    motion = Motion("oscillator", {"frequency_hz": 0.4, "damping": damping, "sd": 21.0, "q": q}, RATE_HZ)
    found = smooth(noisy, motion, standstill=Standstill(~MOVING, REST))
    cut = smooth(NoisyRate(noisy.z[MOVING], SD**2, ONE[MOVING], RATE_HZ), motion)
    middle = (TIME >= 60.5) & (TIME < 159.5)
    left = rms((cut.rate - truth[MOVING])[10:-10])
    assert rms(found.rate[middle] - truth[middle]) < 1.05 * left
    if damping < 1e-3:
        assert left < 2.0 * SD * math.sqrt(3 / 2000)
    assert rms((found.rate - truth)[middle] / np.sqrt(found.variance[middle])) < 1.5
    # At rest, half a second from the motion: 0.5 Hz of the smoother of noise alone, twice for luck.
    far = (TIME < 59.5) | (TIME >= 160.5)
    assert rms(found.rate[far] - truth[far]) < 2.0 * SD * math.sqrt(REST.calibration * 0.2)


@pytest.mark.parametrize("phase", [0.0, 1.0])
def test_a_line_that_is_the_motion_ends_with_it(phase):
    # As above, the sinusoid beside a rate that does not move: 3 parameters again.
    truth = swing(phase)
    noisy = NoisyRate(truth + SD * np.random.default_rng(2).standard_normal(len(TIME)), SD**2, ONE, RATE_HZ)
    motion = Motion("random_walk", {"q": 1e-8}, RATE_HZ, lines=(SpectralLine(0.4, 1e-9, 21.2),))
    found = smooth(noisy, motion, standstill=Standstill(~MOVING, REST))
    middle = (TIME >= 60.5) & (TIME < 159.5)
    assert rms(found.rate[middle] - truth[middle]) < 0.04


def test_a_vibration_that_goes_on_at_rest_is_followed_there():
    # A line that stands at rest, too, is known from all 4000 samples: 2 parameters and what the random walk leaves.
    truth = 3.0 * np.sin(2 * math.pi * 4.0 * TIME + 0.3)
    noisy = NoisyRate(truth + SD * np.random.default_rng(3).standard_normal(len(TIME)), SD**2, ONE, RATE_HZ)
    motion = Motion("random_walk", {"q": 1e-4}, RATE_HZ, lines=(SpectralLine(4.0, 1e-9, 2.12),))
    slow = fixed_bandwidth(0.05, SD**2, RATE_HZ)
    found = smooth(noisy, motion, standstill=Standstill(~MOVING, slow))
    assert rms(found.rate - truth) < 0.04


@pytest.mark.parametrize(("share", "ends"), [(0.4, True), (0.6, False)])
def test_half_of_a_line_at_rest_is_where_it_goes_on(share, ends):
    line = SpectralLine(0.4, 1e-9, 21.2)
    z = share * math.sqrt(2.0) * line.sd * np.sin(2 * math.pi * 0.4 * TIME)
    assert lines_that_end(NoisyRate(z, SD**2, ONE, RATE_HZ), (line,), ~MOVING) == ((0,) if ends else ())


@pytest.mark.parametrize(("seconds", "ends"), [(9.0, True), (11.0, False)])
def test_a_rest_shorter_than_a_period_says_nothing_of_the_line(seconds, ends):
    line = SpectralLine(0.1, 1e-9, 21.2)
    z = math.sqrt(2.0) * line.sd * np.sin(2 * math.pi * 0.1 * TIME)
    assert lines_that_end(NoisyRate(z, SD**2, ONE, RATE_HZ), (line,), seconds > TIME) == ((0,) if ends else ())


def test_a_vibration_whose_phase_wanders_goes_on():
    # Known truth: a resonator of damping 0.05 at 2 Hz keeps its phase for 1.6 s. Over 100 s of rest one sinusoid
    # holds a thirtieth of its power, pieces of 1.6 s 2/e of it.
    line, rng = SpectralLine(2.0, 0.05, 3.0), np.random.default_rng(4)
    made = Motion("random_walk", {"q": 0.0}, RATE_HZ, lines=(line,)).dynamics()
    state, z = np.zeros(3), np.empty(len(TIME))
    steps = rng.standard_normal((len(TIME), 2)) @ np.linalg.cholesky(made.process[1:, 1:]).T
    for sample, step in enumerate(steps):
        state = made.transition @ state + np.append(0.0, step)
        z[sample] = made.reads @ state
    assert lines_that_end(NoisyRate(z, SD**2, ONE, RATE_HZ), (line,), ~MOVING) == ()


def test_noise_at_rest_is_no_line():
    # Rule: what the noise does to a fit is allowed for: 2·0.09 of each piece of 1.6 s, against 0.25·0.01·32 to go on.
    z = SD * np.random.default_rng(5).standard_normal(len(TIME))
    assert lines_that_end(NoisyRate(z, SD**2, ONE, RATE_HZ), (SpectralLine(2.0, 0.05, 0.1),), ~MOVING) == (0,)


def test_the_rate_goes_on_where_a_line_ends():
    # Known truth: the table stops in mid-swing and keeps that rate. No jump is seen, and the level takes it over: half
    # a second after the end the error is that of the level's smoother, far below the 25 deg/s of the swing.
    truth = np.where(TIME < 160, 30.0 * np.sin(2 * math.pi * 0.4 * TIME + 1.0), 30.0 * math.sin(1.0))
    noisy = NoisyRate(truth + SD * np.random.default_rng(6).standard_normal(len(TIME)), SD**2, ONE, RATE_HZ)
    motion = Motion("random_walk", {"q": 1e-8}, RATE_HZ, lines=(SpectralLine(0.4, 1e-9, 21.2),))
    ended = Standstill(TIME >= 160, REST)
    regimes = Regimes.of(motion, motion.dynamics(), len(TIME), None)
    still = regimes.with_rest(
        motion, motion.dynamics(), Standstill(TIME >= 160, REST), 0.01, NOTHING._replace(lines=(0,))
    )
    # The rate, level and x, before and after a step into rest: the same.
    state = np.array([1.0, 2.0, 3.0])
    reads = motion.dynamics().reads
    assert reads @ still.transition[-1] @ state == pytest.approx(reads @ state)
    found = smooth(noisy, motion, standstill=ended)
    assert rms((found.rate - truth)[TIME >= 160.5]) < SD


def test_a_gap_at_rest_breaks_the_phase():
    # Two stretches at rest, the second in the opposite phase: each by itself holds all of the line.
    line, half = SpectralLine(0.4, 1e-9, 21.2), len(TIME) // 2
    z = math.sqrt(2.0) * line.sd * np.sin(2 * math.pi * 0.4 * TIME) * np.where(np.arange(len(TIME)) < half, 1.0, -1.0)
    gap = (np.arange(len(TIME)) >= half).astype(int)
    rest = np.ones(len(TIME), dtype=bool)
    assert lines_that_end(NoisyRate(z, SD**2, gap, RATE_HZ), (line,), rest) == ()
    assert lines_that_end(NoisyRate(z, SD**2, ONE, RATE_HZ), (line,), rest) == (0,)


def test_what_grows_within_a_period_begins_at_zero():
    # 1/(2ζω) is one period, 2π/ω, at ζ = 1/(4π) = 0.0796.
    for damping, begins in ((0.079, True), (0.080, False)):
        motion = Motion("oscillator", {"frequency_hz": 0.4, "damping": damping, "sd": 21.0, "q": 1e-3}, RATE_HZ)
        dynamics = motion.dynamics()
        regimes = Regimes.of(motion, dynamics, len(TIME), None)
        with_rest = regimes.with_rest(motion, dynamics, Standstill(~MOVING, REST), 0.01, NOTHING)
        assert (with_rest.process[-1][1, 1] > 0.0) == begins


@pytest.mark.parametrize(("size", "hz", "phase"), [(60.0, 0.1, 0.0), (20.0, 0.7, 1.5)])
def test_recommended_on_a_rate_table_that_swings(size, hz, phase):
    # Known truth: four gyros, white noise of 0.2 deg/s at 50 Hz, one minute at rest and three in a sinusoid. The plain
    # average has 0.1; the error had been 4.8 and 2.5 with a stated s.d. of 0.02. The least: at rest what a random walk
    # leaves, in motion some parameters.
    rate_hz, samples = 50.0, 12_000
    time = np.arange(samples) / rate_hz
    moving = time >= 60
    truth = np.where(moving, size * np.sin(2 * math.pi * hz * (time - 60) + phase), 0.0)
    rate = truth[:, None] + 0.2 * np.random.default_rng(0).standard_normal((samples, 4))
    noise = ArrayNoise(np.full(4, 0.2 / math.sqrt(rate_hz)), np.full(4, 1e-9), np.eye(4))
    array = ArrayRates(np.asfortranarray(rate), rate_hz, np.zeros(samples, dtype=int), ~moving, noise)
    fused = recommended(array, FilterParameters.of(FusionOptions(), True, 1.0, "native"))
    assert rms(fused.rate - truth) < 0.5 * rms(rate.mean(axis=1) - truth)
    assert rms((fused.rate - truth) / fused.sd) < 1.2

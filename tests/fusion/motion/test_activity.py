"""How lively the rate is: against simulated truth, an oracle that knows it, and every path written out."""

from itertools import product

import numpy as np
import pytest

from vgyro.fusion import METHODS, ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.motion import activity, smoother
from vgyro.fusion.motion.models import Activity, Motion, fixed_bandwidth
from vgyro.fusion.motion.noisy_rate import NoisyRate, Standstill
from vgyro.fusion.ours.array_estimate import analysed

RATE_HZ, R = 100.0, 0.09
SECONDS = 120


def one_stretch(samples):
    return np.zeros(samples, dtype=np.int32)


def walk(seed, density):
    """A random walk of the density q [T], deg²/s³, and it measured with white noise of the variance R."""
    rng = np.random.default_rng(seed)
    rate = np.cumsum(np.sqrt(density / RATE_HZ) * rng.standard_normal(len(density)))
    return rate, rate + np.sqrt(R) * rng.standard_normal(len(density))


def band_limited(seed, samples, sd=20.0, bandwidth_hz=0.5):
    rng = np.random.default_rng(seed)
    lines = np.fft.rfft(rng.standard_normal(samples))
    lines[np.fft.rfftfreq(samples, 1 / RATE_HZ) > bandwidth_hz] = 0.0
    rate = np.fft.irfft(lines, samples)
    rate *= sd / rate.std()
    return rate, rate + np.sqrt(R) * rng.standard_normal(samples)


def lively(high=100.0, low=0.01):
    """Density of a rate that is lively for 12 s in 30."""
    second = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ
    return np.where(second % 30 < 12, high, low)


@pytest.mark.parametrize("model", ["random_walk", "chosen"])
def test_a_rate_that_is_as_its_model_says_has_one_level(model):
    # Truth: stationary motion, a random walk whose q is known and band-limited noise whose model is chosen; 12 seeds.
    samples = int(SECONDS * RATE_HZ)
    for seed in range(12):
        if model == "random_walk":
            _, z = walk(seed, np.full(samples, 3.0))
            motion = Motion("random_walk", {"q": 3.0}, RATE_HZ)
        else:
            _, z = band_limited(seed, samples)
            motion = smoother.choose_motion(NoisyRate(z, R, one_stretch(samples), RATE_HZ))
        assert activity.find_activity(NoisyRate(z, R, one_stretch(samples), RATE_HZ), motion) is None


def test_a_rate_that_comes_and_goes():
    # Expected: at most 10 % more mean square error than an oracle that knows q at every sample; where it is calm less
    # than half the error that one q has; errors no larger than stated (NEES).
    density, still, nees = lively(), one_stretch(int(SECONDS * RATE_HZ)), []
    for seed in range(4):
        rate, z = walk(seed, density)
        motion = smoother.choose_motion(NoisyRate(z, R, still, RATE_HZ), models=["random_walk"])
        found = activity.find_activity(NoisyRate(z, R, still, RATE_HZ), motion)
        level = (density == density.min()).astype(np.uint8)
        known = Activity(level, np.sqrt(np.array([density.max(), density.min()]) / motion.parameters["q"]), 1)
        runs = [smoother.smooth(NoisyRate(z, R, still, RATE_HZ), motion, activity=one) for one in (found, known, None)]
        ours, oracle = (float(np.mean((run.rate - rate) ** 2)) for run in runs[:2])
        assert ours < 1.1 * oracle
        calm = level == 1
        assert np.std((runs[0].rate - rate)[calm]) < 0.5 * np.std((runs[2].rate - rate)[calm])
        nees.append(np.mean((runs[0].rate - rate) ** 2 / runs[0].variance))
    # Levels are left late rather than early, as a change costs: errors are stated too large rather than too small.
    assert 0.7 < np.mean(nees) < 1.1


def test_levels_are_those_of_the_truth():
    # Truth: q is 100 and 0.01 deg²/s³; a level is a factor of 4, and the ends of a lively time are found to a second.
    density = lively()
    _, z = walk(5, density)
    found = activity.find_activity(
        NoisyRate(z, R, one_stretch(len(z)), RATE_HZ), Motion("random_walk", {"q": 1.0}, RATE_HZ)
    )
    # A level is left late rather than early, so the calm one is taken somewhat too high.
    q = found.factor[found.level]
    second = np.arange(len(z)) / RATE_HZ % 30
    inside, outside = (second > 1) & (second < 11), (second > 13) & (second < 29)
    assert np.median(q[inside]) == pytest.approx(100.0, rel=3.0)
    assert np.median(np.log10(q[outside])) == pytest.approx(-2.0, abs=1.0)
    assert np.mean((q > 1) == (density > 1)) > 0.95


def test_coloured_noise_is_no_liveliness():
    # Truth: a constant density, noise of AR(1) 0.5.
    from scipy.signal import lfilter

    for seed in range(6):
        rate, _ = walk(seed, np.full(12_000, 3.0))
        noise = lfilter([np.sqrt(0.75 * R)], [1, -0.5], np.random.default_rng(seed + 100).standard_normal(12_000))
        motion = Motion("random_walk", {"q": 3.0}, RATE_HZ)
        assert activity.find_activity(NoisyRate(rate + noise, R, one_stretch(12_000), RATE_HZ, 0.5), motion) is None


def test_the_path_against_all_paths():
    # Expected: the least cost of all 3^7 paths, with a gap before the fifth block.
    rng = np.random.default_rng(2)
    known = {level: rng.uniform(0, 3, 7) for level in (-1, 0, 1)}
    apart = np.array([True, False, False, False, True, False, False])

    def costs(path):
        total = sum(known[level][block] for block, level in enumerate(path))
        for block, level in enumerate(path):
            before = 0 if apart[block] else path[block - 1]
            total += 1.3 * (level != before)
        return total

    found = activity._path(known, 1.3, apart)
    assert costs(found.tolist()) == pytest.approx(min(map(costs, product((-1, 0, 1), repeat=7))), rel=1e-12)


def test_blocks_do_not_reach_over_gaps():
    segment = np.repeat([0, 1, 2], [103, 7, 60])
    np.testing.assert_array_equal(activity._blocks(segment, 25), [0, 25, 50, 75, 103, 110, 135])


def test_nothing_to_change():
    # A rate that does not move, one that is not smoothed, and a sinusoid.
    z, still = np.random.default_rng(1).standard_normal(1000), one_stretch(1000)
    sine = {"frequency_hz": 0.3, "damping": 1e-9, "sd": 3.0, "q": 0.0}
    for motion in (("random_walk", {"q": 0.0}), ("none", {}), ("oscillator", sine)):
        assert activity.find_activity(NoisyRate(z, 1.0, still, RATE_HZ), Motion(*motion, RATE_HZ)) is None


def test_samples_that_say_nothing_and_gaps():
    # Truth: as above, with a quarter of the samples lost in pieces and a gap in time: the levels hold at the others.
    density = lively()
    _, z = walk(6, density)
    segment, r = one_stretch(len(z)), np.full(len(z), R)
    segment[7000:] = 1
    r[np.arange(len(z)) % 400 < 100] = np.inf
    z[np.isinf(r)] = np.nan
    found = activity.find_activity(NoisyRate(z, r, segment, RATE_HZ), Motion("random_walk", {"q": 1.0}, RATE_HZ))
    assert np.mean((found.factor[found.level] > 1) == (density > 1)) > 0.93


def test_what_is_at_rest_does_not_count():
    # Truth: between two rests the rate is as its model says; at rest it does not move at all.
    samples = int(SECONDS * RATE_HZ)
    at_rest = np.zeros(samples, dtype=bool)
    at_rest[:3000], at_rest[-3000:] = True, True
    rest = fixed_bandwidth(1.0, R, RATE_HZ)
    motion = Motion("random_walk", {"q": 3.0}, RATE_HZ)
    for seed in range(4):
        _, z = walk(seed, np.where(at_rest, 0.0, 3.0))
        assert (
            activity.find_activity(NoisyRate(z, R, one_stretch(samples), RATE_HZ), motion, Standstill(at_rest, rest))
            is None
        )


@pytest.mark.parametrize("height", [0.0, 10.0])
def test_a_jump_at_the_end_of_standstill(height):
    # Expected: without a jump, one smoother over both sides; with one, each side as if smoothed alone, since it may lie
    # anywhere. r.m.s. of the error in the first second: that of the smoother of the motion at its end, √(K·r).
    samples, edge = 4000, 2000
    at_rest = np.arange(samples) < edge
    rest = fixed_bandwidth(1.0, R, RATE_HZ)
    motion = Motion("random_walk", {"q": 0.01}, RATE_HZ)
    z = np.where(at_rest, 0.0, height) + np.sqrt(R) * np.random.default_rng(3).standard_normal(samples)
    found = smoother.smooth(
        NoisyRate(z, R, one_stretch(samples), RATE_HZ), motion, standstill=Standstill(at_rest, rest)
    )
    if height:
        after = smoother.smooth(NoisyRate(z[edge:], R, one_stretch(samples - edge), RATE_HZ), motion)
        before = smoother.smooth(NoisyRate(z[:edge], R, one_stretch(edge), RATE_HZ), rest)
        np.testing.assert_allclose(found.rate, np.append(before.rate, after.rate), atol=1e-4)
        np.testing.assert_allclose(found.variance, np.append(before.variance, after.variance), rtol=1e-3)
    else:
        assert np.abs(np.diff(found.rate[edge - 2 : edge + 2])).max() < 0.02


def driven(seed):
    """Six gyros at 100 Hz, 0.2 deg/s a sample, on a board that is moved for some seconds at a time; the true rate [T].

    Band-limited motion to 0.8 Hz of 20 deg/s, under an envelope that rises and falls within a second; still in between.
    """
    samples = int(SECONDS * RATE_HZ)
    motion, _ = band_limited(seed, samples, 20.0, 0.8)
    rng = np.random.default_rng(seed + 500)
    second, envelope = np.arange(samples) / RATE_HZ, np.zeros(samples)
    for start in np.cumsum(rng.uniform(8, 20, 8)):
        rise = np.clip(second - start, 0.0, 1.0) * np.clip(start + rng.uniform(3, 6) - second, 0.0, 1.0)
        envelope += rise**2 * (3.0 - 2.0 * rise) * rng.choice([0.1, 1.0])
    rate = motion * envelope
    noise = ArrayNoise(np.full(6, 0.02), np.full(6, 1e-5), np.eye(6))
    rates = np.asfortranarray(rate[:, None] + 0.2 * rng.standard_normal((samples, 6)))
    still = np.zeros(samples, dtype=bool)
    return ArrayRates(rates, RATE_HZ, one_stretch(samples), still, noise), rate


def test_recommended_where_the_board_is_moved_now_and_then(monkeypatch):
    # Expected: where the board is still, less than 0.9 of the error of the same without levels; less over all, and a
    # tenth of that of the random-walk filter; errors as large as stated. Truth: the simulated rate, 4 seeds.
    moving, nees, calm = FilterParameters(in_motion=True), [], []
    for seed in range(4):
        array, rate = driven(seed)
        with_levels = METHODS["recommended"].fuse(array, moving)
        filtered = METHODS["jiang_random_walk"].fuse(array, moving)
        with monkeypatch.context() as patch:
            patch.setattr("vgyro.fusion.ours.smoothed.find_activity", lambda *_: None)
            without = METHODS["recommended"].fuse(driven(seed)[0], moving)
        errors = [float(np.std(one.rate - rate)) for one in (with_levels, without, filtered)]
        assert errors[0] < errors[1]
        assert errors[0] < 0.1 * errors[2]
        still = np.convolve(rate != 0.0, np.ones(101), mode="same") < 0.5
        calm.append([float(np.std((one.rate - rate)[still])) for one in (with_levels, without)])
        assert "of the time with" in with_levels.note
        nees.append(np.mean(((with_levels.rate - rate) / with_levels.sd) ** 2))
    assert np.mean([one[0] / one[1] for one in calm]) < 0.9
    assert 0.7 < np.mean(nees) < 1.2


def test_a_colour_that_one_gyro_has_by_chance_is_no_pole():
    # Truth: white noise and no pole. Here one gyro's noise seems correlated by 3 standard errors; taken for
    # a pole of 1.9 ms it made the error 0.04 deg/s, twice that of the smoother.
    array, rate = driven(2)
    moving = FilterParameters(in_motion=True)
    phi = analysed(array, moving).variances.phi
    assert np.count_nonzero(phi) == 1
    found = METHODS["recommended"].fuse(array, moving)
    assert "pole" not in found.note
    assert np.mean(((found.rate - rate) / found.sd) ** 2) == pytest.approx(1.0, abs=0.2)

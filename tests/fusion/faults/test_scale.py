"""Scale factors that change, function by function: simulated arrays in motion whose truth is known."""

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, ArrayRates
from vgyro.fusion.faults.block_sums import block_sums
from vgyro.fusion.faults.residuals import residuals_of, usual_variance
from vgyro.fusion.faults.scale import relative_gain, slope_in, suspect_scale, usual_slope

RATE_HZ, SECONDS, GYROS, NOISE = 20.0, 400, 5, 0.1
TIMES = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ


def within(start, stop):
    return np.searchsorted([start, stop], TIMES, side="right") == 1


def sums_of(scale=0.0, start=0, stop=SECONDS, moving=(0, SECONDS), seed=1):
    """Sums over blocks of 1 s; the third gyro is too sensitive by `scale` from start to stop, s."""
    motion = 20.0 * np.sin(TIMES * 2.0 * np.pi * 0.31) * within(*moving)
    rate = motion[:, None] + NOISE * np.random.default_rng(seed).standard_normal((len(TIMES), GYROS))
    rate[:, 2] += scale * motion * within(start, stop)
    noise = ArrayNoise(np.full(GYROS, NOISE / np.sqrt(RATE_HZ)), np.full(GYROS, 1e-6), np.eye(GYROS))
    segment = np.zeros(len(TIMES), dtype=np.int32)
    return block_sums(ArrayRates(rate, RATE_HZ, segment, np.zeros(len(TIMES), bool), noise), int(RATE_HZ), 60.0)


def found_in(sums):
    sigma2 = usual_variance(sums)
    return residuals_of(sums, sigma2, np.ones((len(sums), GYROS)), [])


def suspected(sums, gyro=2, threshold=8.0, counts=None):
    counts = np.ones(len(sums), dtype=bool) if counts is None else counts
    local = np.full(len(sums), NOISE**2 * GYROS / (GYROS - 1))
    return suspect_scale(sums, found_in(sums), gyro, counts, local, threshold)


def test_a_change_of_scale_has_its_size_and_place():
    found = suspected(sums_of(0.02, 100, 200))
    assert (found.kind, found.gyro) == ("scale", 2)
    assert found.size == pytest.approx(0.02, rel=0.1)
    assert abs(found.first - 100) <= 5
    assert abs(found.last - 200) <= 5
    # By hand: the slope over its standard error: Σw² of 2000 samples of 200 (deg/s)², noise of 0.1·√1.25. Not less, as
    # the window is the best one; how the slopes scatter in health may take some off.
    evidence = 0.02 * np.sqrt(2000 * 200.0) / (NOISE * np.sqrt(1.25))
    assert 0.5 * evidence < found.evidence < 1.1 * evidence
    assert suspected(sums_of(0.02, 100, 200), threshold=1.2 * evidence) is None


@pytest.mark.parametrize(("scale", "seen"), [(0.0, False), (0.0042, False), (0.0058, True)])
def test_half_a_percent_is_left_over_by_calibrations(scale, seen):
    assert (suspected(sums_of(scale, 100, 300)) is not None) == seen


def test_in_which_blocks_it_is_looked_for():
    # Rule: sixteen blocks in motion, at least; none where something else is wrong.
    for seconds, seen in ((15, False), (40, True)):
        sums = sums_of(0.05, 100, 100 + seconds // 2, (100, 100 + seconds))
        assert (suspected(sums) is not None) == seen
    counts = np.ones(SECONDS, dtype=bool)
    counts[95:205] = False
    assert suspected(sums_of(0.02, 100, 200), counts=counts) is None


def test_a_change_early_in_the_motion_ends_a_fault():
    # Rule: what is off from the start, for more than a twentieth of the motion, is the part without the fault.
    found = suspected(sums_of(0.02, 0, 100))
    assert found.last == SECONDS
    assert abs(found.first - 100) <= 5
    assert found.size == pytest.approx(-0.02 / 1.02, rel=0.1)


@pytest.mark.parametrize("moving", [(0, SECONDS), (100, 300), (390, SECONDS), (397, SECONDS)])
def test_the_usual_slope(moving):
    # Truth: the residual follows the others by a constant error of the scale; blocks at rest know nothing of it, and
    # fewer than eight blocks in motion are not asked.
    sums = sums_of(0.01, moving=moving)
    found = found_in(sums)
    everywhere = np.ones(len(sums), dtype=bool)
    slope = usual_slope(sums, found, 2, everywhere)
    assert slope == (0.0 if moving[0] > 392 else pytest.approx(0.01, abs=0.002))
    if moving[0] < 392:
        assert slope_in(sums, found, 2, *moving) == pytest.approx(0.01, abs=0.002)
    assert slope_in(sums, found, 2, 0, 0) == 0.0


def test_relative_sensitivities():
    # Truth: the third of five gyros answers by 3 % more, the others alike: over the middle one.
    sums = sums_of(0.03)
    everywhere = [np.ones(len(sums), dtype=bool)] * GYROS
    gain = relative_gain(sums, usual_variance(sums), [], sums.run, everywhere)
    np.testing.assert_allclose(gain, [1.0, 1.0, 1.03, 1.0, 1.0], atol=5e-4)

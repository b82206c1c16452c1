"""Allan deviation over losses, against the known truth of simulated noise and against the same noise without a loss."""

import itertools

import numpy as np
import pytest

from vgyro.engine import ENGINES
from vgyro.errors import TooShort
from vgyro.metrics import allan_deviation
from vgyro.metrics.outliers import find_outliers
from vgyro.metrics.sampling import Sampling

RATE_HZ = 200.0
SAMPLES = 120_000
WALK = 0.002


def noise(seed: int, walk: float = WALK) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(SAMPLES) + np.cumsum(walk * rng.standard_normal(SAMPLES))


def truth(m: np.ndarray, walk: float = WALK) -> np.ndarray:
    """White noise of 1 a sample and steps of `walk`: 1/m + walk²·m/3·(1 + 1/2m²)."""
    return np.sqrt(1 / m + walk**2 * m / 3 * (1 + 1 / (2 * m**2)))


def sampled(there: np.ndarray) -> Sampling:
    """Sampling of the slots that are there."""
    position = np.flatnonzero(there)
    return Sampling.of(RATE_HZ, np.cumsum(np.diff(position, prepend=position[0] - 1) != 1), position)


def single_losses(share: float, samples: int = SAMPLES) -> np.ndarray:
    return np.random.default_rng(100).random(samples) >= share


def bursts(share: float, shortest: int, longest: int) -> np.ndarray:
    rng, there = np.random.default_rng(101), np.ones(SAMPLES, dtype=bool)
    while there.mean() > 1 - share:
        start = rng.integers(SAMPLES)
        there[start : start + rng.integers(shortest, longest + 1)] = False
    return there


def test_without_a_loss_it_is_the_curve_of_the_segments():
    rate, segment = noise(1), np.repeat([0, 1], [50_000, SAMPLES - 50_000])
    position = np.arange(SAMPLES) + 1000 * segment
    ours = allan_deviation(rate, RATE_HZ, sampling=Sampling.of(RATE_HZ, segment, position))
    expected = allan_deviation(rate, RATE_HZ, segment=segment)
    for name in ("tau", "deviation", "low", "high", "edf", "exponent"):
        np.testing.assert_array_equal(getattr(ours, name), getattr(expected, name))


@pytest.mark.parametrize("walk", [0.0, WALK])
@pytest.mark.parametrize(
    "there",
    [single_losses(0.01), single_losses(0.05), bursts(0.05, 10, 10), bursts(0.02, 1, 80)],
    ids=["1 % single", "5 % single", "5 % in tens", "2 % up to 0.4 s"],
)
def test_short_losses(there: np.ndarray, walk: float):
    # Truth within five standard errors, and a curve that reaches as far as without losses.
    rate = noise(2, walk)
    curve = allan_deviation(rate[there], RATE_HZ, sampling=sampled(there))
    m = curve.tau * RATE_HZ
    assert np.all(np.abs(curve.deviation / truth(m, walk) - 1) < 5 / np.sqrt(2 * curve.edf))
    assert m[-1] > SAMPLES / 3 / 2 ** (2 / 3)
    np.testing.assert_array_equal(curve.exponent[m < 100], 0)
    assert (curve.exponent[-1] == -2) == (walk > 0)


def test_what_losses_add_to_white_noise_is_taken_off():
    # 5 % lost: the variance of means of the rest is 5.3 % larger. The same noise without losses is the truth, but for
    # the scatter by the lost samples, far below 1 % here.
    there = single_losses(0.05)
    taus = np.array([20, 50, 100, 200]) / RATE_HZ
    ratios = []
    for seed in range(5):
        rate = noise(seed, 0.0)
        lossy = allan_deviation(rate[there], RATE_HZ, taus, sampling=sampled(there)).deviation
        ratios.append((lossy / allan_deviation(rate, RATE_HZ, taus).deviation) ** 2)
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1, atol=0.01)


@pytest.mark.parametrize(("kind", "bound"), [("overlapping", 0.005), ("modified", 0.01), ("hadamard", 0.02)])
def test_nothing_is_taken_off_where_losses_add_nothing(kind: str, bound: float):
    # Random walk alone: a mean of 95 % of the samples is nearly that of all.
    there = single_losses(0.05)
    rate = np.cumsum(np.random.default_rng(3).standard_normal(SAMPLES))
    taus = np.array([100, 400, 1600]) / RATE_HZ
    lossy = allan_deviation(rate[there], RATE_HZ, taus, sampling=sampled(there), kind=kind).deviation
    np.testing.assert_allclose(lossy / allan_deviation(rate, RATE_HZ, taus, kind=kind).deviation, 1, atol=bound)


@pytest.mark.parametrize("kind", ["modified", "hadamard", "robust"])
def test_other_kinds_over_losses(kind: str):
    there, rate = single_losses(0.02), noise(4, 0.0)
    curve = allan_deviation(rate[there], RATE_HZ, sampling=sampled(there), kind=kind)
    m = curve.tau * RATE_HZ
    expected = np.sqrt((m**2 + 1) / (2 * m**3)) if kind == "modified" else m**-0.5
    assert np.all(np.abs(curve.deviation / expected - 1) < 5 / np.sqrt(2 * curve.edf))


def test_thirty_percent_in_bursts_ends_the_curve_early_but_right():
    # Bursts of 0.1 to 5 s: those longer than 0.5 s end a stretch.
    there = bursts(0.3, 20, 1000)
    curve = allan_deviation(noise(5)[there], RATE_HZ, sampling=sampled(there))
    m = curve.tau * RATE_HZ
    assert np.all(np.abs(curve.deviation / truth(m) - 1) < 5 / np.sqrt(2 * curve.edf))
    whole = allan_deviation(noise(5), RATE_HZ)
    shared = len(curve.tau)
    assert shared < len(whole.tau)
    assert np.all(curve.edf < whole.edf[:shared])


def test_thirty_percent_at_random_is_refused_but_for_the_shortest():
    there = single_losses(0.3)
    curve = allan_deviation(noise(6)[there], RATE_HZ, sampling=sampled(there))
    m = curve.tau * RATE_HZ
    # 2m samples in a row are there with 0.7^2m: 12 % at m = 3, 6 % at 4.
    assert m[-1] == 3
    assert np.all(np.abs(curve.deviation / truth(m) - 1) < 5 / np.sqrt(2 * curve.edf))


def test_every_second_sample_lost_is_refused():
    there = np.arange(SAMPLES) % 2 == 0
    with pytest.raises(TooShort, match="too few differences"):
        allan_deviation(noise(7)[there], RATE_HZ, sampling=sampled(there))


def test_no_long_loss_is_bridged():
    # A step of 100 across a loss of 1 s would show at every τ.
    there = np.ones(SAMPLES, dtype=bool)
    there[60_000:60_200] = False
    there[20_000] = False
    rate = noise(8, 0.0) + np.where(np.arange(SAMPLES) > 60_100, 100.0, 0.0)
    curve = allan_deviation(rate[there], RATE_HZ, sampling=sampled(there))
    assert np.all(np.abs(curve.deviation * np.sqrt(curve.tau * RATE_HZ) - 1) < 5 / np.sqrt(2 * curve.edf))
    assert curve.tau[-1] * RATE_HZ <= 20_000


@pytest.mark.parametrize("kind", ["overlapping", "modified", "hadamard", "robust"])
def test_engines_agree_over_losses(kind: str):
    there = (single_losses(0.02) & bursts(0.1, 1, 300))[:20_000]
    rate = noise(9)[:20_000][there]
    native, reference = (
        allan_deviation(rate, RATE_HZ, sampling=sampled(there), engine=name, kind=kind) for name in ENGINES
    )
    for name in ("tau", "deviation", "low", "high", "edf"):
        np.testing.assert_allclose(getattr(native, name), getattr(reference, name), rtol=1e-8)


def test_outliers_that_are_taken_out_do_no_harm():
    # 0.1 % of single samples 15 to 60 standard deviations off: without them the truth, with them 0.7 more variance.
    rng, rate = np.random.default_rng(10), noise(10)
    at = rng.choice(SAMPLES, SAMPLES // 1000, replace=False)
    rate[at] += rng.choice([-1, 1], at.size) * rng.uniform(15, 60, at.size)
    mask = find_outliers(rate, RATE_HZ)
    assert mask[at].all()
    sampling = Sampling.of(RATE_HZ, np.zeros(SAMPLES, int), np.arange(SAMPLES)).without(mask)
    curve = allan_deviation(rate[~mask], RATE_HZ, sampling=sampling)
    m = curve.tau * RATE_HZ
    assert np.all(np.abs(curve.deviation / truth(m) - 1) < 5 / np.sqrt(2 * curve.edf))
    assert allan_deviation(rate, RATE_HZ).deviation[0] > 1.2


def test_limits_cover_the_truth_over_losses():
    # 95 % of 400 series of white noise with 3 % lost, ± 3 binomial standard deviations; more is right, too: the degrees
    # of freedom are a lower bound.
    rng, inside = np.random.default_rng(11), 0
    for _ in range(400):
        there = rng.random(1000) >= 0.03
        curve = allan_deviation(rng.standard_normal(there.sum()), 1.0, np.array([20.0]), sampling=at_one_hz(there))
        inside += curve.low[0] <= 20**-0.5 <= curve.high[0]
    assert inside >= 0.95 * 400 - 13


def at_one_hz(there: np.ndarray) -> Sampling:
    position = np.flatnonzero(there)
    return Sampling.of(1.0, np.cumsum(np.diff(position, prepend=position[0] - 1) != 1), position, most_lost_s=5.0)


def test_exponents_over_losses_are_those_without():
    there = single_losses(0.03)
    for walk, seed in itertools.product((0.0, 0.01), (12, 13)):
        rate = noise(seed, walk)
        taus = np.array([1, 4, 16, 64, 256, 1024, 4096]) / RATE_HZ
        lossy = allan_deviation(rate[there], RATE_HZ, taus, sampling=sampled(there))
        np.testing.assert_array_equal(lossy.exponent, allan_deviation(rate, RATE_HZ, taus).exponent)


def test_what_cannot_be_meant():
    rate, sampling = noise(14)[:10], Sampling.of(RATE_HZ, np.zeros(9, int))
    with pytest.raises(ValueError, match="10 rates, but 9 samples"):
        allan_deviation(rate, RATE_HZ, sampling=sampling)
    with pytest.raises(ValueError, match="either"):
        allan_deviation(rate[:9], RATE_HZ, segment=np.zeros(9, int), sampling=sampling)

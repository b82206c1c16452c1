"""Allan covariance: the identity with sums and differences of series, known correlations, allantools."""

import allantools
import numpy as np
import pytest

from vgyro.engine import ENGINES
from vgyro.errors import TooShort
from vgyro.metrics import allan_deviation, cross_allan
from vgyro.metrics.allan.covariance import correlation_limits
from vgyro.metrics.sampling import Sampling


def gyros(seed: int, samples: int, white: float, walk: float) -> np.ndarray:
    """Three gyros; the correlation of the white noise and of the random walk of the first two. The third is apart."""
    rng = np.random.default_rng(seed)
    parts = []
    for share in (white, walk):
        own = rng.standard_normal((samples, 3))
        own[:, 1] = share * own[:, 0] + np.sqrt(1 - share**2) * own[:, 1]
        parts.append(own)
    return parts[0] + 0.05 * np.cumsum(parts[1], axis=0)


def test_covariance_is_a_quarter_of_the_variance_of_the_sum_less_that_of_the_difference():
    rate = gyros(1, 3000, 0.3, 0.8)
    found = cross_allan(rate, 10.0, taus=np.array([0.1, 0.5, 3.0, 12.0]))
    for i in range(3):
        for j in range(3):
            plus, minus = (
                allan_deviation(rate[:, i] + s * rate[:, j], 10.0, found.tau).deviation ** 2 for s in (1, -1)
            )
            np.testing.assert_allclose(found.covariance[:, i, j], (plus - minus) / 4, rtol=1e-9, atol=1e-12)
    _, single, _, _ = allantools.oadev(rate[:, 2], 10.0, "freq", taus=found.tau)
    np.testing.assert_allclose(found.covariance[:, 2, 2], single**2, rtol=1e-9)


def test_correlation_of_known_noise_at_short_and_at_long_times():
    # White noise correlated by 0.3 governs 1 s, random walk by 0.8 from 100 s on: within five standard errors of z.
    found = cross_allan(gyros(2, 40_000, 0.3, 0.8), 1.0, taus=np.array([1.0, 300.0, 1000.0]))
    for place, expected in ((0, 0.3), (1, 0.8), (2, 0.8)):
        z = np.arctanh(found.correlation[place, 0, 1]) - np.arctanh(expected)
        assert abs(z) < 5 / np.sqrt(found.edf[place, 0, 1] - 2)
        assert abs(np.arctanh(found.correlation[place, 0, 2])) < 5 / np.sqrt(found.edf[place, 0, 2] - 2)
    assert np.all(found.low[:, 0, 1] < found.correlation[:, 0, 1])
    assert np.all(found.high[:, 0, 1] > found.correlation[:, 0, 1])
    np.testing.assert_array_equal(found.correlation[:, range(3), range(3)], 1)
    np.testing.assert_array_equal(found.low[:, range(3), range(3)], 1)
    np.testing.assert_array_equal(found.correlation, found.correlation.transpose(0, 2, 1))


@pytest.mark.parametrize(("tau", "seconds"), [(5.0, 1000), (100.0, 1000)])
def test_limits_cover_the_truth(tau: float, seconds: int):
    # 95 % of 300 pairs of white series correlated by 0.5, ± 3 binomial standard deviations.
    rng, inside = np.random.default_rng(3), 0
    for _ in range(300):
        pair = rng.standard_normal((seconds, 2))
        pair[:, 1] = 0.5 * pair[:, 0] + np.sqrt(0.75) * pair[:, 1]
        found = cross_allan(pair, 1.0, taus=np.array([tau]))
        inside += found.low[0, 0, 1] <= 0.5 <= found.high[0, 0, 1]
    assert inside >= 0.95 * 300 - 11


def test_fisher_limits():
    # Fisher (1921): z = atanh(0.6) = 0.693147, ± 1.959964/√(102 - 2): by hand.
    low, high = correlation_limits(np.array([0.6, 0.6, 1.0]), np.array([102.0, 1.5, 102.0]), 0.95)
    np.testing.assert_allclose(low, [np.tanh(0.4971507), -1, 1], rtol=1e-6)
    np.testing.assert_allclose(high, [np.tanh(0.8891436), 1, 1], rtol=1e-6)


def test_losses_and_stretches():
    rate = gyros(4, 5000, 0.4, 0.4)
    there = np.random.default_rng(5).random(5000) > 0.02
    position = np.flatnonzero(there)
    sampling = Sampling.of(1.0, np.cumsum(np.diff(position, prepend=-1) != 1), position, most_lost_s=5.0)
    taus = np.array([1.0, 20.0, 200.0])
    lossy, whole = cross_allan(rate[there], 1.0, sampling, taus=taus), cross_allan(rate, 1.0, taus=taus)
    np.testing.assert_allclose(lossy.correlation, whole.correlation, atol=0.05)
    # Steps between two stretches do not count.
    segment = np.repeat([0, 1], [2000, 3000])
    stepped = cross_allan(rate + 100 * segment[:, None], 1.0, Sampling.of(1.0, segment), taus=taus)
    np.testing.assert_allclose(
        stepped.covariance,
        cross_allan(rate, 1.0, Sampling.of(1.0, segment), taus=taus).covariance,
        rtol=1e-6,
        atol=1e-9,
    )


def test_engines_agree():
    rate = gyros(6, 2000, 0.4, 0.4)
    one, two = (cross_allan(rate, 1.0, engine=name) for name in ENGINES)
    for name in ("tau", "covariance", "correlation", "low", "high", "edf"):
        np.testing.assert_allclose(getattr(one, name), getattr(two, name), rtol=1e-8)


def test_a_constant_gyro_and_too_few_samples():
    rate = gyros(7, 300, 0.0, 0.0)
    rate[:, 1] = 2.0
    found = cross_allan(rate, 1.0)
    assert not found.covariance[:, 1].any()
    assert np.isnan(found.correlation[:, 1]).all()
    assert np.isfinite(found.correlation[:, 0, 2]).all()
    with pytest.raises(TooShort):
        cross_allan(rate[:2], 1.0)

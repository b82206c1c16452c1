"""N against correlation: linear algebra of the whole array, counting, and limits."""

import math

import numpy as np
import pytest

from vgyro import more_gyros
from vgyro.errors import DataError
from vgyro.fusion import ArrayNoise, FilterParameters, design
from vgyro.more_gyros import MeanCorrelation, analyse, factor, gyros_for, limit, little_from, most_alike

ARW = 0.1


def alike(gyros, rho):
    return (1 - rho) * np.eye(gyros) + rho


@pytest.mark.parametrize("rho", [-0.19, -0.01, 0.0, 0.02, 0.3, 0.999])
@pytest.mark.parametrize("gyros", [1, 2, 6])
def test_factor_of_alike_gyros(gyros, rho):
    # Expected: 1'R⁻¹1 of the array's own matrix, over that of one gyro.
    expected = math.sqrt(np.linalg.solve(alike(gyros, rho), np.ones(gyros)).sum())
    assert factor(gyros, rho) == pytest.approx(expected, rel=1e-9)


def test_printed_sentence():
    # Expected: 6 gyros with ρ = 0.02 give √(6/1.1) = 2.34, 12 give √(12/1.22) = 3.14; 1/√0.02 = 7.07 is never passed.
    assert factor(6, 0.02) == pytest.approx(2.335, abs=5e-4)
    assert factor(12, 0.02) == pytest.approx(3.136, abs=5e-4)
    assert factor(10**6, 0.02) == pytest.approx(limit(0.02), rel=1e-4)
    assert limit(0.02) == pytest.approx(7.071, abs=5e-4)
    assert limit(0.0) == limit(-0.1) == math.inf


@pytest.mark.parametrize("gyros", [2, 3, 4, 6, 7, 50])
def test_most_negative_correlation(gyros):
    # Expected: the smallest eigenvalue of the matrix, 1 + (N-1)ρ, positive up to the bound -1/(N-1) and not at it.
    bound = -1 / (gyros - 1)
    assert most_alike(bound * 0.999) == gyros
    assert most_alike(bound * 1.001) == gyros - 1
    assert np.linalg.eigvalsh(alike(gyros, bound * 0.999)).min() > 0
    with pytest.raises(DataError, match="cannot all have"):
        factor(gyros, bound * 1.001)
    assert factor(gyros, bound * 0.999) > 20
    assert most_alike(0.0) == math.inf
    assert most_alike(-0.5) == 2


@pytest.mark.parametrize("rho", [-0.05, 0.0, 0.01, 0.1])
@pytest.mark.parametrize("wanted", [1.0, 1.5, 2.0, 3.0, 3.3])
def test_gyros_for_a_factor_by_counting(wanted, rho):
    most = int(min(most_alike(rho), 5000))
    enough = [gyros for gyros in range(1, most + 1) if factor(gyros, rho) >= wanted * (1 - 1e-12)]
    assert gyros_for(wanted, rho) == (enough[0] if enough else None)


def test_a_factor_out_of_reach():
    # Expected: the limit at ρ = 0.1 is √10 = 3.16; with ρ = -0.3 at most 4 gyros go together, with √(4/0.1) = 6.3.
    assert gyros_for(3.2, 0.1) is None
    assert gyros_for(6.3, -0.3) == 4
    assert gyros_for(6.4, -0.3) is None
    assert gyros_for(2.0, 0.0) == 4


@pytest.mark.parametrize("rho", [0.0, 0.02, 0.3])
def test_little_by_counting(rho):
    gains = [factor(n + 1, rho) / factor(n, rho) - 1 for n in range(1, 400)]
    found = little_from(rho)
    assert all(gain >= 0.01 for gain in gains[: found - 1])
    assert all(gain < 0.01 for gain in gains[found - 1 :])
    assert little_from(0.0) == 50
    assert little_from(-0.01) is None


def test_mean_of_independent_pairs():
    # Expected: estimates of gyros without correlation do not depend on each other: half-widths in squares, over 3.
    value, off = np.eye(3), 1 - np.eye(3)
    found = MeanCorrelation.of(value, value - 0.03 * off, value + 0.06 * off)
    assert (found.value, found.low, found.high) == pytest.approx((0.0, -0.03 / 3**0.5, 0.06 / 3**0.5))


def test_pairs_that_are_not_known():
    value = np.array([[1, np.nan, 0.2], [np.nan, np.nan, np.nan], [0.2, np.nan, 1]])
    found = MeanCorrelation.of(value, value - 0.03, value + 0.06)
    assert (found.value, found.low, found.high) == pytest.approx((0.2, 0.17, 0.26))
    assert not MeanCorrelation.of(np.eye(1), np.eye(1), np.eye(1)).known


def test_dependence_of_two_estimates():
    # Expected: simulated: correlation of the estimates of all pairs of four gyros, 20000 arrays of 200 samples: ±0.03.
    true = np.array([[1, 0.6, 0.3, 0], [0.6, 1, 0.4, -0.3], [0.3, 0.4, 1, 0.2], [0, -0.3, 0.2, 1]])
    pairs = np.triu_indices(4, 1)
    samples = np.linalg.cholesky(true) @ np.random.default_rng(3).standard_normal((20_000, 4, 200))
    samples -= samples.mean(axis=2, keepdims=True)
    moments = samples @ samples.transpose(0, 2, 1)
    size = np.sqrt(np.diagonal(moments, axis1=1, axis2=2))
    estimates = (moments / (size[:, :, None] * size[:, None, :]))[:, *pairs]
    np.testing.assert_allclose(more_gyros.dependence(true, pairs), np.corrcoef(estimates.T), atol=0.03)


@pytest.mark.parametrize("rho", [0.0, 0.1, 0.5])
def test_limits_of_the_mean_hold_the_truth(rho):
    # Expected: simulated white gyros; limits of each pair by Fisher's z at 95 %. 800 arrays: 95 ± 2.5 % (3.3 σ).
    rng, inside = np.random.default_rng(8), 0
    lower, half = np.linalg.cholesky(alike(5, rho)), 1.959964 / math.sqrt(497)
    for _ in range(800):
        found = np.corrcoef(lower @ rng.standard_normal((5, 500)))
        with np.errstate(divide="ignore"):
            z = np.arctanh(found)
        mean = MeanCorrelation.of(found, np.tanh(z - half), np.tanh(z + half))
        inside += mean.low <= rho <= mean.high
    assert inside / 800 == pytest.approx(0.95, abs=0.025)


def noise(arw, rho=0.02):
    arw = np.asarray(arw, dtype=float)
    return ArrayNoise(arw, np.full(len(arw), 1e-3), alike(len(arw), rho))


def rows(found, rho):
    chosen = found.columns["correlation"] == rho
    return {name: column[chosen] for name, column in found.columns.items()}


def test_analysis_of_an_array_of_alike_gyros():
    found = analyse(noise(np.full(6, ARW)), MeanCorrelation(0.02, 0.015, 0.025), FilterParameters(), 48)
    measured = rows(found, 0.02)
    assert measured["measured"].all()
    assert measured["gyros"].tolist() == list(range(1, 49))
    # Expected: of alike gyros the present array lies on the curve; eq. 20 of the whole matrix gives √P∞.
    assert measured["over_present"][5] == pytest.approx(1.0)
    assert measured["over_present"][11] == pytest.approx(factor(12, 0.02) / factor(6, 0.02))
    D = design.information(ARW**2 * alike(6, 0.02))
    assert measured["arw"][5] == pytest.approx(1 / math.sqrt(D))
    assert measured["sd"][5] == pytest.approx(math.sqrt(design.steady_variance(D, design.q_for_bandwidth(D, 1.0))))
    assert set(np.unique(found.columns["correlation"])) == {0.0, 0.015, 0.02, 0.025, 0.1, 0.3, 0.5}
    assert np.isnan(rows(found, 0.3)["over_present"]).all()
    assert found.summary["factor"] == pytest.approx([factor(6, 0.02), factor(6, 0.025), factor(6, 0.015)])
    assert found.summary["twice"][0] == pytest.approx(3.136, abs=5e-4)
    assert found.summary["present_factor"] == pytest.approx(factor(6, 0.02))
    assert found.summary["wanted"][0] == [2.0, *(gyros_for(2.0, rho) for rho in (0.02, 0.015, 0.025))]


def test_a_given_q():
    # Expected: eq. 21 at one q for every N: √P∞ falls with the fourth root.
    found = rows(analyse(noise([ARW, ARW]), MeanCorrelation(0.0, 0, 0), FilterParameters(q=0.0772), 16), 0.0)
    assert found["sd"][0] == pytest.approx((0.0772 * ARW**2) ** 0.25)
    assert found["sd"][0] / found["sd"][15] == pytest.approx(2.0)


def test_unequal_gyros():
    # Expected: the present value from the array's own R: ARW 0.05, 0.1 → D = 400 + 100; the mean variance 0.00625.
    found = analyse(noise([0.05, 0.1], 0.0), MeanCorrelation(0.0, -0.1, 0.1), FilterParameters(), 4)
    assert found.summary["present_factor"] == pytest.approx(math.sqrt(0.00625 * 500))
    measured = rows(found, 0.0)
    assert measured["arw"][1] == pytest.approx(math.sqrt(0.00625 / 2))
    assert measured["over_present"][1] == pytest.approx(math.sqrt(2 / 0.00625) / math.sqrt(500))
    # The lower limit, -0.1, allows all four; -0.5 would allow two.
    assert rows(found, -0.1)["gyros"].tolist() == [1, 2, 3, 4]
    less = analyse(noise([0.05, 0.1], -0.5), MeanCorrelation(-0.5, -0.6, -0.4), FilterParameters(), 9)
    assert rows(less, -0.5)["gyros"].tolist() == [1, 2]
    assert less.summary["twice"] == [None, None, None]


def test_what_is_not_known():
    unknown = MeanCorrelation(math.nan, math.nan, math.nan)
    found = analyse(noise([np.nan, 0.1]), unknown, FilterParameters(), 4)
    assert found.summary["correlation"] is None
    assert found.summary["present_factor"] is None
    assert not found.columns["measured"].any()
    assert np.isnan(found.columns["arw"]).all()
    assert np.isnan(found.columns["sd"]).all()
    assert (found.columns["factor"] >= 1).all()
    assert more_gyros.ASSUMED[0] == 0.0

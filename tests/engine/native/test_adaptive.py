"""The extended Kalman filter of scale errors, and the bank: against filterpy, a dense posterior, scipy's densities."""

from functools import partial

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter, MMAEFilterBank
from scipy.stats import multivariate_normal

from vgyro import engine
from vgyro.engine.native import adaptive, kalman
from vgyro.errors import EngineError

PERIOD = 0.005
DRIVE = 400.0 * np.array([[PERIOD**3 / 3, PERIOD**2 / 2], [PERIOD**2 / 2, PERIOD]])


def turned(samples=300, gyros=6, seed=1):
    """Rates of gyros with biases, scale errors and correlated noise that turn to and fro, and a filter's start.

    Returns rate [T, N], noise [N, N], walk [N], state, covariance.
    """
    rng = np.random.default_rng(seed)
    root = 0.3 * rng.standard_normal((gyros, gyros + 2))
    noise = root @ root.T + 0.05 * np.eye(gyros)
    motion = 30.0 * np.sin(6.0 * PERIOD * np.arange(samples))
    rate = motion[:, None] * (1 + 0.02 * rng.standard_normal(gyros)) + rng.standard_normal(gyros)
    rate += rng.standard_normal((samples, gyros)) @ np.linalg.cholesky(noise).T
    state = np.r_[rate[0].mean(), np.zeros(1 + 2 * gyros)]
    covariance = np.diag(np.r_[1e4, 1e6, np.full(gyros, 1e3), np.full(gyros, 4e-4)])
    return rate, noise, 1e-4 * rng.uniform(0.0, 2.0, gyros), state, covariance


def run(which, rate, noise, walk, state, covariance):
    return engine.get(which).adaptive.scale_bias_filter(rate, PERIOD, noise, DRIVE, walk, state, covariance)


@pytest.mark.parametrize("gyros", [2, 3, 4, 5, 6, 9])
@pytest.mark.parametrize("samples", [1, 300])
def test_ekf_against_filterpy(samples, gyros):
    # Expected: filterpy's ExtendedKalmanFilter with all 2 + 2N states, start and Q projected onto Σb = Σs = 0.
    arguments = turned(samples, gyros)
    for ours, theirs in zip(run("native", *arguments), run("reference", *arguments), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-8)


def test_the_sums_stay_zero():
    # Expected: zero, to rounding, for ever; and known with certainty. 60000 samples, two pieces, then on from there.
    rate, noise, walk, state, covariance = turned(60_000)
    state[2:] = 1.0
    for _ in range(2):
        estimate, state, covariance = run("native", rate, noise, walk, state, covariance)
        for part in (slice(2, 8), slice(8, 14)):
            assert abs(state[part].sum()) < 1e-12
            np.testing.assert_allclose(covariance[:, part].sum(axis=1), 0.0, atol=1e-12)
        np.testing.assert_array_equal(covariance, covariance.T)
        assert np.linalg.eigvalsh(covariance)[2:].min() > 0
        assert estimate[-1] == state[0]


def test_without_scale_errors_it_is_the_gaussian_posterior():
    # Expected: the mean and variance of w at the last sample given all samples, by conditioning the joint Gaussian
    # distribution of states and samples, for records of several lengths.
    gyros, states = 4, 6
    rate, noise, walk, start, covariance = turned(24, gyros)
    covariance[2 + gyros :, 2 + gyros :] = 0.0
    one = np.eye(gyros) - 1 / gyros
    kept = np.eye(states)
    kept[2:, 2:] = one
    H = np.hstack([np.ones((gyros, 1)), np.zeros((gyros, 1)), np.eye(gyros)])
    F = np.eye(states)
    F[0, 1] = PERIOD
    Q = np.zeros((states, states))
    Q[:2, :2], Q[2:, 2:] = DRIVE, one @ np.diag(walk) @ one
    for samples in (1, 2, 7, 24):
        # Each state is the start and the steps so far, carried on by F.
        carried = [np.linalg.matrix_power(F, k) for k in range(samples + 1)]
        P = np.block([
            [
                carried[i + 1] @ kept @ covariance[:states, :states] @ kept @ carried[j + 1].T
                + sum(carried[i - k] @ Q @ carried[j - k].T for k in range(min(i, j) + 1))
                for j in range(samples)
            ]
            for i in range(samples)
        ])  # fmt: skip
        mean = np.concatenate([carried[i + 1] @ start[:states] for i in range(samples)])
        seen = np.kron(np.eye(samples), H)
        gain = np.linalg.solve(seen @ P @ seen.T + np.kron(np.eye(samples), noise), seen @ P).T
        expected = mean + gain @ (rate[:samples].ravel() - seen @ mean)
        spread = P - gain @ seen @ P
        estimate, state, left = run("native", rate[:samples], noise, walk, start, covariance)
        np.testing.assert_allclose(state[:states], expected[-states:], rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(left[:states, :states], spread[-states:, -states:], rtol=1e-7, atol=1e-7)
        assert estimate[-1] == state[0]


def bank(samples=200, gyros=6, noises=3, seed=2):
    """Rates, covariances [J, N, N], process noises [K], start, variance, equal probabilities."""
    rng = np.random.default_rng(seed)
    root = 0.5 * rng.standard_normal((noises, gyros, gyros + 4))
    noise = root @ root.transpose(0, 2, 1) + 0.3 * np.eye(gyros)
    process = np.geomspace(1e-4, 1.0, 3)
    rate = 100.0 + np.cumsum(0.1 * rng.standard_normal(samples))[:, None] + rng.standard_normal((samples, gyros))
    return rate, noise, process, rate[0].mean(), 1e3, np.full((noises, 3), 1 / (3 * noises))


@pytest.mark.parametrize("gyros", [2, 3, 4, 5, 6, 9])
@pytest.mark.parametrize("noises", [1, 3, 5])
def test_bank_against_densities_of_the_innovations(gyros, noises):
    # Expected: p ∝ p·N(e; 0, S) with scipy's density of the N-dimensional innovation, and scalar filters written out.
    rate, noise, process, start, variance, p = bank(gyros=gyros, noises=noises)
    found = adaptive.filter_bank(rate, noise, process, start, variance, p, 1e-4)
    pairs = [(R, q) for R in noise for q in process]
    x, P, p, total = np.full(len(pairs), start), np.full(len(pairs), variance), p.ravel(), 0.0
    one, expected = np.ones(gyros), []
    for y in rate:
        P = P + np.tile(process, noises)
        S = [before * np.outer(one, one) + R for (R, _), before in zip(pairs, P, strict=True)]
        density = [multivariate_normal.logpdf(y - mean, cov=cov) for mean, cov in zip(x, S, strict=True)]
        K = np.array([before * np.linalg.solve(cov, one) for before, cov in zip(P, S, strict=True)])
        x, P = x + np.einsum("mn,mn->m", K, y - x[:, None]), (1 - K.sum(axis=1)) * P
        p = p * np.exp(density - np.max(density))
        p = np.maximum(p / p.sum(), 1e-4)
        p = p / p.sum()
        total = total + p
        expected.append(p @ x)
    np.testing.assert_allclose(found[0], expected, rtol=1e-8)
    np.testing.assert_allclose(found[1], p.reshape(noises, 3), rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(found[2], (total / 200).reshape(noises, 3), rtol=1e-8, atol=1e-12)


def test_without_a_floor_it_is_filterpys_bank():
    # Expected: filterpy's MMAEFilterBank, 60 samples; later a probability falls below its smallest number.
    rate, noise, process, start, variance, p = bank(60)
    filters = []
    for R in noise:
        for q in process:
            one = KalmanFilter(dim_x=1, dim_z=6)
            one.x[:], one.P[:], one.Q[:], one.R, one.H = start, variance, q, R, np.ones((6, 1))
            filters.append(one)
    mixed, expected = MMAEFilterBank(filters, p.flatten(), 1, H=np.ones((6, 1))), []
    for y in rate:
        mixed.predict()
        mixed.update(y[:, None])
        expected.append(mixed.x[0, 0])
    estimate, last, _ = adaptive.filter_bank(rate, noise, process, start, variance, p, 0.0)
    np.testing.assert_allclose(estimate, expected, rtol=1e-8)
    np.testing.assert_allclose(last.ravel(), mixed.p, rtol=1e-8, atol=1e-12)


def test_bank_of_one_is_that_kalman_filter():
    rate, noise, process, start, variance, _ = bank()
    estimate, last, mean = adaptive.filter_bank(rate, noise[1:2], process[2:], start, variance, np.ones((1, 1)), 1e-4)
    expected, _ = kalman.kalman_filter(rate, 1.0, process[2], noise[1], start, variance)
    np.testing.assert_allclose(estimate, expected, rtol=1e-12)
    assert (last, mean) == (1.0, 1.0)


def test_engines_agree_on_the_bank():
    arguments = bank()
    found = (engine.get(which).adaptive.filter_bank(*arguments, 1e-4) for which in ("native", "reference"))
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-12)


def test_no_probability_falls_below_the_floor():
    # Noise far from every member: the likelihoods are as far apart as they can be, and beyond what e^-700 tells apart.
    rate, noise, process, start, variance, p = bank(1)
    rate = rate + 1e3 * np.arange(6)
    _, last, _ = adaptive.filter_bank(rate, noise, process, start, variance, p, 1e-4)
    assert last.min() >= 1e-4 / (1 + 8e-4) * (1 - 1e-12)
    assert last.sum() == pytest.approx(1.0, abs=1e-15)


def both(rate):
    """Both filters over rates of six gyros."""
    _, noise, walk, state, covariance = turned()
    _, several, process, start, variance, p = bank()
    return [
        run("native", rate, noise, walk, state, covariance),
        adaptive.filter_bank(rate, several, process, start, variance, p, 1e-4),
    ]


def test_pieces_single_precision_and_column_order_change_nothing(monkeypatch):
    rate = turned()[0].astype(np.float32)
    whole = both(rate.astype(float))
    monkeypatch.setattr(adaptive, "PIECE", 7)
    for ours, theirs in zip(both(np.asfortranarray(rate)), whole, strict=True):
        for a, b in zip(ours[:2], theirs[:2], strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("which", ["native", "reference"])
@pytest.mark.parametrize("sample", [0, 7, 199])
def test_what_cannot_be_used_is_named(which, sample):
    module = engine.get(which).adaptive
    rate, noise, walk, state, covariance = turned(200)
    _, several, process, start, variance, p = bank()
    ekf = partial(module.scale_bias_filter, period=PERIOD, drive=DRIVE, walk=walk, state=state, covariance=covariance)
    mix = partial(module.filter_bank, process=process, start=start, variance=variance, probability=p, least=1e-4)
    lost = rate.copy()
    lost[sample, 4] = np.nan
    for call, R in ((ekf, noise), (mix, several)):
        with pytest.raises(EngineError, match=f"sample {sample}: the rate is not finite"):
            call(lost, noise=R)
        for spoilt in (-R, np.full_like(R, np.nan)):
            with pytest.raises(EngineError, match="not positive definite"):
                call(rate, noise=spoilt)


def test_no_samples():
    assert [len(found[0]) for found in both(np.empty((0, 6)))] == [0, 0]

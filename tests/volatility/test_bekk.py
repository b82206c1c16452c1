"""BEKK(1,1): against a naive likelihood, against arch for one gyro, and simulated with known parameters."""

import math

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from vgyro.engine.reference import garch as arch_garch
from vgyro.volatility.bekk import bekk_covariance, bekk_log_likelihood, fit_bekk

SCALAR = (np.full(3, math.sqrt(0.06)), np.full(3, math.sqrt(0.9)))
DIAGONAL = (np.sqrt([0.05, 0.1, 0.2]), np.sqrt([0.9, 0.8, 0.6]))


def constant_of(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Ω of a model whose variances are 0.04, 0.05, … (deg/s)² and whose correlation is about 0.3."""
    size = np.sqrt((1 - a**2 - b**2) * (0.04 + 0.01 * np.arange(len(a))))
    return np.outer(size, size) * (0.7 * np.eye(len(a)) + 0.3)


def simulate(samples: int, a: np.ndarray, b: np.ndarray, seed: int) -> np.ndarray:
    """r [T, N] by the definition, after 500 samples that are left out."""
    rng, constant = np.random.default_rng(seed), constant_of(a, b)
    H = constant / np.outer(np.sqrt(1 - a**2 - b**2), np.sqrt(1 - a**2 - b**2))
    r = np.empty((samples + 500, len(a)))
    for row in r:
        row[:] = np.linalg.cholesky(H) @ rng.standard_normal(len(a))
        H = constant + np.diag(a) @ np.outer(row, row) @ np.diag(a) + np.diag(b) @ H @ np.diag(b)
    return r[500:]


def naive(r: np.ndarray, constant: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, float]:
    """H_t and the log-likelihood, sample by sample, with matrix products and SciPy's density."""
    A, B, S = np.diag(a), np.diag(b), r.T @ r / len(r)
    H, total, path = constant + A @ S @ A + B @ S @ B, 0.0, []
    for row in r:
        total += multivariate_normal.logpdf(row, np.zeros(len(a)), H)
        path.append(H)
        H = constant + A @ np.outer(row, row) @ A + B @ H @ B
    return np.array(path), total


@pytest.mark.parametrize(("a", "b"), [SCALAR, DIAGONAL, (np.array([0.3, -0.2, 0.1]), np.array([0.5, 0.9, -0.4]))])
def test_path_and_likelihood_against_a_loop(a, b):
    r, constant = simulate(120, *SCALAR, seed=1), constant_of(a, b)
    path, total = naive(r, constant, a, b)
    found = bekk_covariance(r, constant, a, b)
    np.testing.assert_allclose(found, path, rtol=1e-12)
    assert bekk_log_likelihood(r, found) == pytest.approx(total, abs=1e-9)
    # The state carried on from the middle: the same path.
    np.testing.assert_allclose(bekk_covariance(r[60:], constant, a, b, path[60]), path[60:], rtol=1e-12)


@pytest.mark.parametrize(("omega", "alpha", "beta"), [(0.05, 0.1, 0.85), (0.2, 0.2, 0.6)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_one_gyro_is_garch(omega, alpha, beta, seed):
    # arch, told the same start of the recursion; α = a², β = b².
    rng, h = np.random.default_rng(seed), 1.0
    e = np.empty((460, 1))
    for t in range(len(e)):
        e[t] = math.sqrt(h) * rng.standard_normal()
        h = omega + alpha * e[t, 0] ** 2 + beta * h
    e = e[100:]
    theirs, ours = arch_garch.fit_garch(e), fit_bekk(e)
    assert ours.log_likelihood == pytest.approx(theirs.log_likelihood[0], abs=1e-4)
    assert ours.a[0] ** 2 == pytest.approx(theirs.alpha[0], abs=2e-3)
    assert ours.b[0] ** 2 == pytest.approx(theirs.beta[0], abs=4e-3)
    assert ours.parameters == 3
    assert fit_bekk(e, "diagonal").log_likelihood == pytest.approx(ours.log_likelihood, abs=1e-4)


@pytest.mark.parametrize(("kind", "truth"), [("scalar", SCALAR), ("diagonal", DIAGONAL)])
def test_known_parameters_are_recovered(kind, truth):
    # Known truth. Wilks: twice the gain of the fit over the truth is chi² of as many degrees as parameters.
    r = simulate(4000, *truth, seed=5)
    fit = fit_bekk(r, kind)
    assert fit.status == "converged"
    _, at_truth = naive(r, constant_of(*truth), *truth)
    _, at_fit = naive(r, fit.constant, fit.a, fit.b)
    assert fit.log_likelihood == pytest.approx(at_fit, abs=1e-6)
    assert 0 <= 2 * (at_fit - at_truth) < chi2.ppf(0.999, fit.parameters)
    # Standard errors of α and β at T = 4000 are near 0.01 and 0.02 (Bollerslev 1986).
    np.testing.assert_allclose(fit.a**2, truth[0] ** 2, atol=0.05)
    np.testing.assert_allclose(fit.b**2, truth[1] ** 2, atol=0.1)
    assert fit.parameters == {"scalar": 8, "diagonal": 12}[kind]
    assert not fit.targeted


@pytest.mark.parametrize("kind", ["scalar", "diagonal"])
def test_nothing_near_the_optimum_is_better(kind):
    # Each parameter moved either way, the naive likelihood: it only falls, but for rounding and the end of the search.
    r = simulate(360, *DIAGONAL, seed=6)
    fit = fit_bekk(r, kind)
    assert fit.status == "converged"
    lower = np.linalg.cholesky(fit.constant)
    for step in (-3e-3, 3e-3):
        moved = [(fit.constant, fit.a * (1 + step), fit.b), (fit.constant, fit.a, fit.b * (1 + step / 10))]
        for place in zip(*np.tril_indices(3), strict=True):
            other = lower.copy()
            other[place] += step * lower[place[0], place[0]]
            moved.append((other @ other.T, fit.a, fit.b))
        if kind == "diagonal":
            for gyro in range(3):
                one = np.eye(3)[gyro]
                moved += [(fit.constant, fit.a * (1 + step * one), fit.b)]
                moved += [(fit.constant, fit.a, fit.b * (1 + step / 10 * one))]
        for parameters in moved:
            assert naive(r, *parameters)[1] <= fit.log_likelihood + 1e-4


def test_kinds_are_nested_and_targeting_costs_likelihood():
    r = simulate(360, *DIAGONAL, seed=7)
    scalar, targeted = fit_bekk(r), fit_bekk(r, constant="targeting")
    diagonal = fit_bekk(r, "diagonal", scalar=scalar)
    assert targeted.log_likelihood <= scalar.log_likelihood <= diagonal.log_likelihood
    assert diagonal.log_likelihood == pytest.approx(fit_bekk(r, "diagonal").log_likelihood, abs=1e-6)
    assert targeted.targeted
    # Covariance targeting (Engle & Kroner 1995): Ω = (1 - a² - b²)·S.
    S = r.T @ r / len(r)
    np.testing.assert_allclose(targeted.constant, (1 - targeted.a[0] ** 2 - targeted.b[0] ** 2) * S, rtol=1e-9)
    half = fit_bekk(r, "diagonal", constant="targeting")
    np.testing.assert_allclose(np.diag(half.constant), (1 - half.a**2 - half.b**2) * np.diag(S), rtol=1e-9)


def test_units_do_not_matter():
    # r in other units, another for each gyro: the same a and b, the likelihood moved by T·Σ log of the units.
    r, units = simulate(360, *SCALAR, seed=8), np.array([1e3, 1e-3, 7.0])
    one, other = fit_bekk(r, "diagonal"), fit_bekk(r * units, "diagonal")
    np.testing.assert_allclose(other.a, one.a, rtol=1e-3)
    assert other.log_likelihood == pytest.approx(one.log_likelihood - len(r) * np.log(units).sum(), abs=1e-4)
    np.testing.assert_allclose(other.covariance, one.covariance * np.outer(units, units), rtol=1e-2)


def test_constant_covariance_gives_no_more_than_that():
    # Covariance targeting of white noise: where a gains nothing, Ω = S and the likelihood is that of S.
    r = np.random.default_rng(9).standard_normal((360, 3))
    fit = fit_bekk(r, constant="targeting")
    S = r.T @ r / len(r)
    level = multivariate_normal.logpdf(r, np.zeros(3), S).sum()
    assert level - 1e-9 <= fit.log_likelihood < level + 10
    calm = np.tile([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]], (50, 1))
    still = fit_bekk(calm, constant="targeting")
    assert still.status == "boundary: a = 0"
    assert not still.a.any()
    np.testing.assert_allclose(still.covariance, np.tile(np.eye(2), (200, 1, 1)), atol=1e-12)


def test_what_cannot_be_fitted_has_a_status():
    r = np.random.default_rng(10).standard_normal((100, 2))
    unknown = np.where(np.arange(100)[:, None] == 7, np.nan, r)
    cases = {
        "too short": r[:15],
        "no variance": r * [1.0, 0.0] + [0.0, 3.0],
        "failed": unknown,
        "not positive definite": np.column_stack([r, r.sum(axis=1)]),
    }
    for status, series in cases.items():
        fit = fit_bekk(series)
        assert fit.status == status
        assert math.isnan(fit.log_likelihood)
        assert fit.covariance.shape == (len(series), series.shape[1], series.shape[1])
    spiked = r.copy()
    spiked[50, 0] = 300.0
    assert fit_bekk(spiked).status == "outlier-dominated"
    with pytest.raises(TypeError, match=r"expected \[T, N\]"):
        fit_bekk(r[:, 0])

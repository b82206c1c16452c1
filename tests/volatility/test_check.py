"""The plain second route of the cross-check, against the fits that it is to check and against known truth."""

import numpy as np
import pytest
from scipy.optimize import minimize

from vgyro.engine.covariance import conditional_covariance
from vgyro.engine.models import DccModel
from vgyro.volatility import fit_garch
from vgyro.volatility.check import covariance_after, greatest_log_likelihood


def garch_series(samples, alpha, beta, seed):
    rng = np.random.default_rng(seed)
    e, h = np.empty(samples), 1.0
    for t in range(samples):
        e[t] = np.sqrt(h) * rng.standard_normal()
        h = (1 - alpha - beta) + alpha * e[t] ** 2 + beta * h
    return 0.03 * e


@pytest.mark.parametrize(("alpha", "beta"), [(0.05, 0.9), (0.3, 0.3), (0.0, 0.0)])
def test_the_grid_is_never_worse_than_the_library(alpha, beta):
    # Expected: no likelihood above the one found here, and the fit's equal to it, at α = 0 too, but for a second
    # optimum that is all but as good.
    series = np.column_stack([garch_series(360, alpha, beta, seed) for seed in range(4)])
    fit = fit_garch(series)
    ours = np.array([greatest_log_likelihood(column) for column in series.T])
    assert (fit.log_likelihood <= ours + 360 * 1e-6).all()
    assert np.sum(fit.log_likelihood < ours - 360 * 1e-6) <= 1
    assert (fit.log_likelihood >= ours - 0.1).all()


def test_constant_variance_likelihood():
    # Expected: the likelihood is at least that of a constant variance, -½T(log 2π·mean(e²) + 1), a closed form.
    e = garch_series(300, 0.0, 0.0, 3)
    constant = -0.5 * 300 * (np.log(2 * np.pi * np.mean(e**2)) + 1)
    found = greatest_log_likelihood(e)
    assert constant - 1e-9 <= found < constant + 10


def test_against_a_gradient_free_search():
    # Expected: scipy's Nelder-Mead on the likelihood written for one series.
    e = garch_series(500, 0.1, 0.8, 8)

    def cost(point):
        omega, alpha, beta = point
        if omega <= 0 or alpha < 0 or beta < 0 or alpha + beta >= 1:
            return 1e9
        h, total = omega + (alpha + beta) * np.mean(e**2), 0.0
        for value in e:
            total += 0.5 * (np.log(2 * np.pi * h) + value**2 / h)
            h = omega + alpha * value**2 + beta * h
        return total

    start = [0.1 * np.mean(e**2), 0.1, 0.8]
    found = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-9, "maxiter": 2000})
    assert greatest_log_likelihood(e) == pytest.approx(-found.fun, abs=1e-4)


def test_covariance_of_the_window_and_after_it():
    # Expected: the package's own path (filters instead of loops), for the last sample and the one carried forward to.
    rng = np.random.default_rng(5)
    r = 0.05 * rng.standard_normal((121, 3))
    target = np.array([[1.0, 0.3, 0.1], [0.3, 1.0, -0.2], [0.1, -0.2, 1.0]])
    omega, alpha, beta = np.array([1e-4, 2e-4, 5e-4]), np.array([0.05, 0.1, 0.02]), np.array([0.9, 0.8, 0.7])
    expected = conditional_covariance(r, 120, DccModel(omega, alpha, beta, 0.03, 0.94, target))
    last, following = covariance_after(r[:120], DccModel(omega, alpha, beta, 0.03, 0.94, target))
    np.testing.assert_allclose(last, expected[119], rtol=1e-10)
    np.testing.assert_allclose(following, expected[120], rtol=1e-10)
    constant = conditional_covariance(r, 120, DccModel(omega, alpha, beta, 0.0, 0.0, target))
    np.testing.assert_allclose(
        covariance_after(r[:120], DccModel(omega, alpha, beta, 0.0, 0.0, target))[1], constant[120], rtol=1e-10
    )

"""The native DCC(1,1), against the recursions in NumPy, a dense search written for this test, and pymgarch's errors."""

import time
import warnings

import numpy as np
import pytest
from scipy.optimize import minimize

from vgyro.engine import recursions
from vgyro.engine.constant import constant_correlation_statistic
from vgyro.engine.models import (
    A_ZERO,
    BOUNDARY_MARGIN,
    CONVERGED,
    DCC_STATUSES,
    FAILED,
    GARCH_STATUSES,
    NO_VARIANCE,
    NOT_POSITIVE_DEFINITE,
    ONE_GYRO,
    OUTLIER_DOMINATED,
    PERSISTENCE_MAX,
    TOO_SHORT,
)
from vgyro.engine.native import dcc, garch
from vgyro.engine.reference import dcc as reference
from vgyro.engine.status import GAIN
from vgyro.errors import EngineError

STARTS = (
    (0.01, 0.98), (0.003, 0.995), (0.02, 0.95), (0.05, 0.9), (0.1, 0.8), (0.05, 0.7), (0.15, 0.5), (0.05, 0.4),
    (0.1, 0.1), (0.3, 0.1), (0.02, 0.6), (0.02, 0.02),
)  # fmt: skip
NOISE, BIAS = [0.0418, 0.0436, 0.0545, 0.06, 0.0484, 0.0446], [0.0086, -0.0092, 0.011, 0.1, 0.0082, 0.0066]
"""deg/s, of six gyros at one sample a second."""
GRID_A = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 8e-2, 0.2)
GRID_B = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.955, 0.97, 0.98, 0.988, 0.993, 0.997)
FIELDS = (
    "a", "b", "stderr", "stderr_hessian", "target", "log_likelihood", "log_likelihood_ccc", "statistic", "status",
)  # fmt: skip


def array_windows(rng, count, samples, n, a=0.0, b=0.0, rho=0.3, alpha=0.0, beta=0.0):
    """r [K, T, n] of DCC(1,1) with GARCH margins of variance 1, after 200 samples that are thrown away."""
    target = rho + (1 - rho) * np.eye(n)
    h, q, z = np.ones((count, n)), np.tile(target, (count, 1, 1)), np.zeros((count, n))
    r = np.empty((count, samples, n))
    for t in range(-200, samples):
        if t > -200:
            h = 1 - alpha - beta + alpha * h * z**2 + beta * h
            q = (1 - a - b) * target + a * z[:, :, None] * z[:, None, :] + b * q
        size = np.sqrt(np.einsum("kii->ki", q))
        root = np.linalg.cholesky(q / size[:, :, None] / size[:, None, :])
        z = np.einsum("kij,kj->ki", root, rng.standard_normal((count, n)))
        if t >= 0:
            r[:, t] = np.sqrt(h) * z
    return r


def margins_of(r, omega=1.0, alpha=0.0, beta=0.0, status=CONVERGED):
    """The same margins for each series: omega, alpha, beta [K, N] and codes."""
    shape = (len(r), r.shape[2])
    codes = np.full(shape, GARCH_STATUSES.index(status), dtype=np.uint8)
    return np.full(shape, omega), np.full(shape, alpha), np.full(shape, beta), codes


def standardised(r, omega, alpha, beta):
    return r / np.sqrt(recursions.garch_variance(r, omega, alpha, beta))


def named(fits):
    return [DCC_STATUSES[code] for code in fits.status]


def same(first, second, chosen=slice(None)):
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(first, field), getattr(second, field)[chosen], err_msg=field)


@pytest.fixture(scope="module")
def windows():
    """r of 12 windows of 6 gyros with GARCH margins, and those margins."""
    r = 0.02 * array_windows(np.random.default_rng(5), 12, 360, 6, 0.05, 0.9, 0.3, 0.08, 0.85)
    return r, *margins_of(r, 0.07 * 0.02**2, 0.08, 0.85)


@pytest.mark.parametrize(("n", "samples"), [(2, 360), (3, 361), (6, 362), (6, 363), (7, 100), (16, 250)])
def test_likelihood_and_gradient(n, samples):
    # Expected: recursions.dcc_score, NumPy. At an optimum inside the triangle the gradient is 0.
    r = array_windows(np.random.default_rng(n), 5, samples, n, 0.05, 0.9, 0.3, 0.08, 0.85)
    margins = margins_of(r, 0.07, 0.08, 0.85)
    found = dcc.fit_dcc_windows(r, *margins)
    for k in range(len(r)):
        z = standardised(r[k], *(part[k] for part in margins[:3]))
        target = recursions.correlation_target(z)
        np.testing.assert_allclose(found.target[k], target, atol=1e-13)
        value, gradient = recursions.dcc_score(z, found.a[k], found.b[k], target)
        assert found.log_likelihood[k] == pytest.approx(value, rel=1e-11, abs=1e-9)
        constant = recursions.dcc_log_likelihood(z, 0.0, 0.0, target).sum()
        assert found.log_likelihood_ccc[k] == pytest.approx(constant, rel=1e-11, abs=1e-9)
        if named(found)[k] == CONVERGED:
            # In units of a standard error: how far a Newton step would still go.
            assert np.all(np.abs(gradient * found.stderr_hessian[k]) < 2e-3)


@pytest.mark.parametrize("n", [2, 3, 6, 7])
@pytest.mark.parametrize("lags", [1, 2, 5])
def test_statistic_of_constant_correlation(n, lags):
    # Expected: the same test in NumPy, which is tested against pymgarch.
    r = array_windows(np.random.default_rng(n), 3, 151, n, 0.05, 0.9)
    found = dcc.fit_dcc_windows(r, *margins_of(r), lags)
    expected = [constant_correlation_statistic(standardised(x, np.ones(n), np.zeros(n), np.zeros(n)), lags) for x in r]
    np.testing.assert_allclose(found.statistic, expected, rtol=1e-9)


@pytest.mark.parametrize(("n", "samples"), [(2, 500), (3, 360), (6, 1000)])
def test_standard_errors_are_those_of_pymgarch(n, samples):
    # Expected: pymgarch's two_stage_vcov, all of it by numerical differences, through the reference engine.
    r = array_windows(np.random.default_rng(40 + n), 3, samples, n, 0.06, 0.88, 0.3, 0.08, 0.85)
    fits = garch.fit_garch_windows(r)
    margins = (fits.omega, fits.alpha, fits.beta, fits.status)
    found, expected = dcc.fit_dcc_windows(r, *margins), reference.fit_dcc_windows(r, *margins)
    assert named(found) == named(expected)
    assert CONVERGED in named(found)
    np.testing.assert_allclose(found.a, expected.a, rtol=1e-4)
    np.testing.assert_allclose(found.stderr, expected.stderr, rtol=1e-3)
    np.testing.assert_allclose(found.stderr_hessian, expected.stderr_hessian, rtol=1e-3)
    np.testing.assert_allclose(found.statistic, expected.statistic, rtol=1e-9)


def dense_search(z, starts=STARTS):
    """The greatest L_c over the triangle that SLSQP finds from its starts (a, b)."""
    target = recursions.correlation_target(z)

    def cost(x):
        try:
            value, gradient = recursions.dcc_score(z, float(x[0]), float(x[1]), target)
        except np.linalg.LinAlgError:
            return 1e10, np.zeros(2)
        return -value, -gradient

    room = {"type": "ineq", "fun": lambda x: PERSISTENCE_MAX - x.sum(), "jac": lambda _: -np.ones(2)}
    best = recursions.dcc_log_likelihood(z, 0.0, 0.0, target).sum()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for start in starts:
            x = minimize(
                cost, start, jac=True, method="SLSQP", bounds=[(0, PERSISTENCE_MAX)] * 2, constraints=[room],
                options={"maxiter": 200, "ftol": 1e-10},
            ).x.clip(0)  # fmt: skip
            best = max(best, -cost(x * min(1, PERSISTENCE_MAX / max(x.sum(), 1e-9)))[0])
    return best


def kinds_of_windows(rng, count, n):
    """name -> r [K, T, n]: many (a, b), constant, near-singular and changing correlation, outliers, rolling windows."""
    kinds = {
        f"dcc {a} {b}": array_windows(rng, count, 360, n, a, b)
        for a, b in (
            (0.05, 0.9), (0.03, 0.95), (0.1, 0.8), (0.02, 0.97), (0.2, 0.5), (0.15, 0.0), (0.01, 0.9), (0.3, 0.6),
        )
    } | {f"constant {rho}": array_windows(rng, count, 360, n, rho=rho) for rho in (0.0, 0.3, 0.9, 0.99999)}  # fmt: skip
    kinds["garch"] = array_windows(rng, count, 360, n, 0.05, 0.9, alpha=0.08, beta=0.85)
    kinds["short"] = array_windows(rng, count, 60, n, 0.05, 0.9)
    heavy = np.sqrt(3 / rng.chisquare(3, (count, 360, 1)))
    kinds["heavy tails"] = heavy * array_windows(rng, count, 360, n, 0.04, 0.92)
    kinds["one outlier"] = array_windows(rng, count, 360, n)
    kinds["one outlier"][:, 200] *= 15
    kinds["break"] = array_windows(rng, count, 360, n, rho=0.6)
    kinds["break"][:, 180:, 0] *= -1
    long = array_windows(rng, 1, 360 + 30 * count, n, 0.04, 0.94)[0]
    kinds["rolling"] = np.stack([long[30 * k : 30 * k + 360] for k in range(count)])
    return kinds


def shortfall(r):
    """By how much a sample the fits of windows are below the dense search; below GAIN over CCC nothing is missed."""
    found = dcc.fit_dcc_windows(r, *margins_of(r))
    assert np.all(found.a + found.b < 1)
    assert np.all(np.isfinite([found.a, found.b, found.log_likelihood, found.statistic]))
    missed = []
    for k, window in enumerate(r):
        best = dense_search(standardised(window, *np.array([[1.0], [0.0], [0.0]]).repeat(r.shape[2], 1)))
        below = (best - found.log_likelihood[k]) / len(window)
        missed.append(0.0 if best - found.log_likelihood_ccc[k] < GAIN * len(window) else below)
    return missed


def white_window(rng, kind, gyros=6, samples=360):
    """Standardised residuals [T, N] of white noise: of its level with biases, demeaned, differenced, or as it is."""
    if kind == "plain":
        return rng.standard_normal((samples, gyros))
    y = rng.normal(size=(samples + 1, 6)) * NOISE + BIAS
    r = {"level": y[1:], "demeaned": y[1:] - y[1:].mean(axis=0), "difference": np.diff(y, axis=0)}[kind]
    return by_own_margins(r)


def by_own_margins(r):
    fit = garch.fit_garch_windows(r[None])
    return standardised(r, fit.omega[0], fit.alpha[0], fit.beta[0])


def local_maxima(z):
    """(a, b) of the local maxima of L_c on a dense grid, and L_c of a constant correlation."""
    target = recursions.correlation_target(z)

    def likelihood(a, b):
        return recursions.dcc_log_likelihood(z, a, b, target).sum() if a + b < 1 else -np.inf

    grid = np.array([[likelihood(a, b) for a in GRID_A] for b in GRID_B])
    wide = np.pad(grid, 1, constant_values=-np.inf)
    around = [wide[1 + i : 1 + i + len(GRID_B), 1 + j : 1 + j + len(GRID_A)] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    places = np.nonzero((grid >= np.max(around, axis=0)) & np.isfinite(grid))
    return [(GRID_A[column], GRID_B[row]) for row, column in zip(*places, strict=True)], likelihood(0.0, 0.0)


def test_a_small_maximum_next_to_no_dynamics():
    # Expected: L_c 34.0028 with a = 0, and 34.0120 at (.0017, .376), by a dense search.
    y = np.round(np.random.default_rng(4).normal(size=(3600, 6)) * NOISE + BIAS, 6)
    z = by_own_margins(y[3240:])
    for engine in (dcc, reference):
        found = engine.fit_dcc(z)
        assert found.log_likelihood_ccc == pytest.approx(34.0028, abs=5e-5)
        assert found.log_likelihood == pytest.approx(34.0120, abs=5e-5)
        assert (found.a, found.b) == (pytest.approx(0.0017, abs=1e-4), pytest.approx(0.376, abs=2e-3))


@pytest.mark.parametrize("kind", ["level", "demeaned", "plain"])
def test_no_small_maximum_of_white_noise_is_missed(kind):
    # Expected: none of 80 fits of each kind is worse than SciPy's from all local maxima of a dense grid.
    rng = np.random.default_rng([2028, len(kind)])
    for number in range(80):
        z = white_window(rng, kind, gyros=2 + number % 5)
        starts, constant = local_maxima(z)
        best = dense_search(z, starts)
        below = best - dcc.fit_dcc(z).log_likelihood
        assert below < GAIN * len(z) or best - constant < GAIN * len(z), number


def test_the_engines_agree_on_white_noise():
    # Expected: either is no worse than the other by more than the cross-check allows, 1e-5 a sample.
    rng = np.random.default_rng(606)
    for kind in ("level", "demeaned", "difference", "plain"):
        for _ in range(6):
            z = white_window(rng, kind)
            assert dcc.fit_dcc(z).log_likelihood == pytest.approx(
                reference.fit_dcc(z).log_likelihood, abs=1e-5 * len(z)
            )


@pytest.mark.parametrize("n", [2, 3, 6])
def test_the_greatest_likelihood_is_found(n):
    # Expected: no worse than the dense search, in 18 windows of each size.
    kinds = kinds_of_windows(np.random.default_rng(2015 + n), 1, n)
    missed = np.concatenate([shortfall(r) for r in kinds.values()])
    assert np.mean(missed > 1e-6) <= 1 / len(missed)


@pytest.mark.full
@pytest.mark.timeout(1800)
def test_the_greatest_likelihood_is_found_in_many_windows():
    # Expected: worse than the dense search by 1e-6 a sample in at most 1 % of the windows, by 1e-3 in at most .1 %.
    rng = np.random.default_rng(20150612)
    missed = np.concatenate(
        [shortfall(r) for n, count in ((2, 20), (3, 20), (6, 20)) for r in kinds_of_windows(rng, count, n).values()]
    )
    assert len(missed) > 1000
    assert np.mean(missed > 1e-6) <= 0.01
    assert np.mean(missed > 1e-3) <= 0.001


def test_the_same_bits_for_any_threads_batch_and_instruction_set(windows, monkeypatch):
    monkeypatch.setenv("VGYRO_THREADS", "1")
    usual = dcc.fit_dcc_windows(*windows)
    for k in (0, 5, 11):
        same(dcc.fit_dcc_windows(*(part[k : k + 1] for part in windows)), usual, slice(k, k + 1))
    many = [np.concatenate([part] * 12) for part in windows]
    monkeypatch.setenv("VGYRO_THREADS", "3")
    same(usual, dcc.fit_dcc_windows(*many), slice(72, 84))
    monkeypatch.setenv("VGYRO_ISA", "baseline")
    same(usual, dcc.fit_dcc_windows(*windows))


def test_one_series_of_windows_and_a_single_fit_agree(windows):
    # Expected: fit_dcc of the residuals of one window is fit_dcc_windows of that window.
    r, omega, alpha, beta, _ = windows
    many = dcc.fit_dcc_windows(*windows)
    z = standardised(r[3], omega[3], alpha[3], beta[3])
    alone = dcc.fit_dcc(z)
    assert (alone.a, alone.b) == pytest.approx((many.a[3], many.b[3]), rel=1e-6)
    assert alone.log_likelihood == pytest.approx(many.log_likelihood[3], rel=1e-10)
    np.testing.assert_allclose(alone.stderr_hessian, many.stderr_hessian[3], rtol=1e-5)
    np.testing.assert_allclose(alone.target, many.target[3], rtol=1e-12)


def test_units_do_not_matter(windows):
    # Closed form: z does not change where r and √ω are scaled by the same number.
    r, omega, alpha, beta, status = windows
    usual, scaled = dcc.fit_dcc_windows(*windows), dcc.fit_dcc_windows(1e6 * r, 1e12 * omega, alpha, beta, status)
    np.testing.assert_allclose(scaled.a, usual.a, rtol=1e-6)
    np.testing.assert_allclose(scaled.stderr, usual.stderr, rtol=1e-6)


def test_statuses(windows):
    # Expected: the rules of vgyro.engine.status; by definition a = b = 0 where S is singular or data are not finite.
    r, omega, alpha, beta, status = (part[:7].copy() for part in windows)
    r[0, :, 3] = r[0, :, 2]
    r[1, 7, 0] = np.nan
    r[2, 7, 0] = np.inf
    status[3, 1] = GARCH_STATUSES.index("boundary: β = 0")
    status[4, 1] = GARCH_STATUSES.index(OUTLIER_DOMINATED)
    r[5, :, 5] = 0.0
    r[6, :, 0] = 0.7
    found = dcc.fit_dcc_windows(r, omega, alpha, beta, status)
    names = [NOT_POSITIVE_DEFINITE, FAILED, FAILED, BOUNDARY_MARGIN, OUTLIER_DOMINATED, NO_VARIANCE, NO_VARIANCE]
    assert named(found) == names
    assert named(reference.fit_dcc_windows(r, omega, alpha, beta, status)) == names
    fitted = np.array([False, False, False, True, True, False, False])
    np.testing.assert_array_equal(found.a[~fitted], 0.0)
    np.testing.assert_array_equal(found.target[~fitted], np.tile(np.eye(6), (5, 1, 1)))
    np.testing.assert_array_equal(np.isfinite(found.log_likelihood), [True, False, False, True, True, False, False])
    assert np.isnan(found.stderr).all()
    np.testing.assert_array_equal(np.isfinite(found.stderr_hessian[:, 0]), np.arange(7) == 3)
    same(dcc.fit_dcc_windows(*(part[3:] for part in (r, omega, alpha, beta, status))), found, slice(3, 7))


def test_no_dynamics():
    # Outer products that alternate: a > 0 makes the likelihood worse. Expected by definition: a = b = 0.
    z = np.random.default_rng(0).standard_normal((400, 2))
    z[:, 1] = np.where(np.arange(400) % 2, 0.8, -0.8) * z[:, 0] + 0.6 * z[:, 1]
    found = dcc.fit_dcc_windows(z[None], *margins_of(z[None]))
    assert named(found) == [A_ZERO]
    assert (found.a[0], found.b[0]) == (0.0, 0.0)
    assert found.log_likelihood[0] == found.log_likelihood_ccc[0]


def test_small_and_empty_batches():
    rng = np.random.default_rng(1)
    for shape, status in (((2, 100, 1), ONE_GYRO), ((2, 10, 3), TOO_SHORT), ((0, 100, 3), None)):
        r = rng.standard_normal(shape)
        found = dcc.fit_dcc_windows(r, *margins_of(r))
        assert named(found) == [status] * shape[0]
        assert found.target.shape == (shape[0], shape[2], shape[2])
        assert np.isnan(found.statistic).all()
    with pytest.raises(EngineError, match="40 series"):
        dcc.fit_dcc(rng.standard_normal((100, 40)))


@pytest.mark.full
def test_a_million_samples():
    # Expected: the (a, b) that made them, within 5 standard errors; within 20 CPU seconds.
    r = array_windows(np.random.default_rng(3), 1, 1_000_000, 6, 0.03, 0.95, 0.3, 0.05, 0.9)
    begun = time.process_time()
    found = dcc.fit_dcc_windows(r, *margins_of(r, 0.05, 0.05, 0.9))
    assert time.process_time() - begun < 20
    assert abs(found.a[0] - 0.03) < 5 * found.stderr[0, 0]
    assert abs(found.b[0] - 0.95) < 5 * found.stderr[0, 1]

"""DCC(1,1), against pymgarch, the recursion by hand, and simulated truth."""

import numpy as np
import pytest
from arch import arch_model
from pymgarch.correlation import correlation_targets
from pymgarch.estimation import ParamLayout, Stage2Fit, fit_stage2
from pymgarch.inference import two_stage_vcov
from pymgarch.marginals import MarginalSet

from vgyro.engine.recursions import dcc_log_likelihood, dcc_score
from vgyro.engine.reference.dcc import fit_by_pymgarch
from vgyro.volatility import dcc_correlation, fit_ccc, fit_dcc, fit_garch


@pytest.fixture(scope="module")
def array(simulator, equicorrelated):
    """r, margins and z of four gyros, 1000 samples, (a, b) = (.05, .9)."""
    r = simulator(1000, [1e-4] * 4, [0.08] * 4, [0.85] * 4, 0.05, 0.9, equicorrelated(4, 0.3), seed=12)[0]
    margins = fit_garch(r)
    return r, margins, r / np.sqrt(margins.variance)


@pytest.fixture(scope="module")
def fit(array):
    r, margins, z = array
    return fit_dcc(z, r=r, margins=margins)


def test_the_recursion_by_hand():
    # Expected: eq. 4 and 5 of Liu et al. written out.
    z = np.array([[1.0, 0.5], [-0.3, 2.0], [0.7, -0.1]])
    target, a, b = np.array([[1.0, 0.4], [0.4, 1.0]]), 0.1, 0.8
    q = target
    expected = [q]
    for row in z[:-1]:
        q = (1 - a - b) * target + a * np.outer(row, row) + b * q
        expected.append(q / np.sqrt(np.outer(np.diag(q), np.diag(q))))
    np.testing.assert_allclose(dcc_correlation(z, a, b, target), expected, rtol=1e-13)
    np.testing.assert_allclose(dcc_correlation(z[2:], a, b, target, start=q), expected[2:], rtol=1e-13)


def test_likelihood_without_constant(array):
    # Closed form with scipy's multivariate normal: L_c = Σ log N(z; R_t) - log N(z; I).
    from scipy.stats import multivariate_normal

    _, _, z = array
    target = np.corrcoef(z.T)
    correlation = dcc_correlation(z, 0.04, 0.9, target)
    expected = [
        multivariate_normal.logpdf(row, cov=matrix) - multivariate_normal.logpdf(row, cov=np.eye(4))
        for row, matrix in zip(z[:50], correlation[:50], strict=True)
    ]
    np.testing.assert_allclose(dcc_log_likelihood(z, 0.04, 0.9, target)[:50], expected, rtol=1e-9, atol=1e-12)


def test_gradient_by_differences(array):
    _, _, z = array
    target = np.corrcoef(z.T)
    value, gradient = dcc_score(z, 0.04, 0.9, target)
    step = 1e-6
    assert value == pytest.approx(dcc_log_likelihood(z, 0.04, 0.9, target).sum(), rel=1e-12)
    for j, (da, db) in enumerate([(step, 0), (0, step)]):
        above = dcc_log_likelihood(z, 0.04 + da, 0.9 + db, target).sum()
        below = dcc_log_likelihood(z, 0.04 - da, 0.9 - db, target).sum()
        assert gradient[j] == pytest.approx((above - below) / (2 * step), rel=1e-5)


@pytest.mark.parametrize(("a", "b", "seed"), [(0.03, 0.95, 0), (0.05, 0.85, 1)])
def test_same_optimum_as_pymgarch(simulator, equicorrelated, a, b, seed):
    # Expected: pymgarch's own stage-2 fit of the same standardised residuals.
    z = simulator(300, [1.0] * 2, [0.0] * 2, [0.0] * 2, a, b, equicorrelated(2, 0.2), seed=seed)[0]
    fit = fit_dcc(z)
    expected = fit_by_pymgarch(z)
    assert fit.log_likelihood == pytest.approx(expected[2], abs=1e-6)
    assert (fit.a, fit.b) == pytest.approx(expected[:2], abs=2e-5)


def test_two_step_errors_are_those_of_pymgarch(simulator, equicorrelated):
    # Expected: pymgarch's two_stage_vcov with arch's margins, at the same parameters and the same start.
    r = simulator(500, [1e-4] * 2, [0.1] * 2, [0.8] * 2, 0.06, 0.85, equicorrelated(2, 0.3), seed=3)[0]
    margins = fit_garch(r)
    z = r / np.sqrt(margins.variance)
    fit = fit_dcc(z, r=r, margins=margins)
    assert fit.status == "converged"
    scale = np.mean(r**2, axis=0)
    results = []
    for i in range(2):
        model = arch_model(r[:, i] / np.sqrt(scale[i]), mean="Zero", vol="GARCH", p=1, q=1, rescale=False)
        start = np.array([margins.omega[i] / scale[i], margins.alpha[i], margins.beta[i]])
        results.append(
            model.fit(disp="off", backcast=1.0, show_warning=False, starting_values=start, options={"ftol": 1e-10})
        )
    layout = ParamLayout(asymmetric=False, studentt=False)
    stage = fit_stage2(np.ascontiguousarray(z), layout)
    stage = Stage2Fit(**{**stage.__dict__, "params": np.array([fit.a, fit.b])})
    expected = two_stage_vcov(MarginalSet.from_results(results), stage)
    assert expected["method"] == "two-stage-robust"
    np.testing.assert_allclose(fit.stderr, expected["se"], rtol=2e-2)


def test_truth_within_its_standard_errors(fit):
    # Expected: the (a, b) that made the series.
    assert fit.status == "converged"
    assert abs(fit.a - 0.05) < 4 * fit.stderr[0]
    assert abs(fit.b - 0.90) < 4 * fit.stderr[1]
    assert np.all(fit.stderr > 0.3 * fit.stderr_hessian)
    assert np.all(fit.stderr < 4 * fit.stderr_hessian)


def test_follows_the_true_correlation(simulator, equicorrelated):
    # Expected: the R_t that made the series; a constant correlation follows it worse.
    z, _, truth = simulator(3000, [1.0] * 3, [0.0] * 3, [0.0] * 3, 0.05, 0.93, equicorrelated(3, 0.3), seed=3)
    fit = fit_dcc(z)
    error = np.sqrt(np.mean((fit.correlation - truth) ** 2))
    assert error < 0.3 * np.sqrt(np.mean((fit.target - truth) ** 2))


def test_conventions(array, fit):
    # Closed form: S = z'z/T scaled to unit diagonal, R_1 = S, unit diagonals throughout.
    z = array[2]
    moment = z.T @ z / len(z)
    size = np.sqrt(np.diag(moment))
    np.testing.assert_allclose(fit.target, moment / np.outer(size, size), rtol=1e-12)
    np.testing.assert_allclose(fit.correlation[0], fit.target, rtol=1e-12)
    np.testing.assert_array_equal(np.diagonal(fit.correlation, axis1=1, axis2=2), 1.0)
    assert np.linalg.eigvalsh(fit.correlation).min() > 0


def test_without_margins_there_are_only_hessian_errors(array, fit):
    alone = fit_dcc(array[2])
    assert (alone.a, alone.b) == (fit.a, fit.b)
    assert np.all(np.isnan(alone.stderr))
    np.testing.assert_allclose(alone.stderr_hessian, fit.stderr_hessian, rtol=1e-9)


def test_ccc_is_dcc_with_nothing_moving(array, fit):
    ccc = fit_ccc(array[2])
    assert (ccc.a, ccc.b) == (0.0, 0.0)
    np.testing.assert_allclose(ccc.target, fit.target, rtol=1e-12)
    assert np.ptp(ccc.correlation, axis=0).max() == 0
    assert ccc.log_likelihood == pytest.approx(fit.log_likelihood_ccc, rel=1e-12)
    np.testing.assert_allclose(dcc_correlation(array[2], 0.0, 0.0, fit.target)[-1], ccc.correlation[-1], rtol=1e-12)
    assert fit.log_likelihood > ccc.log_likelihood
    # Expected: the constant correlation of pymgarch for the same residuals.
    np.testing.assert_allclose(ccc.target, correlation_targets(array[2])[0], rtol=1e-12)


@pytest.mark.parametrize("engine", ["native", "reference"])
def test_no_dynamics_is_a_boundary(engine):
    # Outer products that alternate: a > 0 makes the likelihood worse. Expected by definition: a = b = 0.
    rng = np.random.default_rng(0)
    z = rng.standard_normal((400, 2))
    z[:, 1] = np.where(np.arange(400) % 2, 0.8, -0.8) * z[:, 0] + 0.6 * z[:, 1]
    fit = fit_dcc(z, engine)
    assert fit.status == "boundary: a = 0"
    assert (fit.a, fit.b) == (0.0, 0.0)
    assert np.all(np.isnan(fit.stderr_hessian))
    assert fit.log_likelihood == fit.log_likelihood_ccc


@pytest.mark.parametrize("engine", ["native", "reference"])
def test_a_margin_at_its_boundary_leaves_no_two_step_errors(array, engine):
    r, margins, z = array
    status = margins.status.copy()
    status[1] = "boundary: β = 0"
    found = fit_dcc(z, engine, r=r, margins=type(margins)(**{**margins.__dict__, "status": status}))
    assert found.status == "boundary margin"
    assert np.all(np.isnan(found.stderr))
    assert np.all(np.isfinite(found.stderr_hessian))


@pytest.mark.parametrize("engine", ["native", "reference"])
def test_singular_correlation_falls_back_to_the_identity(array, engine):
    z = array[2].copy()
    z[:, 2] = z[:, 1]
    for found in (fit_dcc(z, engine), fit_ccc(z, engine)):
        assert found.status == "not positive definite"
        np.testing.assert_array_equal(found.target, np.eye(4))
        np.testing.assert_array_equal(found.correlation[5], np.eye(4))


@pytest.mark.parametrize("engine", ["native", "reference"])
def test_one_gyro_and_short_and_nan(array, engine):
    z = array[2]
    assert fit_dcc(z[:, :1], engine).status == "one gyro"
    assert fit_dcc(z[:, :1], engine).correlation.shape == (1000, 1, 1)
    assert fit_ccc(z[:, :1], engine).status == "one gyro"
    assert fit_dcc(z[:10], engine).status == "too short"
    broken = z.copy()
    broken[3, 1] = np.nan
    assert fit_dcc(broken, engine).status == "failed"


@pytest.mark.parametrize("engine", ["native", "reference"])
@pytest.mark.parametrize("value", [0.0, 5.0, -1e-9])
def test_a_constant_series_has_no_variance(array, engine, value):
    # Expected: as fit_garch says of it; what is standardised by its model is NaN throughout.
    r = array[0].copy()
    r[:, 1] = value
    margins = fit_garch(r, engine)
    assert margins.status[1] == "no variance"
    with np.errstate(invalid="ignore"):
        z = r / np.sqrt(margins.variance)
    for found in (fit_dcc(z, engine), fit_dcc(z, engine, r=r, margins=margins), fit_dcc(r, engine), fit_ccc(r, engine)):
        assert found.status == "no variance"
        assert (found.a, found.b) == (0.0, 0.0)
        np.testing.assert_array_equal(found.target, np.eye(4))
        assert np.isnan([found.log_likelihood, found.log_likelihood_ccc]).all()
    r[7, 1] = np.nan
    assert fit_dcc(np.full(z.shape, np.nan), engine, r=r, margins=margins).status == "failed"


@pytest.mark.full
def test_standard_errors_are_honest(simulator, equicorrelated):
    # Expected: the spread of 60 estimates of the same truth.
    estimates, errors = [], []
    for seed in range(60):
        r = simulator(1000, [0.05] * 3, [0.08] * 3, [0.87] * 3, 0.05, 0.9, equicorrelated(3, 0.3), seed=seed)[0]
        margins = fit_garch(r)
        found = fit_dcc(r / np.sqrt(margins.variance), r=r, margins=margins)
        if found.status == "converged":
            estimates.append([found.a, found.b])
            errors.append(found.stderr)
    assert len(estimates) > 45
    ratio = np.std(estimates, axis=0) / np.median(errors, axis=0)
    assert np.all((ratio > 0.65) & (ratio < 1.6))

"""GARCH(1,1), against arch, the recursion by hand, and simulated truth."""

import numpy as np
import pytest
from arch import arch_model

from vgyro import engine as engines
from vgyro.engine.models import ALPHA_ZERO, GARCH_STATUSES, PERSISTENCE_ONE
from vgyro.engine.recursions import garch_log_likelihood
from vgyro.engine.reference.garch import fit_garch_pq
from vgyro.errors import EngineError, TooShort
from vgyro.volatility import fit_garch, garch_variance


@pytest.fixture(scope="module")
def window(simulator):
    return simulator(360, [1e-4] * 8, [0.08] * 8, [0.85] * 8, seed=4)[0]


@pytest.fixture(scope="module")
def fit(window):
    return fit_garch(window)


def by_hand(r, omega, alpha, beta, first):
    h = [first]
    for e in r[:-1]:
        h.append(omega + alpha * e**2 + beta * h[-1])
    return np.array(h)


def test_the_recursion_and_its_start():
    # Expected: the recursion written out, h_1 = ω + (α + β)·mean(e²).
    r = np.array([[0.5, 1.0], [-0.1, 2.0], [0.3, -1.0], [0.0, 0.5]])
    omega, alpha, beta = np.array([0.1, 0.2]), np.array([0.2, 0.1]), np.array([0.5, 0.6])
    h = garch_variance(r, omega, alpha, beta)
    for i in range(2):
        first = omega[i] + (alpha[i] + beta[i]) * np.mean(r[:, i] ** 2)
        np.testing.assert_allclose(h[:, i], by_hand(r[:, i], omega[i], alpha[i], beta[i], first), rtol=1e-13)


def test_the_recursion_can_be_carried_forward(window):
    omega, alpha, beta = np.full(8, 1e-4), np.full(8, 0.1), np.full(8, 0.8)
    whole = garch_variance(window, omega, alpha, beta)
    later = garch_variance(window[200:], omega, alpha, beta, start=whole[200])
    np.testing.assert_allclose(later, whole[200:], rtol=1e-12)


def test_likelihood_not_worse_than_arch_and_variance_the_same(window, fit):
    # Expected: arch itself with the same start of the recursion, from its own starting values.
    for i in range(8):
        e = window[:, i]
        scale = np.mean(e**2)
        model = arch_model(e / np.sqrt(scale), mean="Zero", vol="GARCH", p=1, q=1, rescale=False)
        theirs = model.fit(disp="off", backcast=1.0, show_warning=False)
        likelihood = theirs.loglikelihood - 180 * np.log(scale)
        assert fit.log_likelihood[i] >= likelihood - 1e-4
        h = model.fix([fit.omega[i] / scale, fit.alpha[i], fit.beta[i]]).conditional_volatility ** 2 * scale
        # model.fix takes arch's own backcast: what is left of that after 100 samples at β < .97 is small.
        if fit.beta[i] < 0.9:
            np.testing.assert_allclose(fit.variance[100:, i], h[100:], rtol=1e-3)


def test_same_parameters_as_arch_where_the_optimum_is_clear(simulator):
    r = simulator(3000, [1e-4], [0.1], [0.8], seed=2)[0]
    fit = fit_garch(r)
    scale = np.mean(r**2)
    model = arch_model(r[:, 0] / np.sqrt(scale), mean="Zero", vol="GARCH", p=1, q=1, rescale=False)
    theirs = model.fit(disp="off", backcast=1.0, show_warning=False, options={"ftol": 1e-10})
    expected = theirs.params.to_numpy() * [scale, 1, 1]
    np.testing.assert_allclose([fit.omega[0], fit.alpha[0], fit.beta[0]], expected, rtol=2e-3)
    np.testing.assert_allclose(fit.stderr[0], theirs.std_err.to_numpy() * [scale, 1, 1], rtol=1e-2)
    assert fit.log_likelihood[0] == pytest.approx(theirs.loglikelihood - 1500 * np.log(scale), abs=1e-5)


def test_truth_within_its_standard_errors(simulator):
    # Expected: the parameters that made the series; 12 estimates, none off by more than 4 of its standard errors.
    truth = np.array([2e-4, 0.1, 0.8])
    r = simulator(4000, *(np.full(4, p) for p in truth), seed=8)[0]
    fit = fit_garch(r)
    assert list(fit.status) == ["converged"] * 4
    away = (np.stack([fit.omega, fit.alpha, fit.beta], axis=1) - truth) / fit.stderr
    assert np.all(np.abs(away) < 4)
    assert 0.3 < np.sqrt(np.mean(away**2)) < 2


def test_constraints_hold(fit):
    assert np.all(fit.omega > 0)
    assert np.all(fit.alpha >= 0)
    assert np.all(fit.beta >= 0)
    assert np.all(fit.alpha + fit.beta < 1)


def test_scales_with_the_unit(window, fit):
    # A power of two leaves every digit: the fit is the same one, standard errors included.
    scaled = fit_garch(1024.0 * window)
    np.testing.assert_allclose(scaled.omega, 1024.0**2 * fit.omega, rtol=1e-13)
    np.testing.assert_allclose(scaled.alpha, fit.alpha, rtol=1e-13)
    np.testing.assert_allclose(scaled.stderr, fit.stderr * [1024.0**2, 1, 1], rtol=1e-13)
    np.testing.assert_allclose(scaled.log_likelihood, fit.log_likelihood - 360 * np.log(1024.0), rtol=1e-12)


def test_a_series_does_not_depend_on_its_neighbours(window, fit):
    alone = fit_garch(window[:, [3]])
    assert alone.alpha[0] == fit.alpha[3]
    assert alone.omega[0] == fit.omega[3]
    assert fit_garch(window).beta.tolist() == fit.beta.tolist()


@pytest.mark.parametrize("engine", ["native", "reference"])
def test_alpha_at_zero(engine):
    # Anticorrelated squares: no α > 0 helps. Expected: at least the closed form of a constant variance, and no more
    # than a trend of the variance can add (1.92 is the 5 % limit of the likelihood ratio).
    rng = np.random.default_rng(1)
    e = rng.standard_normal((360, 1)) * np.where(np.arange(360) % 2, 1.3, 0.7)[:, None]
    fit = fit_garch(e, engine)
    assert fit.status[0] == ALPHA_ZERO
    assert fit.alpha[0] < 1e-3
    constant = -180 * (np.log(2 * np.pi * np.mean(e**2)) + 1)
    assert constant <= fit.log_likelihood[0] < constant + 1.92
    assert np.all(np.isnan(fit.stderr))


@pytest.mark.parametrize("engine", ["native", "reference"])
def test_a_gain_of_nothing_is_a_constant_variance(engine):
    # e² alternates by a hair, which no α >= 0 can use. Expected by definition: α = β = 0, ω = mean(e²).
    e = np.sign(np.random.default_rng(1).standard_normal((360, 1))) * (1 + 1e-3 * (-1.0) ** np.arange(360))[:, None]
    fit = fit_garch(e, engine)
    assert (fit.alpha[0], fit.beta[0], fit.status[0]) == (0.0, 0.0, ALPHA_ZERO)
    assert fit.omega[0] == pytest.approx(np.mean(e**2), rel=1e-12)
    assert fit.log_likelihood[0] == pytest.approx(-180 * (np.log(2 * np.pi * np.mean(e**2)) + 1), rel=1e-12)
    np.testing.assert_allclose(fit.variance, np.mean(e**2))
    assert np.all(np.isnan(fit.stderr))


def test_persistence_at_one_is_a_boundary():
    # A variance that only grows: α + β runs into 1.
    rng = np.random.default_rng(2)
    e = (rng.standard_normal(400) * np.exp(np.linspace(0, 3, 400)))[:, None]
    fit = fit_garch(e)
    assert fit.status[0] == PERSISTENCE_ONE
    assert fit.alpha[0] + fit.beta[0] < 1
    assert np.all(np.isnan(fit.stderr))


def test_bad_columns_have_a_status_and_harm_nobody(window):
    bad = window.copy()
    bad[:, 0] = 0.25
    bad[:, 1] = 0.0
    bad[7, 2] = np.nan
    alone = fit_garch(window[:, 3:])
    found = fit_garch(bad)
    assert list(found.status[:3]) == ["no variance", "no variance", "failed"]
    assert np.all(np.isnan(found.omega[:3]))
    assert np.all(np.isnan(found.variance[:, :3]))
    np.testing.assert_array_equal(found.alpha[3:], alone.alpha)


def test_short_series():
    found = fit_garch(np.random.default_rng(0).standard_normal((19, 2)))
    assert list(found.status) == ["too short"] * 2
    with pytest.raises(TooShort):
        fit_garch(np.empty((0, 2)))


def test_unknown_engine(window):
    with pytest.raises(EngineError, match="Known engines: native, reference"):
        fit_garch(window, engine="abacus")


def test_the_parameters_give_the_variance_and_the_likelihood(window, fit):
    # Expected: the recursion and the likelihood in NumPy.
    variance = garch_variance(window, fit.omega, fit.alpha, fit.beta)
    np.testing.assert_allclose(variance, fit.variance, rtol=1e-12)
    np.testing.assert_allclose(garch_log_likelihood(window, variance), fit.log_likelihood, rtol=1e-12)


def test_higher_orders(simulator):
    # GARCH(1,1) is inside GARCH(2,1) and (1,2): the likelihood cannot fall; and (1,1) is fit_garch.
    r = simulator(2000, [1e-4], [0.1], [0.8], seed=5)[0]
    plain = fit_garch_pq(r, 1, 1)
    fit = fit_garch(r)
    assert plain.log_likelihood[0] == pytest.approx(fit.log_likelihood[0], abs=1e-3)
    assert plain.alpha[0, 0] == pytest.approx(fit.alpha[0], rel=1e-2)
    more_variances, more_squares = fit_garch_pq(r, p=2, q=1), fit_garch_pq(r, p=1, q=2)
    assert more_variances.beta.shape == (1, 2)
    assert more_squares.alpha.shape == (1, 2)
    assert more_variances.log_likelihood[0] >= plain.log_likelihood[0] - 1e-2
    assert more_squares.log_likelihood[0] >= plain.log_likelihood[0] - 1e-2
    assert fit_garch_pq(np.zeros((100, 1))).status[0] == "no variance"


def test_engines_agree(simulator):
    # Expected: the same optimum by arch from its own starts, or a worse one of arch's.
    r = simulator(360, [1e-4] * 6, [0.05] * 6, [0.9] * 6, seed=21)[0]
    ours, theirs = fit_garch(r, "native"), fit_garch(r, "reference")
    assert np.all(ours.log_likelihood >= theirs.log_likelihood - 1e-5)
    same = ours.log_likelihood < theirs.log_likelihood + 1e-5
    assert np.sum(same) >= 5
    assert np.all(ours.status[same] == theirs.status[same])
    np.testing.assert_allclose(ours.variance[:, same], theirs.variance[:, same], rtol=5e-3)
    windows = engines.get("reference").garch.fit_garch_windows(r[None])
    np.testing.assert_array_equal(windows.omega[0], theirs.omega)
    np.testing.assert_array_equal([GARCH_STATUSES[code] for code in windows.status[0]], theirs.status)


@pytest.mark.full
def test_a_dense_grid_of_starts_seldom_finds_a_better_optimum(simulator):
    # Expected: the best of 12 starts of arch, for both engines. Several optima are normal at T = 360; a miss must be
    # far smaller than what tells two models apart (1.92 at 5 %).
    r = simulator(360, [1e-4] * 60, [0.05] * 60, [0.9] * 60, seed=21)[0]
    fits = [fit_garch(r, engine) for engine in ("native", "reference")]
    missed = np.zeros((2, 60))
    for i in range(60):
        scale = np.mean(r[:, i] ** 2)
        model = arch_model(r[:, i] / np.sqrt(scale), mean="Zero", vol="GARCH", p=1, q=1, rescale=False)
        for alpha in (0.02, 0.1, 0.3):
            for total in (0.35, 0.7, 0.9, 0.99):
                start = np.array([1 - total, alpha, total - alpha])
                theirs = model.fit(disp="off", backcast=1.0, show_warning=False, starting_values=start)
                if theirs.convergence_flag == 0:
                    for k, fit in enumerate(fits):
                        better = theirs.loglikelihood - 180 * np.log(scale) - fit.log_likelihood[i]
                        missed[k, i] = max(missed[k, i], better)
    assert np.all(np.sum(missed > 1e-3, axis=1) <= 3)
    assert missed.max() < 0.2

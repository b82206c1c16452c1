"""Waegli/Guerrier: ARMA of simulated series, GARCH by `arch`, weights written out."""

import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from arch import arch_model
from scipy.optimize import minimize
from scipy.signal import lfilter

from vgyro import engine
from vgyro.engine.models import CONVERGED, FAILED
from vgyro.engine.status import garch_code
from vgyro.fusion import CannotRun, FilterParameters
from vgyro.fusion.papers.arma import Arma, fit_arma
from vgyro.fusion.papers.waegli_guerrier import _model, fit_residuals, residual_weights, waegli_guerrier

PARAMETERS = FilterParameters()
LOW_PASS = engine.get("native").kalman.low_pass


def arma(samples, phi, theta, seed, mean=0.0):
    """A simulated ARMA(1,1), settled, with innovations of variance 1."""
    e = np.random.default_rng(seed).standard_normal(samples + 2000)
    return mean + lfilter([1.0, theta], [1.0, -phi], e)[2000:]


def conditional_cost(v, constant, phi, theta):
    """Σe² given the first value and e_1 = 0, as a loop."""
    e, total = 0.0, 0.0
    for now, before in zip(v[1:], v[:-1], strict=True):
        e = now - constant - phi * before - theta * e
        total += e * e
    return total


@pytest.mark.parametrize(("phi", "theta"), [(0.9, -0.5), (0.5, 0.4), (-0.6, 0.2), (0.3, -0.8), (0.7, 0.0), (0.0, 0.9)])
def test_parameters_of_a_simulated_arma(phi, theta):
    # Expected: the truth, within four standard errors: (1 + φθ)²/(φ + θ)²·(1 - φ²)/T and the like (Box & Jenkins, 7.2).
    samples, errors = 20_000, []
    for seed in range(8):
        found = fit_arma(arma(samples, phi, theta, seed, mean=3.0), LOW_PASS)
        errors.append([found.phi - phi, found.theta - theta, found.constant / (1 - found.phi) - 3.0])
    factor = (1 + phi * theta) / abs(phi + theta) / np.sqrt(samples)
    size = [factor * np.sqrt(1 - phi**2), factor * np.sqrt(1 - theta**2), (1 + theta) / (1 - phi) / np.sqrt(samples)]
    assert (np.abs(np.mean(errors, axis=0)) < 4 * np.array(size) / np.sqrt(8)).all()
    assert (np.std(errors, axis=0) < 2 * np.array(size)).all()


def test_a_random_walk_in_white_noise():
    # Expected: its moving average: λ = (K T/N)², θ = -(1 - p∞), p∞ = (√(λ² + 4λ) - λ)/2 (Muth 1960); φ → 1.
    rng = np.random.default_rng(4)
    v = np.cumsum(rng.normal(0, 0.02, 200_000)) + rng.standard_normal(200_000)
    growth = 0.02**2
    found = fit_arma(v, LOW_PASS)
    assert 1 + found.theta == pytest.approx((np.sqrt(growth**2 + 4 * growth) - growth) / 2, rel=0.1)
    assert 1 - found.phi < 0.001


@pytest.mark.parametrize("seed", range(4))
def test_least_cost_by_another_search(seed):
    # Expected: Nelder-Mead of scipy over all three parameters, the cost a plain loop, from the truth.
    v = arma(400, 0.8, -0.3, seed, mean=2.0)
    other = minimize(
        lambda p: conditional_cost(v, *p),
        [0.4, 0.8, -0.3],
        method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-9},
    )
    found = fit_arma(v, LOW_PASS)
    cost = conditional_cost(v, found.constant, found.phi, found.theta)
    assert cost == pytest.approx(other.fun, rel=1e-6)


def test_white_noise_has_no_arma():
    v = np.random.default_rng(5).standard_normal(5000) + 7.0
    assert fit_arma(v, LOW_PASS) == Arma(pytest.approx(v.mean()), 0.0, 0.0)


@pytest.fixture
def changing(make_array):
    """changing(samples, …): gyros whose noise changes by GARCH(1,1), with biases."""

    def make(samples, gyros=4, seed=6, truth=0.0, **more):
        array = make_array(samples, np.full(gyros, 0.1), seed=seed, **more)
        rng = np.random.default_rng(seed + 100)
        h, e, rate = np.ones(gyros), np.zeros(gyros), np.empty((samples, gyros))
        for t in range(samples):
            h = 0.02 + 0.08 * e**2 + 0.9 * h
            e = np.sqrt(h) * rng.standard_normal(gyros)
            rate[t] = e
        return replace(array, rate=rate + rng.normal(0, 1, gyros) + np.asarray(truth)[..., None])

    return make


def written_out(rate, models):
    """h of one stretch and the fused rate, as a loop over the samples."""
    v = rate - rate.mean(axis=1, keepdims=True)
    h = np.empty_like(v)
    for i, model in enumerate(models):
        e, square = 0.0, model.mean_square
        h[0, i] = model.mean_square
        for t in range(1, len(v)):
            h[t, i] = model.omega + model.alpha * square + model.beta * h[t - 1, i]
            e = v[t, i] - model.arma.constant - model.arma.phi * v[t - 1, i] - model.arma.theta * e
            square = e * e
    return h, (rate / h).sum(axis=1) / (1 / h).sum(axis=1)


@pytest.mark.parametrize("piece", [1 << 16, 1, 37])
def test_weights_are_inverse_variances(changing, monkeypatch, piece):
    # Expected: 1/h normalised, everything written out as loops, in three stretches; one is a single sample.
    array = changing(900, segment=np.repeat([0, 1, 2], [500, 1, 399]))
    fused = waegli_guerrier(array, PARAMETERS)
    models = fit_residuals(array, "native")
    monkeypatch.setattr("vgyro.fusion.blocks.PIECE", piece)
    monkeypatch.setattr("vgyro.fusion.papers.waegli_guerrier.PIECE", piece)
    weights = np.concatenate(list(fused.weights.pieces()))
    for part in array.stretches():
        h, rate = written_out(array.rate[part], models)
        np.testing.assert_allclose(weights[part], (1 / h) / (1 / h).sum(axis=1, keepdims=True), atol=1e-8)
        np.testing.assert_allclose(fused.rate[part], rate, atol=1e-8)
    later = fused.weights.part(slice(650, 900))
    np.testing.assert_allclose(np.concatenate(list(later.pieces())), weights[650:], rtol=1e-12)


def test_variance_by_arch(changing):
    # Expected: arch's own recursion at our parameters, with its backcast at mean(e²).
    array = changing(3000)
    models = fit_residuals(array, "native")
    v = array.rate - array.rate.mean(axis=1, keepdims=True)
    h, _ = written_out(array.rate, models)
    for i, model in enumerate(models):
        e = model.arma.innovations(v[1:, i].copy(), v[0, i], 0.0, LOW_PASS)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            known = arch_model(e, mean="Zero", vol="GARCH", p=1, q=1, rescale=False)
            fixed = known.volatility
        sigma = np.empty(len(e))
        fixed.compute_variance(
            np.array([model.omega, model.alpha, model.beta]), e, sigma, model.mean_square,
            np.tile([1e-12, 1e12], (len(e), 1)),
        )  # fmt: skip
        np.testing.assert_allclose(h[1:, i], sigma, rtol=1e-8)


def test_parameters_of_simulated_garch(changing):
    # Expected: persistence .98 of the truth; each residual also holds 1/N² of every other gyro's squares.
    models = fit_residuals(changing(60_000), "native")
    for model in models:
        assert model.alpha + model.beta == pytest.approx(0.98, abs=0.02)
        assert 0.02 < model.alpha < 0.12


def test_in_motion_the_motion_adds_itself(changing):
    # Expected: the same noise without motion, plus the motion.
    truth = 80 * np.sin(np.arange(4000) / 30)
    still, moving = changing(4000), changing(4000, truth=truth)
    np.testing.assert_allclose(
        waegli_guerrier(moving, PARAMETERS).rate - truth, waegli_guerrier(still, PARAMETERS).rate, atol=1e-6
    )


def test_better_than_the_average_where_the_noise_changes(changing):
    # Expected: simulated truth: inverse variances beat equal weights where the variances differ, if they are known.
    array = changing(30_000, seed=9)
    biases = array.rate.mean(axis=0)
    centred = replace(array, rate=array.rate - biases)
    assert waegli_guerrier(centred, PARAMETERS).rate.std() < 0.97 * centred.rate.mean(axis=1).std()


def test_both_engines(changing):
    array = changing(1200, gyros=3)
    native, reference = (waegli_guerrier(array, FilterParameters(engine=name)).rate for name in ("native", "reference"))
    np.testing.assert_allclose(native, reference, atol=2e-3)


def test_the_fit_is_of_the_longest_stretch(changing, monkeypatch):
    # At most so many samples of it: what follows changes no model.
    monkeypatch.setattr("vgyro.fusion.papers.waegli_guerrier.LONGEST_FIT", 500)
    array = changing(1000, segment=np.repeat([0, 1], [200, 800]))
    rate = array.rate.copy()
    rate[:200] *= 3
    rate[700:] *= 5
    assert fit_residuals(array, "native") == fit_residuals(replace(array, rate=rate), "native")
    weights = residual_weights(array, fit_residuals(array, "native"), "native")
    np.testing.assert_allclose(np.concatenate(list(weights.pieces())).sum(axis=1), 1, atol=1e-12)


def test_reasons(changing):
    short = changing(60, segment=np.arange(60) // 10)
    with pytest.raises(CannotRun, match="no stretch of 20 samples"):
        waegli_guerrier(short, PARAMETERS)
    array = changing(60)
    with pytest.raises(CannotRun, match="residual of gyro 1: no variance"):
        waegli_guerrier(replace(array, rate=np.repeat(array.rate[:, :1], 4, axis=1)), PARAMETERS)


@pytest.mark.parametrize(("samples", "why"), [(19, "no stretch of 20 samples"), (20, "residual of gyro 1: too short")])
def test_twenty_samples_without_a_gap(make_array, samples, why):
    # From 20 samples on there is an ARMA model; GARCH needs more.
    segment = np.arange(3 * samples, dtype=np.int32) // samples
    with pytest.raises(CannotRun, match=why):
        fit_residuals(make_array(3 * samples, [0.1, 0.1, 0.1], segment=segment), "native")


def test_a_fit_that_failed_is_a_constant_variance():
    # Rule: the mean square of the innovations, whatever the failed fit holds.
    values = np.array([[7.0]])
    found = SimpleNamespace(status=np.array([[garch_code(FAILED)]]), omega=values, alpha=values, beta=values)
    run = SimpleNamespace(kalman=engine.get("native").kalman, garch=SimpleNamespace(fit_garch_windows=lambda _: found))
    model = _model(np.random.default_rng(1).standard_normal(2000), 0, run)
    assert (model.alpha, model.beta) == (0.0, 0.0)
    assert model.omega == model.mean_square == pytest.approx(1.0, rel=0.1)
    found.status[0, 0] = garch_code(CONVERGED)
    assert _model(np.random.default_rng(1).standard_normal(2000), 0, run).alpha == 7.0


def test_a_million_samples_are_enough(monkeypatch, make_array):
    # Rule: the first million samples of the longest stretch.
    asked = []
    monkeypatch.setattr("vgyro.fusion.papers.waegli_guerrier._model", lambda v, *_: asked.append(len(v)))
    for samples, fitted in ((1_200_000, 1_000_000), (900_000, 900_000)):
        fit_residuals(make_array(samples, [0.1, 0.1]), "native")
        assert asked[-2:] == [fitted, fitted]

"""Minimum-variance weights."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from vgyro.engine import ENGINES
from vgyro.engine.independent import nnls_weights
from vgyro.errors import DataError, EngineError
from vgyro.fusion import min_variance_weights, usable


def covariances(count, size, rho, spread, seed=0):
    """Random covariance matrices: common correlation on top of a Wishart draw, log-normal variances."""
    rng = np.random.default_rng(seed)
    draw = rng.standard_normal((count, size, size + 3))
    covariance = draw @ draw.transpose(0, 2, 1)
    scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    correlation = (1 - rho) * covariance / (scale[:, :, None] * scale[:, None, :]) + rho
    sigma = np.exp(spread * rng.standard_normal((count, size)))
    return correlation * sigma[:, :, None] * sigma[:, None, :]


def variance(H, w):
    return np.einsum("...i,...ij,...j->...", w, H, w)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("rho", "spread"), [(0.0, 0.1), (0.1, 0.3), (0.5, 1.0), (0.9, 3.0)])
def test_against_nnls(rho, spread, engine):
    # Expected: scipy.optimize.nnls on the equivalent least-squares problem.
    H = covariances(200, 6, rho, spread)
    w = min_variance_weights(H, engine)
    np.testing.assert_allclose(w, [nnls_weights(matrix) for matrix in H], atol=1e-12)


def test_against_a_general_optimiser():
    # Expected: scipy.optimize.minimize (SLSQP); the variance, not w, because SLSQP ends early along flat directions.
    for H in covariances(10, 5, 0.4, 0.7):
        found = minimize(
            lambda w, H=H: w @ H @ w, np.full(5, 0.2), jac=lambda w, H=H: 2 * H @ w, method="SLSQP",
            bounds=[(0, 1)] * 5, constraints={"type": "eq", "fun": lambda w: w.sum() - 1}, options={"ftol": 1e-14},
        )  # fmt: skip
        w = min_variance_weights(H)
        assert variance(H, w) <= found.fun * (1 + 1e-9)
        np.testing.assert_allclose(w, found.x, atol=1e-4)


@given(
    first=st.floats(1e-4, 1e4), second=st.floats(1e-4, 1e4), correlation=st.floats(-0.99, 0.99)
)  # fmt: skip
@settings(max_examples=50, deadline=None)
def test_two_gyros_closed_form(first, second, correlation):
    # Expected: w_1 = (h_22 - h_12)/(h_11 + h_22 - 2 h_12), clipped to 0..1.
    cross = correlation * first * second
    H = np.array([[first**2, cross], [cross, second**2]])
    expected = np.clip((H[1, 1] - cross) / (H[0, 0] + H[1, 1] - 2 * cross), 0, 1)
    np.testing.assert_allclose(min_variance_weights(H), [expected, 1 - expected], atol=1e-10)


@pytest.mark.parametrize("engine", ENGINES)
def test_kkt_conditions_hold(engine):
    # Expected: H w = λ on the support, H w >= λ off it, λ = w'Hw.
    H = covariances(500, 6, 0.5, 1.0, seed=3)
    w = min_variance_weights(H, engine)
    gradient, level = np.einsum("kij,kj->ki", H, w), variance(H, w)[:, None]
    assert (w >= 0).all()
    np.testing.assert_allclose(w.sum(axis=1), 1.0, atol=1e-14)
    assert (w == 0).any(axis=1).mean() > 0.5, "the test needs problems with an active bound"
    np.testing.assert_allclose(np.where(w > 0, gradient / level, 1.0), 1.0, atol=1e-11)
    assert (np.where(w == 0, gradient / level, 1.0) >= 1 - 1e-11).all()


def test_common_variance_changes_no_weight():
    # Expected: w'(H + c11')w = w'Hw + c for Σw = 1.
    H = covariances(50, 6, 0.2, 0.5)
    np.testing.assert_allclose(min_variance_weights(H + 0.7), min_variance_weights(H), atol=1e-11)


def test_order_of_the_gyros_does_not_matter():
    H = covariances(50, 6, 0.5, 1.0)
    order = np.array([3, 0, 5, 1, 4, 2])
    permuted = H[:, order][:, :, order]
    np.testing.assert_allclose(min_variance_weights(permuted), min_variance_weights(H)[:, order], atol=1e-12)


def test_unit_does_not_matter():
    H = covariances(50, 6, 0.5, 1.0)
    np.testing.assert_allclose(min_variance_weights(H * 1e-12), min_variance_weights(H), atol=1e-12)


def test_shapes():
    H = covariances(6, 3, 0.1, 0.3)
    w = min_variance_weights(H)
    np.testing.assert_array_equal(min_variance_weights(H.reshape(2, 3, 3, 3)), w.reshape(2, 3, 3))
    np.testing.assert_array_equal(min_variance_weights(H[0]), w[0])
    np.testing.assert_array_equal(min_variance_weights(np.array([[4.0]])), [1.0])
    assert min_variance_weights(np.empty((0, 3, 3))).shape == (0, 3)


def test_gyro_with_far_too_much_noise():
    # Expected: it has no weight; the others share as if it were not there.
    H = np.diag([1.0, 1.0, 1e10])
    np.testing.assert_allclose(min_variance_weights(H), [0.5, 0.5, 5e-11], atol=1e-13)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_not_finite_names_the_index(bad, engine):
    H = np.broadcast_to(np.eye(3), (4, 2, 3, 3)).copy()
    H[2, 1, 0, 0] = bad
    with pytest.raises(EngineError, match=r"H\[2, 1\].*not finite"):
        min_variance_weights(H, engine)


@pytest.mark.parametrize(
    "matrix", [[[1, 2], [2, 1]], [[1, 1], [1, 1]], [[0, 0], [0, 1]], [[-1, 0], [0, -1]], [[1, 0.5], [0.2, 1]]]
)  # fmt: skip
@pytest.mark.parametrize("engine", ENGINES)
def test_not_positive_definite_names_the_index(matrix, engine):
    H = np.stack([np.eye(2), np.array(matrix, dtype=float)])
    assert usable(H).tolist() == [True, False]
    with pytest.raises(EngineError, match=r"H\[1\]"):
        min_variance_weights(H, engine)


def test_wrong_shape_and_unknown_engine():
    with pytest.raises(DataError, match=r"\(3,\)"):
        min_variance_weights(np.ones(3))
    with pytest.raises(EngineError, match="reference"):
        min_variance_weights(np.eye(2), engine="abacus")


def test_nnls_route_closed_form():
    # Expected: uncorrelated gyros weigh as 1/h.
    np.testing.assert_allclose(nnls_weights(np.diag([1.0, 2.0, 4.0])), np.array([4, 2, 1]) / 7, atol=1e-14)

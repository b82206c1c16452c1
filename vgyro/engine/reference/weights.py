"""Minimum-variance weights by cvxpy, with the last digits by the active set."""

from __future__ import annotations

import warnings

import numpy as np

from vgyro.arrays import Floats
from vgyro.engine.covariance import conditional_covariance, usable
from vgyro.engine.models import ConditionalWeights, DccModel

# One cvxpy problem holds this many small ones side by side, as the blocks of one quadratic form.
BATCH = 2000
# A weight below this share of the largest one is taken as zero when the support is read off the solver's answer.
SUPPORT = 1e-5
# Violation of the KKT conditions that is still rounding, in units of the smallest variance.
KKT = 1e-11


def min_variance_weights(H: np.ndarray) -> np.ndarray:
    """As vgyro.engine.protocols.volatility.WeightsEngine.min_variance_weights; of any number of gyros.

    Where H⁻¹1 has no negative element it is the answer already, by its KKT conditions; the rest goes to cvxpy
    (Clarabel). Then the equality system is solved on the support, so that the weights are exact to rounding, and the
    KKT conditions are checked; a support that fails them is mended by single exchanges.
    """
    good = usable(H)
    weights = np.full(H.shape[:2], np.nan)
    symmetric = (H[good] + H[good].transpose(0, 2, 1)) / 2
    # The optimum is at most the smallest variance: with that as the unit every figure that matters is of order one,
    # however noisy the worst gyro is.
    scaled = symmetric / np.diagonal(symmetric, axis1=1, axis2=2).min(axis=1)[:, None, None]
    found = _on_support(scaled, np.ones(scaled.shape[:2], dtype=bool))
    open_ones = np.flatnonzero((found < 0).any(axis=1))
    for start in range(0, len(open_ones), BATCH):
        chosen = open_ones[start : start + BATCH]
        found[chosen] = _polish(scaled[chosen], _solve(scaled[chosen]))
    weights[good] = found
    return weights


def conditional_weights(
    r: np.ndarray,
    inside: int,
    omega: np.ndarray,
    alpha: np.ndarray,
    beta: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    target: np.ndarray,
    begin: int,
    end: int,
) -> ConditionalWeights:
    """As vgyro.engine.protocols.volatility.WeightsEngine.conditional_weights, one window at a time.

    H_t comes from SciPy's filters, the weights from cvxpy.
    """
    count, _, n = r.shape
    weights = np.empty((count, end - begin, n))
    deviation, sigma = np.empty_like(weights), np.empty(weights.shape[:2])
    good = np.empty(weights.shape[:2], dtype=bool)
    for k in range(count):
        model = DccModel(omega[k], alpha[k], beta[k], float(a[k]), float(b[k]), target[k])
        H = conditional_covariance(r[k], inside, model)[begin:end]
        weights[k] = min_variance_weights(H)
        good[k] = ~np.isnan(weights[k]).any(axis=1)
        weights[k, ~good[k]] = 1.0 / n
        deviation[k] = np.sqrt(np.diagonal(H, axis1=1, axis2=2))
        sigma[k] = np.sqrt(np.einsum("ti,tij,tj->t", weights[k], H, weights[k]))
    return ConditionalWeights(weights, deviation, sigma, good)


def _solve(H: np.ndarray) -> np.ndarray:
    """The solver's weights [M, N] of M problems in one; equal ones, from which the polish starts, where it gives up."""
    import cvxpy as cp
    from scipy import sparse

    count, size = H.shape[:2]
    block = np.repeat(np.arange(count), size * size) * size
    row = block + np.tile(np.repeat(np.arange(size), size), count)
    column = block + np.tile(np.tile(np.arange(size), size), count)
    quadratic = sparse.csc_matrix((H.ravel(), (row, column)), shape=(count * size, count * size))
    sums = sparse.kron(sparse.identity(count), np.ones((1, size)), format="csc")
    w = cp.Variable(count * size, nonneg=True)
    problem = cp.Problem(cp.Minimize(cp.quad_form(w, quadratic, assume_PSD=True)), [sums @ w == 1])
    # The accuracy of the sum of all problems is not that of each: the polish, not the tolerance, makes them exact.
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")
            problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10)
    except cp.SolverError:
        return np.full((count, size), 1.0 / size)
    return np.full((count, size), 1.0 / size) if w.value is None else w.value.reshape(count, size)


def _polish(H: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Exact weights [M, N] from approximate ones: solve on the support, exchange one gyro at a time until KKT holds."""
    support = start > SUPPORT * start.max(axis=1, keepdims=True)
    weights = _on_support(H, support)
    for _ in range(8 * H.shape[1]):
        gain = np.where(support, 0.0, _violation(H, weights))
        lowest, highest = weights.min(axis=1), gain.max(axis=1)
        wrong = np.flatnonzero((lowest < 0) | (highest > KKT))
        if len(wrong) == 0:
            return weights
        drop = lowest[wrong] < 0
        which = np.where(drop, weights[wrong].argmin(axis=1), gain[wrong].argmax(axis=1))
        support[wrong, which] = ~drop
        weights[wrong] = _on_support(H[wrong], support[wrong])
    weights[wrong] = np.array([_lawson_hanson(H[index]) for index in wrong])
    return weights


def _violation(H: Floats, weights: Floats) -> Floats:
    """Relative fall of the variance as a gyro's weight rises from zero [M, N]: > 0 breaks the KKT conditions."""
    gradient = np.einsum("kij,kj->ki", H, weights)
    variance = np.einsum("ki,ki->k", gradient, weights)
    violation: Floats = 1.0 - gradient / variance[:, None]
    return violation


def _on_support(H: np.ndarray, support: np.ndarray) -> np.ndarray:
    """Weights that solve H w = λ1 on the support, Σw = 1, and are zero off it."""
    both = support[:, :, None] & support[:, None, :]
    # Off the support the system reads w = 0, so that all matrices keep one shape.
    system = np.where(both, H, 0.0) + np.where(support, 0.0, 1.0)[:, :, None] * np.eye(H.shape[1])
    solution = np.linalg.solve(system, support[:, :, None].astype(float))[:, :, 0]
    weights = solution / solution.sum(axis=1, keepdims=True)
    # A second step with the residual takes away what rounding left in an ill-conditioned system.
    gradient = np.einsum("kij,kj->ki", H, weights)
    level = np.einsum("ki,ki->k", gradient, weights)
    residual = np.where(support, level[:, None] - gradient, 0.0)
    weights = weights + np.linalg.solve(system, residual[:, :, None])[:, :, 0]
    return np.where(support, weights / weights.sum(axis=1, keepdims=True), 0.0)


def _lawson_hanson(H: np.ndarray) -> np.ndarray:
    """One problem through non-negative least squares, for the rare support that exchanges do not settle."""
    from vgyro.engine.independent import nnls_weights

    return nnls_weights(H)

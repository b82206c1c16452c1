"""Minimum-variance weights of 6 gyros along a path of covariances, against daqp, quadprog and cvxpy."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version

import numpy as np

from benchmarks.contest import Accuracy, Contest, Rival, Side
from benchmarks.limits import arithmetic
from benchmarks.series import GYROS, covariance_path
from vgyro import engine

KKT_TOLERANCE = 1e-10
WEIGHT_TOLERANCE = 1e-8
# The active set is known from the sample before: a Cholesky factor of the free part, two substitutions, the check of
# the gradient H·w. For n = 6: n³/3 + 2·n²·2 + 2·n² + n.
FLOPS = GYROS**3 / 3 + 6 * GYROS**2 + GYROS
DIVISIONS = GYROS + 1


def contests(quick: bool) -> list[Contest]:
    """One contest along one path: each solver is warm-started from the sample before as far as it can be."""
    count = 20_000 if quick else 200_000
    H = covariance_path(count, seed=13)
    native = engine.get("native").weights
    parts = {"daqp": H[:2000], "quadprog": H[:2000], "cvxpy": H[: 20 if quick else 100]}
    solvers: dict[str, tuple[Callable[[np.ndarray], np.ndarray], float]] = {
        "daqp": (by_daqp, 40), "quadprog": (by_quadprog, 120), "cvxpy": (cvxpy_solver(), 10_000),
    }  # fmt: skip
    rivals = tuple(
        Rival(Side(f"{name} {version(name)}", _call(solve, parts[name]), len(parts[name])), target)
        for name, (solve, target) in solvers.items()
    )

    def accuracy() -> list[Accuracy]:
        w = native.min_variance_weights(H)
        bound = float(np.mean((w <= 0).any(axis=1)))
        figures = [
            Accuracy("KKT residual, ours", kkt_residual(H, w), KKT_TOLERANCE),
            Accuracy("share of problems without an active bound", 1 - bound, 0.9),
        ]
        for name, (solve, _) in solvers.items():
            distance = float(np.max(np.abs(solve(parts[name]) - w[: len(parts[name])])))
            limit = WEIGHT_TOLERANCE if name == "quadprog" else None
            figures.append(Accuracy(f"weights, largest difference to {name}", distance, limit))
        return figures

    limit = arithmetic(FLOPS, DIVISIONS, 8 * (GYROS * GYROS + GYROS))
    return [
        Contest(
            "weights", "QP, n = 6, warm", "QP", Side("vgyro", lambda: native.min_variance_weights(H), count), rivals,
            limit, accuracy,
            "the libraries get one problem at a time, as their interfaces want it; daqp and cvxpy are warm-started",
        )
    ]  # fmt: skip


def _call(solve: Callable[[np.ndarray], np.ndarray], H: np.ndarray) -> Callable[[], object]:
    return lambda: solve(H)


def kkt_residual(H: np.ndarray, w: np.ndarray) -> float:
    """Largest violation: H·w = λ where w > 0 and ≥ λ elsewhere, λ = w'Hw, relative to λ; Σw = 1; w ≥ 0."""
    gradient = np.einsum("kij,kj->ki", H, w)
    level = np.einsum("ki,ki->k", gradient, w)[:, None]
    stationary = np.where(w > 0, np.abs(gradient - level), np.maximum(level - gradient, 0)) / level
    return float(max(stationary.max(), np.abs(w.sum(axis=1) - 1).max(), -w.min()))


def by_daqp(H: np.ndarray) -> np.ndarray:
    """daqp with one workspace: set up once, then only H is updated; the active set of the last solve is its start."""
    import daqp

    n = H.shape[1]
    upper, lower = np.ones(n + 1), np.append(np.zeros(n), 1.0)
    sense = np.zeros(n + 1, dtype=np.int32)
    sense[n] = 5  # the sum is an equality
    model = daqp.Model()
    model.setup(H[0], np.zeros(n), np.ones((1, n)), upper, lower, sense)
    weights = np.empty(H.shape[:2])
    for k, matrix in enumerate(H):
        model.update(H=matrix)
        weights[k] = model.solve()[0]
    return weights


def by_quadprog(H: np.ndarray) -> np.ndarray:
    """quadprog (Goldfarb & Idnani), which has no warm start."""
    from quadprog import solve_qp

    n = H.shape[1]
    linear, bounds = np.zeros(n), np.append(1.0, np.zeros(n))
    constraints = np.column_stack([np.ones(n), np.eye(n)])
    return np.array([solve_qp(matrix, linear, constraints, bounds, 1)[0] for matrix in H])


def cvxpy_solver() -> Callable[[np.ndarray], np.ndarray]:
    """cvxpy as its manual advises for many alike problems: one parametrised (DPP) problem, compiled once, warm-started.

    OSQP, its default for quadratic programs, is given tolerances that make its weights comparable.
    """
    import cvxpy as cp

    w = cp.Variable(GYROS, nonneg=True)
    root = cp.Parameter((GYROS, GYROS))
    problem = cp.Problem(cp.Minimize(cp.sum_squares(root @ w)), [cp.sum(w) == 1])

    def solve(H: np.ndarray) -> np.ndarray:
        weights = np.empty(H.shape[:2])
        for k, matrix in enumerate(H):
            root.value = np.linalg.cholesky(matrix).T
            problem.solve(solver=cp.OSQP, warm_start=True, eps_abs=1e-6, eps_rel=1e-6)
            weights[k] = w.value
        return weights

    return solve

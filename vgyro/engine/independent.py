"""Second routes to results of this package, for the cross-check: slow and plain, written from the definitions."""

from __future__ import annotations

import numpy as np


def nnls_weights(H: np.ndarray) -> np.ndarray:
    """Minimum-variance weights as non-negative least squares.

    H       : array [N, N], symmetric, positive definite
    returns : w [N] of min w'Hw, Σw = 1, w ≥ 0
    With H = LL' the solution of min |L'w - L⁻¹1|, w ≥ 0, is the answer but for its scale, because w'Hw - 2·1'w + const
    is least along the ray of the constrained minimum. Solved by scipy.optimize.nnls.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    scaled = H / np.diag(H).min()
    root = np.linalg.cholesky(scaled)
    target = solve_triangular(root, np.ones(len(H)), lower=True)
    solution, _ = nnls(root.T, target)
    return solution / solution.sum()


def textbook_allan_deviation(rate: np.ndarray, rate_hz: float, tau: float, segment: np.ndarray | None = None) -> float:
    """Overlapping Allan deviation at one τ by its definition: half the mean square of differences of adjacent means.

    rate    : array [T], deg/s;  tau : s, a whole number of samples;  segment : array [T]; no mean crosses a border
    returns : deg/s; NaN where no stretch holds two means
    IEEE Std 952, eq. for the Allan variance; every pair of adjacent means of τ, one pair a sample.
    """
    length = round(tau * rate_hz)
    marks = np.zeros(len(rate), dtype=int) if segment is None else np.asarray(segment)
    total, pairs = 0.0, 0
    for mark in np.unique(marks):
        stretch = rate[marks == mark]
        for start in range(len(stretch) - 2 * length + 1):
            first = stretch[start : start + length].mean()
            second = stretch[start + length : start + 2 * length].mean()
            total += (second - first) ** 2
            pairs += 1
    return float(np.sqrt(total / (2 * pairs))) if pairs else float("nan")

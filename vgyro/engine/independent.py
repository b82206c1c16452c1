"""Second routes to results of this package, for the cross-check: plain, written from the definitions."""

from __future__ import annotations

import itertools

import numpy as np

from vgyro.arrays import Floats

PIECE = 1 << 20


def nnls_weights(H: Floats) -> Floats:
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
    weights: Floats = solution / solution.sum()
    return weights


def textbook_allan_deviation(rate: np.ndarray, rate_hz: float, tau: float, segment: np.ndarray | None = None) -> float:
    """Overlapping Allan deviation at one τ by its definition: half the mean square of differences of adjacent means.

    rate    : array [T], deg/s;  tau : s, a whole number of samples
    segment : array [T]; no mean crosses a border, and a stretch shorter than 3τ is left out
    returns : deg/s; NaN where no stretch is long enough
    IEEE Std 952 defines it by means of the rate, not by the angle; the means are running sums in extended precision.
    """
    length = round(tau * rate_hz)
    borders = [] if segment is None else (np.flatnonzero(segment[1:] != segment[:-1]) + 1).tolist()
    total, pairs = 0.0, 0
    for start, stop in itertools.pairwise([0, *borders, len(rate)]):
        if stop - start < 3 * length:
            continue
        running = _running_sum(rate[start:stop])
        count = stop - start - 2 * length + 1
        for first in range(0, count, PIECE):
            last = min(first + PIECE, count)
            before, middle, after = (running[first + shift : last + shift] for shift in (0, length, 2 * length))
            step = ((after - middle) - (middle - before)).astype(float) / length
            total += float(np.sum(step**2))
        pairs += count
    return float(np.sqrt(total / (2 * pairs))) if pairs else float("nan")


def _running_sum(rate: np.ndarray) -> np.ndarray:
    """0 and the running sums of rate [T] less its mean, [T + 1], in extended precision; made in pieces, to be lean."""
    mean, running = rate.mean(), np.zeros(len(rate) + 1, dtype=np.longdouble)
    for first in range(0, len(rate), PIECE):
        piece = rate[first : first + PIECE] - mean
        running[first + 1 : first + 1 + len(piece)] = running[first] + np.cumsum(piece, dtype=np.longdouble)
    return running


def printed_filter(rate: np.ndarray, rate_hz: float, R: np.ndarray, q: float, tau: float) -> np.ndarray:
    """Steady-state filter of Jiang et al. (2012), eq. 11-14, run by filterpy sample by sample.

    rate : array [T, N], deg/s, one gap-free stretch;  R : [N, N], (deg/s)²/Hz;  q : deg²/s³;  tau : s, inf: random walk
    returns : [T], the estimate that each sample yields, deg/s
    filterpy's steps are x ← Fx, x ← x + K(z - 1x). With g = (1 - e^(-sT))·K∞/s their F is e^(-sT)/(1 - g1) and their K
    is g.
    """
    from vgyro.engine.reference.kalman import constant_gain_filter

    one = np.ones(len(R))
    inverse = np.linalg.inv(R)
    D = one @ inverse @ one
    s = np.sqrt(1.0 / tau**2 + D * q)
    steady = (s - 1.0 / tau) / D * (one @ inverse)
    keep = np.exp(-s / rate_hz)
    gain = (1.0 - keep) / s * steady
    return constant_gain_filter(rate, keep / (1.0 - gain.sum()), gain, float(rate[0] @ steady / steady.sum()))

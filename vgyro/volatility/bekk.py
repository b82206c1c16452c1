"""BEKK(1,1) of an array of gyros: the covariance of the rates modelled at once, an alternative to DCC."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from vgyro.arrays import Floats
from vgyro.engine.models import (
    A_ZERO,
    B_ZERO,
    CONVERGED,
    FAILED,
    NO_VARIANCE,
    NOT_POSITIVE_DEFINITE,
    OUTLIER_DOMINATED,
    TOO_SHORT,
)
from vgyro.engine.status import (
    ALPHA_NEAR_ZERO,
    BETA_NEAR_ZERO,
    FLAT,
    GAIN,
    MIN_SAMPLES,
    PERSISTENCE_NEAR_ONE,
    outlier_dominated,
)

Kind = Literal["scalar", "diagonal"]
Constant = Literal["auto", "likelihood", "targeting"]

PERSISTENCE_ONE = "boundary: a² + b² = 1"
MOST_FREE = 6
"""Gyros up to which the constant matrix is fitted by likelihood."""
LOWEST, HIGHEST = 1e-6, 1 - 1e-6
"""Bounds of a² + b² in a fit."""
SMALLEST_EIGENVALUE = 1e-8
GRID_PERSISTENCE = (0.1, 0.4, 0.7, 0.9, 0.97, 0.995)
GRID_SHARE = (0.02, 0.06, 0.15, 0.35, 0.7)
"""a² / (a² + b²) of the starts."""
FAST = 0.8
TREND, TREND_LEVELS = (0.99, 0.01), (0.6, 1.7)
OPTIONS = {"ftol": 1e-10, "gtol": 1e-7, "maxiter": 1000, "maxcor": 60}


@dataclass(frozen=True)
class BekkFit:
    """BEKK(1,1) of N gyros: H_t = Ω + A r_{t-1}r'_{t-1}A + B H_{t-1}B with diagonal A and B.

    constant       : [N, N] Ω = CC', (deg/s)²
    a, b           : [N], the diagonals of A and B; of the scalar kind each holds one number N times
    log_likelihood : Gaussian, with its constant: -½Σ(N log 2π + log|H| + r'H⁻¹r), r in deg/s
    covariance     : [T, N, N] H_t, (deg/s)²
    parameters     : how many were fitted, the N(N+1)/2 of Ω among them
    targeted       : Ω was not fitted but taken from the second moment
    status         : converged, boundary: …, outlier-dominated; else all is NaN: no variance, too short, not positive
                     definite, failed
    """

    kind: Kind
    constant: np.ndarray
    a: np.ndarray
    b: np.ndarray
    log_likelihood: float
    covariance: np.ndarray
    parameters: int
    targeted: bool
    status: str


def fit_bekk(
    r: np.ndarray, kind: Kind = "scalar", constant: Constant = "auto", scalar: BekkFit | None = None
) -> BekkFit:
    """Fit H_t = CC' + A r_{t-1}r'_{t-1}A + B H_{t-1}B by Gaussian quasi maximum likelihood.

    r        : [T, N] deg/s, one gyro a column; the model's mean is zero
    kind     : scalar, A = aI and B = bI; diagonal, one a and one b a gyro
    constant : of Ω = CC': `likelihood`, fitted; `targeting`, Ω_ij = S_ij·√((1 - a_i² - b_i²)(1 - a_j² - b_j²)) with S
               the second moment r'r/T, so that the variances of the model are those of the data (of the scalar kind the
               covariances, too), and Ω is positive definite for every a and b; `auto`, likelihood up to 6 gyros
    scalar   : fit of the scalar kind to the same r, from which the diagonal kind starts; None: it is made here
    returns  : BekkFit; what cannot be fitted gets a status and NaN, never an exception
    raises   : TypeError if r is not [T, N]

    Conventions, as of GARCH and DCC: H_0 = r_0r_0' = S, so that H_1 = Ω + (aa' + bb')∘S; 1/T throughout; each gyro is
    divided by its own r.m.s. first; a_i² + b_i² < 1. With one gyro it is GARCH(1,1) with α = a², β = b². Several
    starts, none of which depends on another window; the diagonal kind starts at the optimum of the scalar one. Where
    the best point gains less than 1e-6 a sample over the constant covariance S, that is the answer: Ω = S, a = b = 0,
    status `boundary: a = 0`; the other boundaries are reached where any gyro's a and b lie there.
    The gradient is exact: the slopes of H_t are filtered backward as H_t is forward.
    Engle & Kroner (1995), Econometric Theory 11(1), 122-150, eq. 2.2 with K = 1; Liu et al. (2015) name it beside DCC.
    """
    r = np.asarray(r, dtype=float)
    if r.ndim != 2:
        raise TypeError(f"r has {r.ndim} dimensions; expected [T, N]")
    n = r.shape[1]
    free = constant == "likelihood" or (constant == "auto" and n <= MOST_FREE)
    parameters = n * (n + 1) // 2 + (2 if kind == "scalar" else 2 * n)
    why = _unfit(r)
    if why:
        none, nothing = np.full(n, np.nan), np.full((len(r), n, n), np.nan)
        return BekkFit(kind, np.full((n, n), np.nan), none, none, math.nan, nothing, parameters, not free, why)
    scale = np.sqrt(np.mean(np.square(r), axis=0))
    model = _Likelihood(r / scale)
    root = np.linalg.cholesky(model.moment)
    known = scalar is not None and scalar.a.any()
    best = _point_of(scalar, scale) if scalar is not None and known else _scalar_optimum(model, root, free)
    if kind == "diagonal":
        best = min((best, _descend(model, best, _Coordinates(n, free, root))), key=model.cost)
    point, status = _or_nothing(model, best, root)
    units = np.outer(scale, scale)
    covariance = model.covariance(point) * units
    likelihood = -len(r) * (model.cost(point) + float(np.log(scale).sum()))
    if status == CONVERGED:
        status = _status(point.a, point.b, r)
    return BekkFit(
        kind, point.constant * units, point.a, point.b, likelihood, covariance, parameters, not free, status
    )  # fmt: skip


def bekk_covariance(
    r: np.ndarray, constant: np.ndarray, a: np.ndarray, b: np.ndarray, start: np.ndarray | None = None
) -> np.ndarray:
    """H_t of given parameters.

    r        : [T, N] deg/s;  constant : [N, N] Ω, (deg/s)²;  a, b : [N]
    start    : [N, N] H of the first sample; None: Ω + (aa' + bb')∘S with S = r'r/T
    returns  : [T, N, N] (deg/s)²
    """
    rows, columns = np.triu_indices(r.shape[1])
    if start is None:
        start = constant + (np.outer(a, a) + np.outer(b, b)) * (r.T @ r / len(r))
    driven = np.empty((len(r), len(rows)))
    driven[0] = start[rows, columns]
    driven[1:] = constant[rows, columns] + (a[rows] * a[columns]) * (r[:-1, rows] * r[:-1, columns])
    return _full(_filtered(driven, b[rows] * b[columns]), r.shape[1])


def bekk_log_likelihood(r: np.ndarray, covariance: np.ndarray) -> float:
    """Gaussian log-likelihood -½Σ(N log 2π + log|H| + r'H⁻¹r) of r [T, N] with covariances [T, N, N]."""
    lower = np.linalg.cholesky(covariance)
    white = np.linalg.solve(lower, r[..., None])[..., 0]
    log_det = 2 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum()
    return -0.5 * float(r.size * math.log(2 * math.pi) + log_det + np.square(white).sum())


class _Slopes(NamedTuple):
    """Cost, and its slopes in Ω [N, N], a [N] and b [N], Ω held fixed for the last two."""

    cost: float
    constant: np.ndarray
    a: np.ndarray
    b: np.ndarray


@dataclass(frozen=True)
class _Point:
    """Parameters, in units of each gyro's r.m.s.: Ω = DLL'D with D = diag √(1 - a² - b²).

    root : [N, N] L, lower triangular
    """

    root: np.ndarray
    a: np.ndarray
    b: np.ndarray

    @property
    def shrink(self) -> Floats:
        shrink: Floats = np.sqrt(np.maximum(1 - self.a**2 - self.b**2, 0.0))
        return shrink

    @property
    def constant(self) -> Floats:
        constant: Floats = np.outer(self.shrink, self.shrink) * (self.root @ self.root.T)
        return constant


class _Likelihood:
    """Minus the log-likelihood a sample of e [T, N], whose mean squares are 1, and its slopes."""

    def __init__(self, e: np.ndarray) -> None:
        self.e = e
        self.moment = e.T @ e / len(e)
        self.rows, self.columns = np.triu_indices(e.shape[1])
        self._products = np.vstack([self._packed(self.moment), e[:-1, self.rows] * e[:-1, self.columns]])

    def covariance(self, point: _Point) -> np.ndarray:
        return _full(self._path(point), self.e.shape[1])

    def cost(self, point: _Point) -> float:
        return -bekk_log_likelihood(self.e, self.covariance(point)) / len(self.e)

    def slopes(self, point: _Point) -> _Slopes:
        """The cost and its slopes."""
        samples, n = self.e.shape
        path = self._path(point)
        H = _full(path, n)
        inverse = np.linalg.inv(H)
        u = (inverse @ self.e[..., None])[..., 0]
        log_det = 2 * np.log(np.diagonal(np.linalg.cholesky(H), axis1=1, axis2=2)).sum()
        cost = 0.5 * (n * math.log(2 * math.pi) + (log_det + float(np.sum(u * self.e))) / samples)
        own = (inverse[:, self.rows, self.columns] - u[:, self.rows] * u[:, self.columns]) * (0.5 / samples)
        decay = point.b[self.rows] * point.b[self.columns]
        felt = _filtered(own[::-1], decay)[::-1]
        before = np.vstack([self._packed(self.moment), path[:-1]])
        by_a, by_b = (
            2 * _symmetric((felt * values).sum(axis=0), n) @ weight
            for values, weight in ((self._products, point.a), (before, point.b))
        )
        return _Slopes(cost, _symmetric(felt.sum(axis=0), n), by_a, by_b)

    def _path(self, point: _Point) -> np.ndarray:
        """H_t above and on the diagonal, [T, N(N+1)/2]."""
        a, b = (one[self.rows] * one[self.columns] for one in (point.a, point.b))
        driven = self._packed(point.constant) + a * self._products
        driven[0] += b * self._packed(self.moment)
        return _filtered(driven, b)

    def _packed(self, matrix: np.ndarray) -> np.ndarray:
        return matrix[self.rows, self.columns]


@dataclass(frozen=True)
class _Coordinates:
    """Unbounded coordinates of a point: log(p/(1 - p)) of p = a² + b², the angle of (b, a), and L where it is free.

    count : how many a there are, 1 or N;  root : L where it is not free
    """

    count: int
    free: bool
    root: np.ndarray

    def of(self, point: _Point) -> np.ndarray:
        a, b = point.a[: self.count], point.b[: self.count]
        p = np.clip(a**2 + b**2, LOWEST, HIGHEST)
        parts = [np.log(p / (1 - p)), np.arctan2(a, b)]
        if self.free:
            parts.append(point.root[self._triangle])
        return np.concatenate(parts)

    def point(self, x: np.ndarray) -> _Point:
        size, root = self._size(x), self.root
        angle = x[self.count : 2 * self.count]
        if self.free:
            root = np.zeros_like(self.root)
            root[self._triangle] = x[2 * self.count :]
        ones = np.ones(len(root))
        return _Point(root, size * np.sin(angle) * ones, size * np.cos(angle) * ones)

    def cost(self, x: np.ndarray, model: _Likelihood) -> tuple[float, np.ndarray]:
        """Cost at x and its gradient there."""
        point = self.point(x)
        cost, by_constant, by_a, by_b = model.slopes(point)
        shrink = point.shrink
        square = point.root @ point.root.T
        # Ω moves with a and b through D = √(1 - p).
        by_p = -((by_constant * square) @ shrink) / shrink
        size = np.sqrt(point.a**2 + point.b**2)
        by_p += (by_a * point.a + by_b * point.b) / (2 * size**2)
        p = size**2
        by_logit = by_p * p * (1 - p)
        by_angle = by_a * point.b - by_b * point.a
        if self.count == 1:
            by_logit, by_angle = by_logit.sum(keepdims=True), by_angle.sum(keepdims=True)
        parts = [by_logit, by_angle]
        if self.free:
            by_root = 2 * (by_constant * np.outer(shrink, shrink)) @ point.root
            parts.append(by_root[self._triangle])
        return cost, np.concatenate(parts)

    @property
    def bounds(self) -> list[tuple[float | None, float | None]]:
        edge = math.log(HIGHEST / (1 - HIGHEST))
        rest = len(self._triangle[0]) if self.free else 0
        return [(-edge, edge)] * self.count + [(None, None)] * (self.count + rest)

    @property
    def _triangle(self) -> tuple[np.ndarray, np.ndarray]:
        return np.tril_indices(len(self.root))

    def _size(self, x: Floats) -> Floats:
        return np.sqrt(1 / (1 + np.exp(-x[: self.count])))


def _scalar_optimum(model: _Likelihood, root: np.ndarray, free: bool) -> _Point:
    """The best point of the scalar kind that is found, with L free or root."""
    found = [_descend(model, start, _Coordinates(1, False, root)) for start in _starts(model, root)]
    if free:
        found = [_descend(model, start, _Coordinates(1, True, root)) for start in [*found, *_trends(root)]]
    return min(found, key=model.cost)


def _or_nothing(model: _Likelihood, best: _Point, root: np.ndarray) -> tuple[_Point, str]:
    """The point, or that of the constant covariance S where it gains nothing over it; and CONVERGED, A_ZERO, FAILED."""
    nothing = _Point(root, np.zeros(len(root)), np.zeros(len(root)))
    cost = model.cost(best)
    if not math.isfinite(cost):
        return nothing, FAILED
    return (best, CONVERGED) if cost < model.cost(nothing) - GAIN else (nothing, A_ZERO)


def _point_of(fit: BekkFit, scale: np.ndarray) -> _Point:
    """The point of a fit to r, of r/scale."""
    shrink = np.sqrt(1 - fit.a**2 - fit.b**2)
    return _Point(np.linalg.cholesky(fit.constant / np.outer(shrink * scale, shrink * scale)), fit.a, fit.b)


def _starts(model: _Likelihood, root: np.ndarray) -> list[_Point]:
    """The best points of a grid, one of slow and one of fast changes."""
    ones = np.ones(len(root))
    starts = []
    for slow in (True, False):
        points = [
            _Point(root, math.sqrt(p * share) * ones, math.sqrt(p * (1 - share)) * ones)
            for p in GRID_PERSISTENCE
            for share in GRID_SHARE
            if (p > FAST) == slow
        ]
        starts.append(min(points, key=model.cost))
    return starts


def _trends(root: np.ndarray) -> list[_Point]:
    """Covariances that go from S to a multiple of it, hardly moved by the rates."""
    ones = np.ones(len(root))
    p, share = TREND
    a, b = math.sqrt(p * share) * ones, math.sqrt(p * (1 - share)) * ones
    return [_Point(root * math.sqrt(level), a, b) for level in TREND_LEVELS]


def _descend(model: _Likelihood, start: _Point, coordinates: _Coordinates) -> _Point:
    from scipy.optimize import minimize

    found = minimize(
        coordinates.cost, coordinates.of(start), args=(model,), jac=True, method="L-BFGS-B", bounds=coordinates.bounds,
        options=OPTIONS,
    )  # fmt: skip
    return coordinates.point(found.x)


def _unfit(r: np.ndarray) -> str:
    """Why these series cannot be fitted; "" if they can."""
    if len(r) < max(MIN_SAMPLES, r.shape[1] + 1) or r.shape[1] == 0:
        return TOO_SHORT
    if not np.isfinite(r).all():
        return FAILED
    if (np.ptp(r, axis=0) <= FLAT * np.max(np.abs(r), axis=0)).any():
        return NO_VARIANCE
    scaled = r / np.sqrt(np.mean(np.square(r), axis=0))
    smallest = np.linalg.eigvalsh(scaled.T @ scaled / len(r))[0]
    return NOT_POSITIVE_DEFINITE if smallest < SMALLEST_EIGENVALUE else ""


def _status(a: np.ndarray, b: np.ndarray, r: np.ndarray) -> str:
    """What an optimum is: the boundary that any gyro's parameters lie on."""
    if outlier_dominated(r).any():
        return OUTLIER_DOMINATED
    if (a**2 < ALPHA_NEAR_ZERO).any():
        return A_ZERO
    if (a**2 + b**2 >= PERSISTENCE_NEAR_ONE).any():
        return PERSISTENCE_ONE
    return B_ZERO if (b**2 < BETA_NEAR_ZERO).any() else CONVERGED


def _filtered(driven: Floats, decay: Floats) -> Floats:
    """y_t = x_t + decay·y_{t-1} of each column of x [T, M]; decay [M]."""
    from scipy.signal import lfilter

    if (decay == decay[0]).all():
        filtered: Floats = lfilter([1.0], [1.0, -decay[0]], driven, axis=0)
        return filtered
    columns = [lfilter([1.0], [1.0, -one], column) for one, column in zip(decay, driven.T, strict=True)]
    return np.stack(columns, axis=1)


def _full(packed: np.ndarray, n: int) -> np.ndarray:
    """[T, N(N+1)/2] → [T, N, N], symmetric."""
    rows, columns = np.triu_indices(n)
    place = np.empty((n, n), dtype=int)
    place[rows, columns] = place[columns, rows] = np.arange(len(rows))
    return packed[:, place]


def _symmetric(packed: Floats, n: int) -> Floats:
    full: Floats = _full(packed[None], n)[0]
    return full

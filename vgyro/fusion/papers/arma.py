"""ARMA(1,1) by conditional maximum likelihood."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

LowPass = Callable[[np.ndarray, float, float, float], np.ndarray]
"""(signal [T], keep, gain, start) → y_k = keep·y_{k-1} + gain·signal_k, as of an engine's kalman.low_pass"""

LARGEST = 1.0 - 1e-6
"""Largest |φ| and |θ|: the drift of a gyro is nearly a random walk in white noise, φ → 1 and θ → -1."""
NEAR_MINUS_ONE = np.geomspace(1.0 - LARGEST, 1.0, 13)
NEAR_ONE = np.geomspace(1e-2, 0.6, 4)
"""1 - |θ| of the values from which the search begins, θ < 0 and θ > 0."""
TOLERANCE = 1e-4
"""Of log(1 - |θ|)."""
FEWEST = 20


@dataclass(frozen=True)
class Arma:
    """v_t = constant + φ·v_{t-1} + e_t + θ·e_{t-1}; constant in the unit of v"""

    constant: float
    phi: float
    theta: float

    def innovations(self, v: np.ndarray, before: float, error: float, low_pass: LowPass) -> np.ndarray:
        """e_t [T] of v [T], which follows on the value `before` with the innovation `error`."""
        driven = v - self.constant
        driven[0] -= self.phi * before
        driven[1:] -= self.phi * v[:-1]
        return low_pass(driven, -self.theta, 1.0, error)


def fit_arma(v: np.ndarray, low_pass: LowPass) -> Arma:
    """The ARMA(1,1) of greatest likelihood, given the first value and e_1 = 0.

    v        : [T], T >= FEWEST
    low_pass : the recursion, of an engine
    returns  : Arma, |φ|, |θ| <= LARGEST. φ = θ = 0, white noise about its mean, where the two gain less than log T in
               log-likelihood (Schwarz' criterion): on the line φ = -θ every ARMA(1,1) is white noise
    Given θ the innovations are linear in φ and the constant, so that these follow by least squares; θ by a search in
    log(1 - |θ|) about the best of a grid. Conditional likelihood: Box & Jenkins (1970), chapter 7.
    """
    from scipy.optimize import minimize_scalar

    mean = float(v.mean())
    centred = v - mean
    grid = [(-1.0, math.log(away)) for away in NEAR_MINUS_ONE] + [(1.0, math.log(away)) for away in NEAR_ONE]
    costs = [_given(centred, _theta(*place), low_pass)[0] for place in grid]
    best = int(np.argmin(costs))
    sign, middle = grid[best]
    width = math.log(NEAR_MINUS_ONE[1] / NEAR_MINUS_ONE[0]) if sign < 0 else math.log(NEAR_ONE[1] / NEAR_ONE[0])
    found = minimize_scalar(
        lambda place: _given(centred, _theta(sign, place), low_pass)[0],
        bounds=(max(middle - width, math.log(1.0 - LARGEST)), min(middle + width, math.log(2.0))),
        method="bounded",
        options={"xatol": TOLERANCE},
    )
    place = float(found.x) if found.fun < costs[best] else middle
    theta = _theta(sign, place)
    cost, phi, constant = _given(centred, theta, low_pass)
    white = float(np.sum(centred[1:] ** 2))
    if cost <= 0 or 0.5 * len(v) * math.log(white / cost) < math.log(len(v)):
        return Arma(mean, 0.0, 0.0)
    return Arma(constant + mean * (1.0 - phi), phi, theta)


def _theta(sign: float, place: float) -> float:
    """θ at log(1 - |θ|); from 1 - |θ| = 1 to 2 it goes on to the other sign."""
    return min(max(sign * (1.0 - math.exp(place)), -LARGEST), LARGEST)


def _given(v: np.ndarray, theta: float, low_pass: LowPass) -> tuple[float, float, float]:
    """Σe², φ and the constant of least Σe², given θ."""
    now, before = low_pass(v[1:], -theta, 1.0, 0.0), low_pass(v[:-1], -theta, 1.0, 0.0)
    ones = low_pass(np.ones(len(v) - 1), -theta, 1.0, 0.0)
    square, across, level = _dot(before, before), _dot(before, ones), _dot(ones, ones)
    right = _dot(before, now), _dot(ones, now)
    determinant = square * level - across**2
    phi = 0.0 if determinant <= 0 else (right[0] * level - right[1] * across) / determinant
    phi = min(max(phi, -LARGEST), LARGEST)
    constant = (right[1] - phi * across) / level
    errors = now - phi * before - constant * ones
    return _dot(errors, errors), phi, constant


def _dot(a: np.ndarray, b: np.ndarray) -> float:
    # Not a BLAS product: its rounding depends on the number of threads.
    return float(np.sum(a * b))

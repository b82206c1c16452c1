"""Vaccaro & Zaki's virtual gyro: fixed weights of least drift, from the Allan covariances of a record at rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Bools, Floats
from vgyro.fusion.blocks import combined
from vgyro.fusion.rest_scales import rest_scales
from vgyro.fusion.types import AllanScales, ArrayRates, CannotRun, FilterParameters, Fused

SOURCE = "Vaccaro & Zaki (2017), Sensors 17, 352, eq. 23 and 43"
FOLLOWED = 0.05
"""No gyro follows the model more closely than this share of its Allan variance: τ of which very many pairs are known
count no more."""
INFERRED = (
    "the white noise of two gyros may be correlated; least squares weigh each Allan covariance by its own variance "
    f"under the fitted model, (C_ii·C_jj + C_ij²)·(1/pairs + {FOLLOWED:g}²), as if those of different τ were "
    "independent; Q is made positive semidefinite by leaving out the negative eigenvalues of its correlation matrix"
)
ROUNDS = 30
SETTLED = 1e-9
SMALLEST = 1e-12


@dataclass(frozen=True)
class AllanDrift:
    """Gyros with white noise and random walks: R [N, N], (deg/s)²/Hz; Q [N, N], (deg/s)²/s, positive semidefinite.

    rank : of Q, by what was left out to make it so
    """

    R: np.ndarray
    Q: np.ndarray
    rank: int


def vaccaro_zaki(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """The optimal linear combination for drift: c = Q⁻¹1/(1'Q⁻¹1), fixed.

    Q from the Allan covariances of a record at rest (drift_model). The drift of the combination is a random walk of
    variance 1/(1'Q⁻¹1) a second. No sign bound. A gyro whose covariances are not known, or zero, has the weight 0.
    raises : CannotRun if no record at rest is known, or no gyro has a random walk
    Vaccaro & Zaki (2017), Sensors 17(2), 352, eq. 43; a Kalman filter of all states tends to the same weights.
    """
    scales, origin = rest_scales(array, parameters)
    used = np.flatnonzero(known_gyros(scales))
    if len(used) < 2:
        raise CannotRun("the Allan covariances of fewer than two gyros are known")
    model = drift_model(AllanScales(scales.tau, scales.covariance[:, used[:, None], used], scales.pairs))
    weights = np.zeros(array.rate.shape[1])
    weights[used], drift = least_drift(model)
    notes = [
        f"drift of the combination {math.sqrt(drift):.3g} deg/s/√s",
        _rank(model),
        not_known(weights, used),
        origin,
    ]
    return Fused.undelayed(combined(array.rate, weights), weights, "; ".join(one for one in notes if one))


def known_gyros(scales: AllanScales) -> Bools:
    """bool [N]: gyros whose Allan covariances are known and whose variances are not zero."""
    variance = np.diagonal(scales.covariance, axis1=1, axis2=2)
    known: Bools = np.isfinite(variance).all(axis=0) & (variance > 0).all(axis=0)
    return known


def not_known(weights: np.ndarray, used: np.ndarray) -> str:
    """Which gyros are left out, from 1; empty if none is."""
    left = np.setdiff1d(np.arange(len(weights)), used) + 1
    return f"without gyro {', '.join(map(str, left))}, of which no Allan covariance is known" if len(left) else ""


def drift_model(scales: AllanScales) -> AllanDrift:
    """R and Q by least squares over τ, element by element: C_ij(τ) = R_ij/τ + Q_ij·τ/3, R_ii and Q_ii >= 0.

    A walk of less than the share FOLLOWED of the Allan variance at the longest τ is none.
    raises : CannotRun if there are fewer than two τ
    """
    if len(scales.tau) < 2:
        raise CannotRun("the record at rest is too short: Allan covariances at two τ are needed")
    terms = np.column_stack([1.0 / scales.tau, scales.tau / 3.0])
    lost = 1.0 / np.maximum(scales.pairs, 1.0) + FOLLOWED**2
    gyros = scales.covariance.shape[1]
    R, Q = np.zeros((2, gyros, gyros))
    model = np.empty((gyros, len(scales.tau)))
    for i in range(gyros):
        R[i, i], Q[i, i] = _variance_terms(terms, scales.covariance[:, i, i], lost)
        model[i] = terms @ (R[i, i], Q[i, i])
        if Q[i, i] * terms[-1, 1] < FOLLOWED * model[i, -1]:
            Q[i, i] = 0.0
    for i in range(gyros):
        for j in range(i):
            weight = 1.0 / (lost * model[i] * model[j])
            values = _terms_of_covariance(terms, scales.covariance[:, i, j], weight, lost)
            R[i, j] = R[j, i] = values[0]
            Q[i, j] = Q[j, i] = values[1]
    Q, rank = _semidefinite(Q)
    return AllanDrift(R, Q, rank)


def _variance_terms(terms: np.ndarray, variance: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """(R_ii, Q_ii) >= 0 by least squares with weights 1/(2·lost·C²), C of the fit itself.

    terms : [J, 2];  variance : [J], Allan variance;  lost : [J], relative variance of each over 2
    """
    level, found = variance, np.zeros(2)
    for _ in range(ROUNDS):
        last, found = found, _not_negative(terms, variance, 1.0 / (2.0 * lost * level**2))
        level = terms @ found
        if np.allclose(found, last, rtol=SETTLED, atol=0.0):
            break
    return found


def _terms_of_covariance(terms: np.ndarray, covariance: np.ndarray, first: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """(R_ij, Q_ij) by least squares with weights 1/(lost·(C_ii·C_jj + C_ij²)), C_ij of the fit itself.

    first : [J], 1/(lost·C_ii·C_jj)
    """
    weight = first
    found: Floats = np.zeros(2)
    for _ in range(ROUNDS):
        last, found = found, _least_squares(terms, covariance, weight)
        weight = 1.0 / (1.0 / first + lost * (terms @ found) ** 2)
        if np.allclose(found, last, rtol=SETTLED, atol=0.0):
            break
    return found


def _least_squares(terms: Floats, values: Floats, weight: Floats) -> Floats:
    """Weighted least squares of the columns of `terms` [J, K] to `values` [J]."""
    root = np.sqrt(weight)
    scale = np.linalg.norm(terms * root[:, None], axis=0)
    found: Floats = np.linalg.lstsq(terms * root[:, None] / scale, values * root, rcond=None)[0] / scale
    return found


def _not_negative(terms: np.ndarray, values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The same of two columns, without a coefficient below zero."""
    found = _least_squares(terms, values, weight)
    if (found >= 0).all():
        return found
    kept = int(found[1] < 0) ^ 1  # The other one is zero; of positive values both cannot be negative.
    alone = np.zeros(2)
    alone[kept] = _least_squares(terms[:, [kept]], values, weight)[0]
    return alone


def _semidefinite(Q: np.ndarray) -> tuple[np.ndarray, int]:
    """The covariance nearest to Q by its correlation matrix: no eigenvalue below zero; and its rank."""
    walk = np.sqrt(np.diag(Q))
    walking = np.flatnonzero(walk > 0)
    near = np.zeros_like(Q)
    if len(walking) == 0:
        return near, 0
    scale = np.outer(walk[walking], walk[walking])
    value, vector = np.linalg.eigh(Q[np.ix_(walking, walking)] / scale)
    good = value > SMALLEST * value[-1]
    near[np.ix_(walking, walking)] = (vector[:, good] * value[good]) @ vector[:, good].T * scale
    return near, int(good.sum())


def least_drift(model: AllanDrift) -> tuple[np.ndarray, float]:
    """c [N] = Q⁻¹1/(1'Q⁻¹1) and 1/(1'Q⁻¹1), (deg/s)²/s, the variance of its walk a second.

    Where Q is singular, by its pseudo-inverse, which has as many eigenvalues as Q has rank (their eq. 54): what has no
    drift by the fit has no weight.
    raises : CannotRun if Q is zero
    """
    if model.rank == 0:
        raise CannotRun("no random walk was found in any gyro")
    value, vector = np.linalg.eigh(model.Q)
    value, vector = value[-model.rank :], vector[:, -model.rank :]
    inverse = vector @ (vector.sum(axis=0) / value)
    total = float(inverse.sum())
    return inverse / total, 1.0 / total


def _rank(model: AllanDrift) -> str:
    gyros = len(model.Q)
    still = np.flatnonzero(np.diag(model.Q) == 0) + 1
    if model.rank == gyros:
        return ""
    walkless = f"; no random walk was found in gyro {', '.join(map(str, still))}" if len(still) else ""
    return f"Q has the rank {model.rank} of {gyros}: pseudo-inverse{walkless}"

"""Bayard & Ploen's virtual gyro: the biases are random walks, the rate is white noise of unknown size."""

from __future__ import annotations

import math

import numpy as np

from vgyro.fusion import design
from vgyro.fusion.papers.decoupled_walk import Modes, estimate, modes, walk_factor
from vgyro.fusion.papers.decoupled_walk import operations as operations_of_modes
from vgyro.fusion.types import ArrayRates, FilterParameters, Fused, cannot_run

SOURCE = "Bayard & Ploen (2003), US 2003/0187623"
SAME_AT_ANY_RATE = {"": "Σu = 1, and the filter of the biases sees only differences between the gyros"}
INFERRED = (
    "the patent's rate is the integral of white noise without a size: read as no knowledge of the rate at all, which "
    "leaves the differences between the gyros (parity form); the random walks are correlated as the white noise is; at "
    "the start only the walks' own proportions are known, not the biases; they are kept over a gap"
)


def bayard_ploen(array: ArrayRates, parameters: FilterParameters, start_s: float = math.inf) -> Fused:
    """Kalman filter of the biases by the differences between the gyros; the rate is what is left.

    R_d = R/T, u = R_d⁻¹1/(1'R_d⁻¹1), G = R_d⁻¹ - R_d⁻¹11'R_d⁻¹/(1'R_d⁻¹1), G1 = 0; Q = K²·correlation. Each sample:
    P += Q·T;  P = (P⁻¹ + G)⁻¹;  K = P·G;  b += K(y - b);  w = u'(y - b).
    start_s : P_0 = Q·start_s; infinite: the differences of the biases are not known before the first sample
    raises  : CannotRun if R is not positive definite or a random walk is not known

    P grows without bound along the common part, v'Qv·t with v = Q⁻¹1/(1'Q⁻¹1), which no difference shows, while K
    converges. That part is not computed: G = A(A'R_dA)⁻¹A' with any basis A of the differences, so that K needs A'PA
    and PA only, whatever P_0 is; the modes of vgyro.fusion.papers.decoupled_walk make them diagonal.
    v'b is 0 throughout: quick noise is weighted by u, slow drift by v, and w keeps v'b of the true biases.
    In the style of Bayard & Ploen (2003), US patent application 2003/0187623; parity form derived.
    """
    u, found, walk = bias_modes(array, parameters)
    rate = estimate(array, u, found, parameters.engine, start_s)
    return Fused.undelayed(rate, u, _note(array, u, found, walk))


def bias_modes(array: ArrayRates, parameters: FilterParameters) -> tuple[np.ndarray, Modes, np.ndarray]:
    """u [N]; the modes of the differences, whose output is -u'b; F [N, N], FF' = Q.  raises : as bayard_ploen"""
    noise = array.noise.with_arw(parameters.arw)
    with cannot_run():
        u = design.gain_direction(noise.R)
    walk = walk_factor(noise)
    step = walk * math.sqrt(array.period)
    return u, modes(noise.R / array.period, step, -(u @ step), differences(len(u))), walk


def differences(gyros: int) -> np.ndarray:
    """Orthonormal basis [N, N-1] of what does not change when all gyros turn together (Helmert's)."""
    basis = np.triu(np.ones((gyros, gyros - 1)))
    for column in range(gyros - 1):
        basis[column + 1, column] = -(column + 1.0)
        basis[:, column] /= math.sqrt((column + 1.0) * (column + 2.0))
    return basis


def operations(gyros: int) -> float:
    """Floating-point operations a sample."""
    return operations_of_modes(gyros - 1, gyros) + 2.0 * gyros


def _note(array: ArrayRates, u: np.ndarray, found: Modes, walk: np.ndarray) -> str:
    if len(found.step) == 0:
        return "no random walk in any gyro: fixed weights u"
    slow = u + found.direction @ found.share
    left = float(np.linalg.norm(slow @ walk))
    times = array.period / found.gain
    notes = [
        f"biases follow with time constants of {times.min():.3g} to {times.max():.3g} s",
        f"random walk of the rate's own bias {left:.3g} deg/s/√s",
        array.noise.rrw_note,
    ]
    return "; ".join(note for note in notes if note)

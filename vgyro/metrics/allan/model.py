"""Allan variance of the five noise terms, and their non-negative least-squares fit to a curve.

A model is named by its terms, in this order, with τ in s and the rate in deg/s (IEEE Std 952-1997, annex C):
    N  angle random walk, N²/τ           B  bias instability, (2 ln2/π)B²     K  rate random walk, K²τ/3
    Q  angle noise (quantisation), 3Q²/τ²                                     R  rate ramp, R²τ²/2
    L  the gyro's own low-pass of time constant Tc, -3TcN²/(2τ²): the only term that may be negative, never a result
The unknowns are the squares of the coefficients: what is linear in σ².
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from itertools import product

import numpy as np

from vgyro.arrays import Floats

BASE = "NBK"
FREE = "L"
FLICKER = 2 * math.log(2) / math.pi
PASSES = 12
SETTLED = 1e-9  # relative change of the model from pass to pass
LOWEST_SHARE = 1e-6  # of the variance found: a model may not fall below it

SHAPES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "N": lambda tau: 1 / tau,
    "B": lambda tau: np.full_like(tau, FLICKER),
    "K": lambda tau: tau / 3,
    "Q": lambda tau: 3 / tau**2,
    "R": lambda tau: tau**2 / 2,
    "L": lambda tau: 1 / tau**2,
}


def low_pass_factor(tau: np.ndarray, constant: float, passes: int = 1) -> np.ndarray:
    """Allan variance of white noise after a first-order low-pass of time constant `constant` s, over that before.

    passes 1 : 1 - (3 - 4e^-x + e^-2x)/2x, x = τ/Tc: a first-order Gauss-Markov rate, IEEE Std 952-1997, annex C
    passes 2 : the same low-pass forward and back, autocovariance (1 + u/Tc)e^(-u/Tc)/4Tc:
               1 - (9 - 4(x + 3)e^-x + (2x + 3)e^-2x)/4x
    """
    if constant == 0:
        return np.ones_like(tau)
    x = tau / constant
    if passes == 2:
        return 1 - (9 - 4 * (x + 3) * np.exp(-x) + (2 * x + 3) * np.exp(-2 * x)) / (4 * x)
    return 1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x)


@dataclass(frozen=True)
class VarianceCurve:
    """tau [M] s, Allan variance [M] (deg/s)² and its degrees of freedom [M]; what fits and limits are made from."""

    tau: np.ndarray
    variance: np.ndarray
    edf: np.ndarray

    def since(self, first: int) -> VarianceCurve:
        """Without the first points."""
        return VarianceCurve(self.tau[first:], self.variance[first:], self.edf[first:])


@dataclass(frozen=True)
class AllanModel:
    """Terms of the model at the τ [M] of a curve, and their columns [M, C].

    constant, passes : Tc of a known first-order low-pass, s, and how often the series went through it
    """

    terms: str
    tau: np.ndarray
    constant: float = 0.0
    passes: int = 1
    columns: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        columns = np.column_stack([SHAPES[term](self.tau) for term in self.terms])
        if "N" in self.terms:
            columns[:, self.terms.index("N")] *= low_pass_factor(self.tau, self.constant, self.passes)
        object.__setattr__(self, "columns", columns)

    @property
    def bounded(self) -> int:
        """How many of the terms, from the first on, cannot be negative."""
        return len(self.terms.rstrip(FREE))

    def with_terms(self, terms: str) -> AllanModel:
        """The same with more terms, in the order of the module."""
        every = set(self.terms + terms)
        return AllanModel("".join(term for term in SHAPES if term in every), self.tau, self.constant, self.passes)

    def since(self, first: int) -> AllanModel:
        """Without the first τ."""
        return AllanModel(self.terms, self.tau[first:], self.constant, self.passes)

    def at(self, squares: Floats, variance: Floats) -> Floats:
        """Allan variance [M] of the model, never below a small part of `variance` [M]."""
        found: Floats = np.maximum(self.columns @ squares, LOWEST_SHARE * variance)
        return found


def fit(
    model: AllanModel,
    curve: VarianceCurve,
    held: tuple[int, float] | None = None,
    start: np.ndarray | None = None,
    settled: float = SETTLED,
) -> np.ndarray:
    """Squares of the coefficients [C] by reweighted non-negative least squares on σ², weight edf / (2·model²).

    held    : column and value of a square that is not fitted;  start : squares [C] to take the first weights from
    settled : relative change of the model from pass to pass at which it ends
    The weights come from the model and not from the data, or low points would pull it down.
    """
    keep = [term for term in range(len(model.terms)) if held is None or term != held[0]]
    squares = np.zeros(len(model.terms)) if start is None else start.copy()
    known = np.zeros(len(curve.tau))
    if held:
        squares[held[0]] = held[1]
        known = model.columns[:, held[0]] * held[1]
    columns, targets, bounded = model.columns[:, keep], (curve.variance - known)[None], model.bounded
    bounded -= held is not None and held[0] < bounded
    floor = np.max(curve.variance) * 1e-12
    scale = np.maximum(curve.variance, floor) if start is None else model.at(squares, curve.variance)
    for _ in range(PASSES):
        squares[keep] = solve(columns, targets, curve.edf / (2 * scale**2), bounded)[0][0]
        following = model.at(squares, curve.variance)
        if (np.abs(following - scale) <= settled * scale).all():
            break
        scale = following
    return squares


def solve(columns: np.ndarray, targets: np.ndarray, weights: np.ndarray, bounded: int) -> tuple[np.ndarray, np.ndarray]:
    """Weighted least squares, the first `bounded` unknowns not negative, the others free.

    columns : array [M, C];  targets : array [R, M];  weights : array [M]
    returns : unknowns [R, C], and by how much each fit lowers the weighted sum of squares [R]
    Exact: every subset of the bounded columns is tried, and the best admissible one taken.
    """
    root = np.sqrt(weights)
    scaled = columns * root[:, None]
    norm = np.sqrt((scaled * scaled).sum(axis=0))
    scaled /= norm
    chosen, within, beyond = _masks(columns.shape[1], bounded)
    gram = (scaled.T @ scaled) * within + beyond
    right = np.ascontiguousarray(((targets * root) @ scaled).T)
    values = _solved(gram, right, chosen, within)
    explained = (values * right).sum(axis=1)
    explained[(values[:, :bounded] < 0).any(axis=1)] = -np.inf
    best = explained.argmax(axis=0)
    row = np.arange(len(targets))
    return values[best, :, row] / norm, explained[best, row]


def _solved(gram: Floats, right: Floats, chosen: Floats, within: Floats) -> Floats:
    """Solutions [S, C, R] of symmetric equations; the shortest one where some are singular.

    They are where the weights leave a single τ: there the shapes of two terms are the same.
    gram : [S, C, C];  right : [C, R], zero in a subset where its column is not;  chosen, within : of _masks
    """
    try:
        if right.shape[1] == 1:
            solved: Floats = np.linalg.solve(gram, right * chosen)
            return solved
        # Of many right-hand sides, which are draws that are only counted, by the inverse: that is several times faster.
        many: Floats = (np.linalg.inv(gram) * within) @ right
        return many
    except np.linalg.LinAlgError:
        shortest: Floats = np.linalg.pinv(gram, hermitian=True) @ (right * chosen)
        return shortest


@cache
def _masks(number: int, bounded: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each subset the columns in it [S, C, 1], and the products of its equations that are kept [S, C, C].

    And the equations x = 0 of all other columns, [S, C, C].
    """
    chosen = _subsets(number, bounded)
    within = (chosen[:, :, None] & chosen[:, None, :]).astype(float)
    return chosen[:, :, None].astype(float), within, np.eye(number) * ~chosen[:, :, None]


@cache
def _subsets(number: int, bounded: int) -> np.ndarray:
    """All choices among the first `bounded` of `number` columns, the others always chosen, [2^bounded, number]."""
    bits = np.array(list(product((False, True), repeat=bounded))).reshape(2**bounded, bounded)
    bits = bits[np.argsort(bits.sum(axis=1), kind="stable")]
    return np.hstack([bits, np.ones((len(bits), number - bounded), dtype=bool)])

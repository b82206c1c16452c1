"""Limits of noise coefficients, and evidence for further terms, by fits to Allan curves drawn from the fitted model."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.metrics.allan.model import AllanModel, VarianceCurve, fit, solve

FIRST_STEP, MOST_STEPS = 0.01, 30  # relative, twice as long each time
STEPS_OF_BISECTION = 4
NEARLY_SETTLED = 1e-6  # relative change of the model from pass to pass that is enough for a limit
NEARLY_NORMAL = 100.0  # degrees of freedom from which the cube root of chi² is taken as normal
TRUST = 0.01  # relative error of σ² that the model itself may have: no evidence is drawn from less


@dataclass(frozen=True)
class Drawing:
    """How many curves are drawn for limits and for evidence, and from which seed."""

    replicates: int
    seed: int

    def errors(self, model: AllanModel, squares: np.ndarray, edf: np.ndarray) -> np.ndarray:
        """Allan variances over those expected [R, M]: chi² of each edf [M], joined by a Gaussian copula."""
        values, vectors = np.linalg.eigh(correlation_of(model, squares))
        root = vectors * np.sqrt(np.maximum(values, 0))
        normal = np.random.default_rng(self.seed).standard_normal((self.replicates, len(edf))) @ root.T
        return _chi2_over_edf(normal, edf)


def _chi2_over_edf(normal: Floats, edf: Floats) -> Floats:
    """Chi² over its degrees of freedom [M] at the quantiles of standard normal numbers [R, M]."""
    from scipy.special import chdtri, ndtr

    # Wilson & Hilferty (1931): wrong by less than 7e-4 of it within three standard deviations.
    spread = 2 / (9 * edf)
    ratio = (1 - spread + normal * np.sqrt(spread)) ** 3
    few = edf < NEARLY_NORMAL
    ratio[:, few] = chdtri(edf[few], ndtr(-normal[:, few])) / edf[few]
    return ratio


def correlation_of(model: AllanModel, squares: Floats) -> Floats:
    """Correlation [M, M] of Allan variances at different τ: ∫ S²|H₁|²|H₂|² df, S the fitted two-sided spectrum.

    The covariance of two mean squares of stationary Gaussian series is 2/T times the integral of their squared
    cross-spectrum (Parseval); the lengths cancel in the correlation. A ramp scatters nothing and has no part in it.
    """
    tau = model.tau
    found = dict(zip(model.terms, squares.tolist(), strict=True))
    frequency = np.geomspace(1 / (30 * tau[-1]), 4 / tau[0], 64 * int(np.ceil(np.log2(120 * tau[-1] / tau[0]))))
    angular = 2 * np.pi * frequency
    spectrum = (
        found["N"] / (1 + (angular * model.constant) ** 2) ** model.passes
        + found["B"] / angular
        + found["K"] / angular**2
    )
    if "Q" in found:
        spectrum += found["Q"] * tau[0] * angular**2 * (2 * tau[0] * frequency < 1)
    phase = np.pi * frequency * tau[:, None]
    response = 2 * np.sin(phase) ** 4 / phase**2 * spectrum * np.sqrt(frequency)
    response /= np.linalg.norm(response, axis=1, keepdims=True)
    correlation: Floats = response @ response.T
    return correlation


def chance_of_gain(model: AllanModel, term: str, curve: VarianceCurve, drawing: Drawing) -> float:
    """Probability that a term which is not there gains as much as it does: small values are evidence for it.

    The gain is the fall of the weighted sum of squares when `term` joins the model; its distribution without the term
    is that over curves drawn from the fit of the model as it is (a parametric bootstrap of the likelihood ratio).
    Where the edf are so high that chance is below 1 % of σ², they are lowered to that, because no gyro follows the
    model more closely.  returns : (1 + draws that gain as much) / (1 + draws)
    """
    edf = 1 / (1 / curve.edf + TRUST**2 / 2)
    squares = fit(model, VarianceCurve(curve.tau, curve.variance, edf))
    expected = model.at(squares, curve.variance)
    wide = model.with_terms(term)
    targets = np.vstack([curve.variance[None], drawing.errors(model, squares, edf) * expected])
    weights = edf / (2 * expected**2)
    without = solve(model.columns, targets, weights, model.bounded)[1]
    gain = solve(wide.columns, targets, weights, wide.bounded)[1] - without
    return float((1 + np.sum(gain[1:] >= gain[0])) / len(gain)) if gain[0] > 0 else 1.0


@dataclass(frozen=True)
class Limits:
    """Inverts a test: a value is inside when fits to curves drawn with it straddle the value found.

    errors : array [R, M], relative, as Drawing.errors gives them;  squares : array [C], the fit
    The other terms are fitted again for each value. Where a fit without the term would give as large a value by
    chance, the lower limit is 0.
    """

    model: AllanModel
    curve: VarianceCurve
    squares: np.ndarray
    errors: np.ndarray
    tail: float

    def of(self, term: str) -> tuple[float, float]:
        """Lower and upper limit of the square of a coefficient."""
        found = self._found(term)
        if found == 0 or 1 - self._share_below(term, 0.0) > self.tail:
            return 0.0, self.upper(term)
        return _crossing(self._test(term), found, 1 - self.tail, up=False), self.upper(term)

    def upper(self, term: str) -> float:
        """Upper limit of the square of a coefficient."""
        found = self._found(term)
        column = self.model.columns[:, self.model.terms.index(term)]
        # From zero the search starts at a value that would by itself make a hundredth of the lowest variance.
        start = found if found > 0 else float(0.01 * np.min(self.curve.variance / column))
        return _crossing(self._test(term), start, self.tail, up=True)

    def _found(self, term: str) -> float:
        return float(self.squares[self.model.terms.index(term)])

    def _test(self, term: str) -> Callable[[float], float]:
        return lambda value: self._share_below(term, value)

    def _share_below(self, term: str, value: float) -> float:
        """Share of the draws with this value in which less is found; half of the ties count."""
        index = self.model.terms.index(term)
        found = float(self.squares[index])
        refitted = fit(self.model, self.curve, (index, value), self.squares, NEARLY_SETTLED)
        expected = self.model.at(refitted, self.curve.variance)
        weights = self.curve.edf / (2 * expected**2)
        drawn = solve(self.model.columns, self.errors * expected, weights, self.model.bounded)[0][:, index]
        # A value found at zero is shared with all draws at zero.
        return float(np.mean(drawn < found) + np.mean(drawn == found) / 2) if found > 0 else float(np.mean(drawn <= 0))


def _crossing(share_below: Callable[[float], float], start: float, level: float, up: bool) -> float:
    """The value at which the share of draws below the value found falls through `level`."""
    step, near = FIRST_STEP, (start, share_below(start))
    for _ in range(MOST_STEPS):
        value = near[0] * (1 + step) if up else near[0] / (1 + step)
        far = value, share_below(value)
        if (far[1] < level) == up:
            break
        near, step = far, 2 * step
    for _ in range(STEPS_OF_BISECTION):
        value = math.sqrt(near[0] * far[0])
        middle = value, share_below(value)
        if (middle[1] < level) == up:
            far = middle
        else:
            near = middle
    # Straight between the two, as the share is a step function of no exact crossing.
    part = (near[1] - level) / (near[1] - far[1]) if near[1] != far[1] else 1.0
    crossing: float = near[0] * (far[0] / near[0]) ** min(max(part, 0.0), 1.0)
    return crossing

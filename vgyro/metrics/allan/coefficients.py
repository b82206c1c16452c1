"""Noise coefficients N, B, K and, on evidence, Q and R from an Allan curve, with limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats
from vgyro.metrics.allan.coefficient_limits import Drawing, Limits, chance_of_gain
from vgyro.metrics.allan.deviation import AllanCurve
from vgyro.metrics.allan.model import BASE, FREE, SHAPES, AllanModel, VarianceCurve, fit, low_pass_factor
from vgyro.metrics.equal_bandwidth import LowPass

__all__ = ["Coefficient", "NoiseCoefficients", "low_pass_factor", "model_deviation", "noise_coefficients"]

FITTED_KINDS = ("overlapping", "robust")
FEWEST_POINTS = 6
LARGEST_MISFIT = 5.0
EVIDENCE, DRAWS = 0.005, 400  # largest probability by chance at which Q or R is taken to exist; drawn curves
LARGEST_SIGMAS, LARGEST_RELATIVE = 4.0, 0.01  # a variance agrees with the model within the larger of the two


@dataclass(frozen=True)
class Coefficient:
    """A coefficient and its confidence limits; low = 0 where the data do not show that it exists."""

    value: float
    low: float
    high: float


UNKNOWN = Coefficient(math.nan, math.nan, math.nan)


@dataclass(frozen=True)
class NoiseCoefficients:
    """N deg/s/√Hz (two-sided), B deg/s, K deg/s/√s, Q deg, R deg/s²; the fit used τ >= tau_from, s.

    misfit : Σ (σ² - model)²·edf/(2 model²) a point; far above 1: the model does not describe the curve, because of
             tones or other noise that is no power law; `reliable` is then False
    Q, R   : value and low are 0 without evidence, high is the largest that could have escaped; NaN: not estimated
    """

    N: Coefficient
    B: Coefficient
    K: Coefficient
    tau_from: float
    misfit: float
    note: str = ""
    Q: Coefficient = UNKNOWN
    R: Coefficient = UNKNOWN

    @property
    def reliable(self) -> bool:
        """Does the model describe the curve?"""
        return self.misfit <= LARGEST_MISFIT


def noise_coefficients(
    curve: AllanCurve,
    bandwidth_hz: float | None = None,
    dc_gain: float = 1.0,
    replicates: int = 500,
    seed: int = 0,
    confidence: float | None = None,
    passes: int = 1,
) -> NoiseCoefficients:
    """Fit σ²(τ) = N²/τ + (2 ln2/π)B² + K²τ/3, with 3Q²/τ² and R²τ²/2 where the curve shows them.

    curve        : of a rate in deg/s; Allan deviation, overlapping or robust
    bandwidth_hz : -3 dB bandwidth of a first-order low-pass that the series went through; its effect on the white term
                   is put into the model and τ < 1/(π·bandwidth_hz), 2Tc of one pass, is left out; None: not limited
    dc_gain      : gain of that filter for a constant rate; all coefficients are divided by it
    replicates   : draws for the limits;  seed : of all draws;  confidence : None takes that of the curve
    passes       : 2, forward and back, bandwidth_hz that of both; 0: the low-pass has another shape, which nothing is
                   known of but that τ
    returns      : NoiseCoefficients, NaN with a note where the curve has fewer than 3 points
    raises       : ValueError for a modified or Hadamard deviation, whose terms have other shapes
    Reweighted non-negative least squares on σ², weight edf/2; its scatter for N, B and K is near the Cramér-Rao bound.
    Q and R are in the model if chance_of_gain is at most 0.005 (of series without them about one in a hundred, or less,
    shows one), the model with them describes the curve, and it has 6 points. A ramp is told from a random walk only
    where it is far larger over the whole series; a smaller one is in K. Limits: Limits.
    Without a bandwidth, where the shortest τ do not fit the rest, a term in 1/τ² of either sign is tried: negative is a
    low-pass of the gyro itself (-3TcN²/2τ²); positive is Q if every τ then fits, else noise that has no name, as of a
    tone. The τ that still do not fit are left out. Where Q cannot be told from those, its upper limit is what the curve
    has room for: 3Q²/τ² <= σ² at every τ.
    Model: IEEE Std 952-1997, annex C.  Low-pass: first-order Gauss-Markov rate, Tc = 1/(2π·bandwidth).
    """
    if curve.kind not in FITTED_KINDS:
        raise ValueError(f"no coefficients of a {curve.kind} deviation: its terms have other shapes")
    low_pass = LowPass(bandwidth_hz, dc_gain, passes)
    shortest = low_pass.shortest_tau
    used = np.isfinite(curve.deviation) & (curve.edf > 0) & (curve.tau >= shortest)
    if used.sum() < len(BASE):
        note = "fewer than 3 points of the Allan curve"
        return NoiseCoefficients(UNKNOWN, UNKNOWN, UNKNOWN, math.nan, math.nan, note)
    whole = VarianceCurve(curve.tau[used], curve.deviation[used] ** 2, curve.edf[used])
    if not whole.variance.any():
        zero = Coefficient(0.0, 0.0, 0.0)
        return NoiseCoefficients(zero, zero, zero, float(whole.tau[0]), 0.0, "the series is constant", zero, zero)
    drawing = Drawing(replicates, seed)
    model, first = _describe(AllanModel(BASE, whole.tau, low_pass.constant, passes), whole, Drawing(DRAWS, seed))
    fitted = whole.since(first)
    squares = fit(model, fitted)
    tail = (1 - (curve.confidence if confidence is None else confidence)) / 2
    limits = Limits(model, fitted, squares, drawing.errors(model, squares, fitted.edf), tail)
    found = {term: (float(squares[at]), *limits.of(term)) for at, term in enumerate(model.terms) if term != FREE}
    for term in set("QR") - set(model.terms):
        found[term] = 0.0, 0.0, _largest_unseen(term, limits, curve.high[used] ** 2, whole, identified=first == 0)
    misfit = _misfit(model, squares, fitted)
    result = {term: Coefficient(*(math.sqrt(value) / dc_gain for value in three)) for term, three in found.items()}
    tau_from = float(fitted.tau[0])
    note = _note(model, squares, tau_from if first or shortest else None, misfit)
    return NoiseCoefficients(**result, tau_from=tau_from, misfit=misfit, note=note)


def _describe(base: AllanModel, curve: VarianceCurve, drawing: Drawing) -> tuple[AllanModel, int]:
    """The model that describes the curve from the first τ, of that index, on."""
    model, first = _at_short_tau(base, curve, drawing)
    return (model.with_terms("R") if _shows(model, "R", curve.since(first), drawing) else model), first


def _at_short_tau(base: AllanModel, curve: VarianceCurve, drawing: Drawing) -> tuple[AllanModel, int]:
    if base.constant or len(curve.tau) < FEWEST_POINTS:
        return base, 0
    first, free = _first_fitting(base, curve), base.with_terms(FREE)
    start = _first_fitting(free, curve) if first else 0
    if start == 0 and _shows(base, "Q", curve, drawing):
        return base.with_terms("Q"), 0
    if first == 0:
        return base, 0
    free, later = free.since(start), curve.since(start)
    if fit(free, later)[-1] < 0 or chance_of_gain(base.since(start), "Q", later, drawing) <= EVIDENCE:
        return free, start
    first = max(first, start)
    return base.since(first), first


def _shows(model: AllanModel, term: str, curve: VarianceCurve, drawing: Drawing) -> bool:
    """Is a further term needed, and does the model with it describe the curve?"""
    if len(curve.tau) < FEWEST_POINTS or chance_of_gain(model, term, curve, drawing) > EVIDENCE:
        return False
    wide = model.with_terms(term)
    return _misfit(wide, fit(wide, curve), curve) <= LARGEST_MISFIT


def _misfit(model: AllanModel, squares: np.ndarray, curve: VarianceCurve) -> float:
    expected = model.at(squares, curve.variance)
    return float(np.mean((curve.variance - expected) ** 2 * curve.edf / (2 * expected**2)))


def _first_fitting(model: AllanModel, curve: VarianceCurve) -> int:
    """Index of the first τ that agrees with a fit to all longer τ, within 4 standard deviations or 1 % of variance."""
    last = min(len(curve.tau) - FEWEST_POINTS, int(np.searchsorted(curve.tau, curve.tau[-1] / 30)))
    for first in range(max(last, 0)):
        rest = first + 1
        expected = model.columns[first] @ fit(model.since(rest), curve.since(rest))
        allowed = max(LARGEST_SIGMAS * math.sqrt(2 / curve.edf[first]), LARGEST_RELATIVE)
        if abs(curve.variance[first] / expected - 1) < allowed:
            return first
    return max(last, 0)


def _largest_unseen(term: str, limits: Limits, highest: np.ndarray, whole: VarianceCurve, identified: bool) -> float:
    """Upper limit of the square of a term that is not in the model.

    highest : array [M], upper limits of the variances of the whole curve, which the term alone cannot exceed
    """
    room = float(np.min(highest / SHAPES[term](whole.tau)))
    model = limits.model
    hidden = term == "Q" and (not identified or model.constant > 0 or FREE in model.terms)
    if hidden or len(limits.curve.tau) < FEWEST_POINTS:
        return room
    wide = model.with_terms(term)
    wider = Limits(wide, limits.curve, fit(wide, limits.curve), limits.errors, limits.tail)
    return min(wider.upper(term), room)


def _note(model: AllanModel, squares: np.ndarray, late: float | None, misfit: float) -> str:
    notes = [] if late is None else [f"fitted from τ = {late:.3g} s"]
    if FREE in model.terms:
        kind = "the gyro's own low-pass" if squares[-1] < 0 else "a tone or other noise of the angle"
        notes.append(f"with a term 1/τ² for {kind}")
    if "Q" in model.terms:
        notes.append("with a term 1/τ² for noise of the angle (quantisation)")
    if "R" in model.terms:
        notes.append("with a term τ² for a ramp of the rate")
    if misfit > LARGEST_MISFIT:
        names = " + ".join(model.terms.rstrip(FREE))
        notes.append(f"{names} does not describe this curve (misfit {misfit:.3g}): read the curve itself")
    return ", ".join(notes)


def model_deviation(
    tau: Floats, coefficients: NoiseCoefficients, bandwidth_hz: float | None = None, passes: int = 1
) -> Floats:
    """Allan deviation of the fitted model at `tau` s, in deg/s; terms that were not estimated are left out."""
    constant = LowPass(bandwidth_hz, passes=passes).constant
    model = AllanModel(BASE + "QR", np.asarray(tau, dtype=float), constant, passes)
    squares = np.array([getattr(coefficients, term).value ** 2 for term in model.terms])
    squares[len(BASE) :] = np.nan_to_num(squares[len(BASE) :])
    deviation: Floats = np.sqrt(model.columns @ squares)
    return deviation

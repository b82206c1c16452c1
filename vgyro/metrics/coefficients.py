"""Angle random walk N, bias instability B and rate random walk K from an Allan curve, with intervals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

from vgyro.metrics.allan import AllanCurve

TERMS = ("N", "B", "K")
FLICKER = 2 * math.log(2) / math.pi
PASSES = 12
SETTLED = 1e-9  # relative change of the model from pass to pass
FEWEST_POINTS = 6
STEPS_OF_BISECTION = 10
LARGEST_MISFIT = 5.0
LOWEST_SHARE = 1e-6  # of the variance found: a model may not fall below it


@dataclass(frozen=True)
class Coefficient:
    """A coefficient and its confidence limits; low = 0 where the data do not show that it exists."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class NoiseCoefficients:
    """N deg/s/√Hz (two-sided), B deg/s, K deg/s/√s; the fit used τ >= tau_from, s.

    misfit : Σ (σ² - model)²·edf/(2 model²) a point; far above 1: the model does not describe the curve, because of
             tones or other noise that is no power law; `reliable` is then False
    """

    N: Coefficient
    B: Coefficient
    K: Coefficient
    tau_from: float
    misfit: float
    note: str = ""

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
) -> NoiseCoefficients:
    """Fit σ²(τ) = N²/τ + (2 ln2/π)B² + K²τ/3 by reweighted non-negative least squares, weight edf/2.

    curve        : of a rate in deg/s
    bandwidth_hz : -3 dB bandwidth of a first-order low-pass that the series went through; its effect on the white term
                   is put into the model and τ < 2Tc is left out; None: not limited
    dc_gain      : gain of that filter for a constant rate; all coefficients are divided by it
    replicates   : draws for the intervals;  seed : of the draws;  confidence : None takes that of the curve
    returns      : NoiseCoefficients, NaN with a note where the curve has fewer than 3 points
    Without a bandwidth, where the shortest τ do not fit the rest, a term in 1/τ² of either sign is added (a low-pass of
    the gyro itself makes -3TcN²/2τ², quantised output 3Q²/τ²), and the τ that still do not fit are left out.
    The limits invert a test: a value is inside when fits to curves drawn with it (chi² of each edf, correlated between
    the τ as the fitted spectrum implies, the other terms fitted again) straddle the value found. Where a fit without
    the term would give as large a value by chance, low = 0.
    Model: IEEE Std 952-1997, annex C.  Low-pass: first-order Gauss-Markov rate, Tc = 1/(2π·bandwidth).
    """
    confidence = curve.confidence if confidence is None else confidence
    constant = 1 / (2 * math.pi * bandwidth_hz) if bandwidth_hz else 0.0
    used = np.isfinite(curve.deviation) & (curve.edf > 0) & (curve.tau >= 2 * constant)
    if used.sum() < len(TERMS):
        nothing = Coefficient(math.nan, math.nan, math.nan)
        note = "fewer than 3 points of the Allan curve"
        return NoiseCoefficients(nothing, nothing, nothing, math.nan, math.nan, note)
    tau, variance, edf = curve.tau[used], curve.deviation[used] ** 2, curve.edf[used]
    if not variance.any():
        zero = Coefficient(0.0, 0.0, 0.0)
        return NoiseCoefficients(zero, zero, zero, float(tau[0]), 0.0, "the series is constant")
    columns = _columns(tau, constant)
    first = 0 if constant else _first_fitting(columns, variance, edf, tau)
    if first:
        columns = np.column_stack([columns, tau**-2])
        first = _first_fitting(columns, variance, edf, tau)
    tau, variance, edf, columns = tau[first:], variance[first:], edf[first:], columns[first:]
    fitted = _fit(columns, variance, edf)
    draws = _draws(tau, edf, fitted, replicates, seed)
    tail = (1 - confidence) / 2
    found = []
    for term in range(len(TERMS)):
        limits = _limits(columns, variance, edf, draws, term, fitted, tail)
        found.append(Coefficient(*(math.sqrt(value) / dc_gain for value in (float(fitted[term]), *limits))))
    model = np.maximum(columns @ fitted, LOWEST_SHARE * variance)
    misfit = float(np.mean((variance - model) ** 2 * edf / (2 * model**2)))
    N, B, K = found
    note = _note(fitted, float(tau[0]), first > 0 or constant > 0, misfit)
    return NoiseCoefficients(N, B, K, float(tau[0]), misfit, note)


def _note(fitted: np.ndarray, tau: float, late: bool, misfit: float) -> str:
    notes = [f"fitted from τ = {tau:.3g} s"] if late else []
    if len(fitted) > len(TERMS):
        kind = "the gyro's own low-pass" if fitted[-1] < 0 else "noise of the angle (quantisation, a tone)"
        notes.append(f"with a term 1/τ² for {kind}")
    if misfit > LARGEST_MISFIT:
        notes.append(f"N + B + K does not describe this curve (misfit {misfit:.3g}): read the curve itself")
    return ", ".join(notes)


def model_deviation(tau: np.ndarray, coefficients: NoiseCoefficients, bandwidth_hz: float | None = None) -> np.ndarray:
    """Allan deviation of the fitted model at `tau` s, in deg/s."""
    constant = 1 / (2 * math.pi * bandwidth_hz) if bandwidth_hz else 0.0
    squares = np.array([getattr(coefficients, term).value ** 2 for term in TERMS])
    return np.sqrt(_columns(np.asarray(tau, dtype=float), constant) @ squares)


def low_pass_factor(tau: np.ndarray, constant: float) -> np.ndarray:
    """Allan variance of white noise after a first-order low-pass of time constant `constant` s, over that before."""
    if constant == 0:
        return np.ones_like(tau)
    ratio = constant / tau
    return 1 - ratio / 2 * (3 - 4 * np.exp(-1 / ratio) + np.exp(-2 / ratio))


def _columns(tau: np.ndarray, constant: float) -> np.ndarray:
    return np.column_stack([low_pass_factor(tau, constant) / tau, np.full_like(tau, FLICKER), tau / 3])


def _solve(columns: np.ndarray, targets: np.ndarray, weights: np.ndarray, terms: int) -> np.ndarray:
    """Weighted least squares, the first `terms` unknowns not negative, the others free; targets [R, M] → [R, C].

    Exact: every subset of the at most three bounded columns is tried, and the best admissible one taken.
    """
    scaled = columns * np.sqrt(weights)[:, None]
    norm = np.sqrt((scaled * scaled).sum(axis=0))
    scaled /= norm
    chosen = _subsets(columns.shape[1], terms)
    # A column that is not in a subset has the equation x = 0.
    gram = (scaled.T @ scaled) * (chosen[:, :, None] & chosen[:, None, :])
    gram[:, range(len(norm)), range(len(norm))] += ~chosen
    right = ((targets * np.sqrt(weights)) @ scaled).T
    values = np.linalg.solve(gram, right * chosen[:, :, None])
    # The sum of squares falls by this much when the subset is fitted.
    explained = (values * right).sum(axis=1)
    explained[(values[:, :terms] < 0).any(axis=1)] = -np.inf
    best = np.argmax(explained, axis=0)
    return values[best, :, np.arange(len(targets))] / norm


@cache
def _subsets(number: int, terms: int) -> np.ndarray:
    """All choices among the first `terms` of `number` columns, the others always chosen, [2^terms, number]."""
    bits = np.array(list(product((False, True), repeat=terms))).reshape(2**terms, terms)
    bits = bits[np.argsort(bits.sum(axis=1), kind="stable")]
    return np.hstack([bits, np.ones((len(bits), number - terms), dtype=bool)])


def _fit(
    columns: np.ndarray, variance: np.ndarray, edf: np.ndarray, held: tuple[int, float] | None = None
) -> np.ndarray:
    """Squared coefficients [C]; weights from the model, not the data, or low points would pull it down."""
    open_terms = [term for term in range(columns.shape[1]) if held is None or term != held[0]]
    bounded = len(TERMS) - (held is not None)
    known = columns[:, held[0]] * held[1] if held else np.zeros(len(variance))
    scale = np.maximum(variance, np.max(variance) * 1e-12)
    values = np.zeros(columns.shape[1])
    if held:
        values[held[0]] = held[1]
    for _ in range(PASSES):
        part = _solve(columns[:, open_terms], (variance - known)[None], edf / (2 * scale**2), bounded)[0]
        values[open_terms] = part
        following = np.maximum(columns @ values, LOWEST_SHARE * variance)
        if (np.abs(following - scale) <= SETTLED * scale).all():
            break
        scale = following
    return values


def _first_fitting(columns: np.ndarray, variance: np.ndarray, edf: np.ndarray, tau: np.ndarray) -> int:
    """Index of the first τ that agrees with a fit to all longer τ, within 4 standard deviations or 1 % of variance."""
    last = min(len(tau) - FEWEST_POINTS, int(np.searchsorted(tau, tau[-1] / 30)))
    for first in range(max(last, 0)):
        rest = slice(first + 1, None)
        model = columns[first] @ _fit(columns[rest], variance[rest], edf[rest])
        if abs(variance[first] / model - 1) < max(4 * math.sqrt(2 / edf[first]), 0.01):
            return first
    return max(last, 0)


def _draws(tau: np.ndarray, edf: np.ndarray, squares: np.ndarray, replicates: int, seed: int) -> np.ndarray:
    """Relative errors [R, M] of an Allan curve: chi² of each edf, joined by a Gaussian copula."""
    from scipy.special import chdtri, ndtr

    correlation = _correlation(tau, squares)
    values, vectors = np.linalg.eigh(correlation)
    root = vectors * np.sqrt(np.maximum(values, 0))
    normal = np.random.default_rng(seed).standard_normal((replicates, len(tau))) @ root.T
    return chdtri(edf, ndtr(-normal)) / edf


def _correlation(tau: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """Correlation of Allan variances at different τ: ∫ S²|H₁|²|H₂|² df, S the fitted two-sided spectrum.

    The covariance of two mean squares of stationary Gaussian series is 2/T times the integral of their squared
    cross-spectrum (Parseval); the lengths cancel in the correlation.
    """
    frequency = np.geomspace(1 / (30 * tau[-1]), 4 / tau[0], 64 * int(np.ceil(np.log2(120 * tau[-1] / tau[0]))))
    angular = 2 * np.pi * frequency
    spectrum = squares[0] + squares[1] / angular + squares[2] / angular**2
    phase = np.pi * frequency * tau[:, None]
    response = 2 * np.sin(phase) ** 4 / phase**2 * spectrum * np.sqrt(frequency)
    response /= np.linalg.norm(response, axis=1, keepdims=True)
    return response @ response.T


def _limits(
    columns: np.ndarray,
    variance: np.ndarray,
    edf: np.ndarray,
    draws: np.ndarray,
    term: int,
    fitted: np.ndarray,
    tail: float,
) -> tuple[float, float]:
    found = float(fitted[term])

    def share_below(value: float) -> float:
        model = np.maximum(columns @ _fit(columns, variance, edf, (term, value)), LOWEST_SHARE * variance)
        drawn = _solve(columns, draws * model, edf / (2 * model**2), len(TERMS))[:, term]
        # A value found at zero is shared with all draws at zero; half of the ties count.
        return float(np.mean(drawn < found) + np.mean(drawn == found) / 2) if found > 0 else float(np.mean(drawn <= 0))

    start = found if found > 0 else _unit(columns, variance, term)
    high = _crossing(share_below, start, tail, up=True)
    if found == 0 or 1 - share_below(0.0) > tail:
        return 0.0, high
    return _crossing(share_below, start, 1 - tail, up=False), high


def _unit(columns: np.ndarray, variance: np.ndarray, term: int) -> float:
    """A value of the coefficient that would by itself make a hundredth of the lowest variance."""
    return float(0.01 * np.min(variance / columns[:, term]))


def _crossing(share_below: Callable[[float], float], start: float, level: float, up: bool) -> float:
    """The value at which the share of draws below the value found falls through `level`."""
    step, near, far = 0.01, start, start
    for _ in range(30):
        far = near * (1 + step) if up else near / (1 + step)
        if (share_below(far) < level) == up:
            break
        near, step = far, 2 * step
    for _ in range(STEPS_OF_BISECTION):
        middle = math.sqrt(near * far)
        if (share_below(middle) < level) == up:
            far = middle
        else:
            near = middle
    return math.sqrt(near * far)

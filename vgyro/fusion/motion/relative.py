"""How each gyro answers to the motion, relative to the array: scale factor, delay and curvature, from the motion.

y_i = w + s_i·w - d_i·w' + c_i·w'' + b_i + n_i. The differences of the gyros from the array's mean hold s, d and c, and
not w itself, whatever it does: least squares on the smoothed mean and its derivatives, all less their means
over HIGH_PASS_S, so that biases have no say. Only what differs is seen, Σs = Σd = Σc = 0: a scale error that all gyros
share is in no difference, but its size is that of a mean of N such errors (hierarchical Bayes).

c: of a first-order pole of time constant T, d = T and c = T²; of a pure delay d, c = d²/2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from vgyro.fusion.events import excluded
from vgyro.fusion.motion.savgol import savgol, savgol_coefficients
from vgyro.fusion.noise.quiet_frequencies import quiet_noise
from vgyro.fusion.types import ArrayRates
from vgyro.fusion.weights import min_variance_weights, usable

HIGH_PASS_S = 30.0
"""A motion that is slower is not told from biases."""
LONGEST_S = 1.0
"""Half the smoothing window at most."""
LOST = 1.5
"""The window is the longest that takes no more from the mean than this, over what it takes from its noise."""
ORDER = 3
"""Degree of the polynomials of the smoother (Savitzky & Golay 1964)."""
PARTS = 24
"""Parts of equal motion, for the jackknife."""
CLEAR = 10.0
"""Mean square of the smoothed motion over that of its noise, or nothing is looked for."""
TERMS = 3
PRICE = 2.0
"""2Δ log likelihood a term must bring, over the logarithm of PARTS: what two parameters cost (BIC; Schwarz 1978)."""
LEAST = 0.05
"""Least variance of a gyro's noise, of the median: a gyro that does not measure is no perfect one."""


@dataclass(frozen=True)
class Relative:
    """Answers of N gyros relative to their mean, of terms (scale, delay in s, curvature in s²).

    value      : [N, 3], posterior means, of Σ = 0
    covariance : [3, N, N] of value - truth about the mean of all, of one term each
    spread     : [3] standard deviation of the gyros' true values, as the recording shows it; of the mean of all N,
                 which is not seen, it is spread/√N
    window     : samples of the smoother
    gain       : the mean of all over the weighted mean that the motion is read from
    """

    value: np.ndarray
    covariance: np.ndarray
    spread: np.ndarray
    window: int
    gain: float = 1.0

    @property
    def note(self) -> str:
        """What was found, in words."""
        errors = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        said = []
        for term, (name, factor) in enumerate((("scale factors", 100.0), ("delays", 1000.0))):
            if self.spread[term] > 0:
                unit = "%" if term == 0 else "ms"
                sizes = ", ".join(f"{factor * one:+.3g}" for one in self.value[:, term])
                error = factor * float(np.median(errors[term]))
                said.append(f"{name} relative to the array {sizes} {unit} (s.d. {error:.1g}), taken off")
        return "; ".join(said)

    @property
    def common(self) -> np.ndarray:
        """Variance [3] of what all N gyros share beforehand: spread²/N, times (N - 1)/(N - 3).

        The spread is known from them alone (posterior of a normal mean under the density 1/spread); of three or two
        gyros that has no variance, and it is times 3.
        """
        gyros = len(self.value)
        return self.spread**2 / gyros * ((gyros - 1) / (gyros - 3) if gyros > 3 else 3.0)


def relative_response(array: ArrayRates) -> Relative | None:
    """s, d and c of a recording in motion; None where the motion is too small against the noise.

    Standard errors: jackknife over PARTS parts of equal motion. Gyros at fault are left out meanwhile.
    """
    good = used(array)
    mean, noise = reference(array, good)
    window = smoothing_window(array, mean, noise)
    if window is None:
        return None
    terms = motion_terms(array, mean, window)
    for column in terms.T:
        high_passed(array, column)
    parts = _parts(terms)
    products = np.stack([terms[part].T @ terms[part] for part in parts])
    sums = np.empty((len(parts), TERMS, array.rate.shape[1]))
    for gyro in range(array.rate.shape[1]):
        off = np.subtract(array.rate[:, gyro], mean, dtype=float)
        counts = good[:, gyro]
        off[~counts] = float(np.median(off[counts])) if counts.any() else 0.0
        high_passed(array, off)
        sums[:, :, gyro] = [terms[part].T @ off[part] for part in parts]
    return _estimated(products, sums, good.mean(axis=0) > 0.5, window)


def used(array: ArrayRates) -> np.ndarray:
    """Samples [T, N] of bool at which a gyro is neither at fault nor missing."""
    samples, gyros = array.rate.shape
    good = np.ones((samples, gyros), dtype=bool, order="F")
    for gyro, spans in enumerate(excluded(array.faults, samples, gyros)):
        for start, stop in spans:
            good[start:stop, gyro] = False
    if array.missing is not None:
        good &= ~array.missing
    return good


def reference(array: ArrayRates, good: np.ndarray) -> tuple[np.ndarray, float]:
    """Mean of the good gyros of least variance [T], deg/s, and the variance of its white noise, (deg/s)² a sample.

    So weighed its noise is in no difference, and no noise is taken for an answer to the motion. Where no gyro is good
    all of them count.
    """
    shares, noise = array.once("reference", lambda: _shares(array, good))
    total, number = np.zeros(len(array.rate)), np.zeros(len(array.rate))
    none = ~good.any(axis=1)
    for gyro, share in enumerate(shares.tolist()):
        counts = good[:, gyro] | none
        total += share * np.where(counts, array.rate[:, gyro], 0.0)
        number += share * counts
    return total / np.where(number > 0, number, 1.0), noise


def _shares(array: ArrayRates, good: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights of least variance [N], Σ = 1, and that variance: of the noise at the frequencies with little motion.

    Where these say nothing, of the steps between neighbouring samples, as if no gyro's noise were another's.
    """
    shares = 1.0 / _white(array, good)
    noise, shares = 1.0 / float(shares.sum()), shares / shares.sum()
    lost = np.concatenate([np.zeros((1, good.shape[1]), dtype=np.int64), np.cumsum(~good, axis=0)])
    quiet = quiet_noise(array, shares, lambda starts, length: np.equal(lost[starts + length], lost[starts]))
    if quiet is None:
        return shares, noise
    covariance = quiet.variance * quiet.noise(np.eye(len(shares)))
    if not usable(covariance[None])[0]:
        return shares, noise
    shares = min_variance_weights(covariance)
    return shares, float(shares @ covariance @ shares)


def _white(array: ArrayRates, good: np.ndarray) -> np.ndarray:
    """Variances of the gyros' white noise [N], from the steps of neighbouring samples about the mean of all.

    a_i = σ_i²·(1 - 2/N) + Σσ²/N². None below LEAST of the median; two gyros have the same.
    """
    gyros = array.rate.shape[1]
    mean = np.zeros(len(array.rate))
    for column in array.rate.T:
        mean += column / gyros
    seen = np.full(gyros, np.nan)
    for gyro in range(gyros):
        steps = np.diff(np.subtract(array.rate[:, gyro], mean, dtype=float))[good[1:, gyro] & good[:-1, gyro]]
        if steps.size:
            seen[gyro] = float(np.mean(steps**2)) / 2.0
    usual = float(np.nanmedian(seen)) if np.isfinite(seen).any() else 1.0
    seen = np.where(np.isfinite(seen), seen, usual)
    total = float(seen.sum()) / (1.0 - 1.0 / gyros)
    if gyros == 2 or total == 0.0:
        return np.full(gyros, total / gyros or 1.0)
    found = (seen - total / gyros**2) / (1.0 - 2.0 / gyros)
    return np.maximum(found, LEAST * max(float(np.median(found)), total * 1e-6))


def smoothing_window(array: ArrayRates, mean: np.ndarray, noise: float) -> int | None:
    """Samples of the smoother's window, odd; 1: none; None: the motion is not clear of the mean's noise a sample."""
    best = None
    half = 0
    while half <= max(LONGEST_S * array.rate_hz, 1.0):
        window = 2 * half + 1
        kernel = _kernel(window)
        smooth = smoothed(array, mean, window)
        lost = float(np.mean(np.square(mean - smooth)))
        taken = noise * (1.0 - 2.0 * kernel[half] + float(kernel @ kernel))
        if half and lost > LOST * taken:
            break
        left = noise * float(kernel @ kernel)
        best = window if float(np.var(smooth)) > CLEAR * left else None
        half = 2 if half == 0 else 2 * half
    return best


def _kernel(window: int) -> np.ndarray:
    return savgol_coefficients(window, ORDER) if window > 1 else np.ones(1)


def smoothed(array: ArrayRates, values: np.ndarray, window: int, derivative: int = 0) -> np.ndarray:
    """Values [T] or their derivative by s^derivative, smoothed in each gap-free stretch."""
    found = np.empty(len(values))
    for part in array.stretches():
        length = part.stop - part.start
        own = min(window, length - 1 + length % 2)
        if own > ORDER:
            found[part] = savgol(values[part], own, ORDER, derivative, array.period)
            continue
        piece = values[part].astype(float)
        for _ in range(derivative):
            piece = np.gradient(piece, array.period) if length > 1 else np.zeros(1)
        found[part] = piece
    return found


def motion_terms(array: ArrayRates, mean: np.ndarray, window: int) -> np.ndarray:
    """w, -w', w'' [T, 3] of the smoothed mean."""
    terms = np.empty((len(mean), TERMS), order="F")
    for order, sign in enumerate((1.0, -1.0, 1.0)):
        terms[:, order] = sign * smoothed(array, mean, window, order)
    return terms


def high_passed(array: ArrayRates, values: np.ndarray) -> None:
    """Take the running mean over HIGH_PASS_S off, in place, in each gap-free stretch."""
    from scipy.ndimage import uniform_filter1d

    size = max(3, round(HIGH_PASS_S * array.rate_hz))
    for part in array.stretches():
        length = part.stop - part.start
        if length <= size:
            values[part] -= values[part].mean()
        else:
            values[part] -= uniform_filter1d(values[part], size, mode="nearest")


def _parts(terms: np.ndarray) -> list[slice]:
    """Parts of the recording with as much motion each."""
    energy = np.cumsum(np.square(terms[:, 0]))
    edges = np.searchsorted(energy, energy[-1] * np.arange(1, PARTS) / PARTS)
    every = np.unique(np.concatenate([[0], edges, [len(terms)]]))
    return [slice(int(start), int(stop)) for start, stop in pairwise(every)]


def _estimated(products: np.ndarray, sums: np.ndarray, usable: np.ndarray, window: int) -> Relative | None:
    """From the normal equations of the parts [P, 3, 3] and [P, 3, N]."""
    parts = len(products)
    if parts < PARTS // 2 or usable.sum() < 2:
        return None
    # Terms of one size, so that the solution is not spoilt by their units.
    size = np.sqrt(np.diagonal(products.sum(axis=0)))
    size = np.where(size > 0, size, 1.0)

    def solved(product: np.ndarray, vector: np.ndarray) -> np.ndarray:
        ridged = product / np.outer(size, size) + 1e-9 * np.eye(TERMS)
        return np.linalg.solve(ridged, vector / size[:, None]) / size[:, None]

    value = solved(products.sum(axis=0), sums.sum(axis=0))
    each = np.stack([solved(products.sum(axis=0) - one, sums.sum(axis=0) - two)
                     for one, two in zip(products, sums, strict=True)])  # fmt: skip
    apart = each - each.mean(axis=0)
    # The jackknife's variance is itself an estimate of P - 1 degrees of freedom.
    factor = (parts - 1) / parts * (parts - 1) / (parts - 3)
    kept = np.flatnonzero(usable)
    # From the weighted mean, which the motion was read from, to that of all.
    gain = 1.0 + float(value[0, kept].mean())
    nothing = np.zeros((len(usable), TERMS)), np.zeros((TERMS, len(usable), len(usable))), np.zeros(TERMS)
    found = Relative(*nothing, window, gain)
    for term in range(TERMS):
        own = factor * apart[:, term, kept].T @ apart[:, term, kept]
        mean, covariance, spread = posterior(value[term, kept] / gain, own, PRICE * math.log(parts))
        found.value[kept, term], found.spread[term] = mean, spread
        found.covariance[term][np.ix_(kept, kept)] = covariance
    return found


def posterior(value: np.ndarray, error: np.ndarray, price: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Of N normal variables of mean 0 and one variance, of which differences were measured: hierarchical Bayes.

    value [N] : measured, all with one unknown number added;  error : [N, N] covariance of that
    price   : 2Δ log likelihood that their spread must bring over none
    returns : mean [N] and covariance [N, N] about the mean of all, and the spread of greatest likelihood; zeros without
              any
    """
    gyros = len(value)
    # Contrasts: orthonormal, each without the mean.
    contrasts = np.linalg.qr(np.column_stack([np.ones(gyros), np.eye(gyros)[:, 1:]]))[0][:, 1:].T
    sizes, turn = np.linalg.eigh(contrasts @ error @ contrasts.T)
    sizes = np.maximum(sizes, 1e-12 * max(float(sizes[-1]), 1e-300))
    seen = turn.T @ contrasts
    squares = (seen @ value) ** 2
    grid = np.concatenate([[0.0], np.geomspace(0.01 * sizes[0], 4.0 * squares.max() + sizes[0], 200)])
    total = grid[:, None] + sizes
    likelihood = -np.sum(np.log(total) + squares / total, axis=1)
    best = int(np.argmax(likelihood))
    if likelihood[best] - likelihood[0] < price:
        return np.zeros(gyros), np.zeros((gyros, gyros)), 0.0
    keep = grid[best] / total[best]
    covariance = (seen.T * (grid[best] * (1.0 - keep))) @ seen
    return seen.T @ (keep * (seen @ value)), covariance, math.sqrt(grid[best])


def without_relative(array: ArrayRates) -> tuple[ArrayRates, Relative | None, str]:
    """The rates as if every gyro answered as the mean of all: the motion's part is taken off, the noise is left.

    Of what all gyros share nothing changes: the plain average stays what it was.
    returns : the array, a copy where something was found; what was found; a note
    """
    found = relative_response(array)
    if found is None or not found.value.any():
        return array, found, ""
    terms = motion_terms(array, reference(array, used(array))[0], found.window)
    rate = np.empty(array.rate.shape, dtype=array.rate.dtype, order="F")
    for gyro in range(rate.shape[1]):
        rate[:, gyro] = array.rate[:, gyro] - terms @ (found.gain * found.value[gyro])
    return replace(array, rate=rate), found, found.note


def relative_variance(array: ArrayRates, found: Relative, weights: np.ndarray, delay_sd: float) -> np.ndarray:
    """Variance [T], (deg/s)², of what the answers leave in Σu·y: of their errors, and of what all gyros share.

    weights : [N], Σ = 1;  delay_sd : of the delay that all share where it is known, s; NaN: as their spread has it
    """
    terms, common = motion_terms(array, reference(array, used(array))[0], found.window), found.common
    if math.isfinite(delay_sd):
        common[1] = delay_sd**2
    sizes = common + np.einsum("i,kij,j->k", weights, found.covariance, weights)
    return np.square(terms) @ sizes

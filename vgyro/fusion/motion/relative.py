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

from vgyro.arrays import Floats
from vgyro.fusion.noise.reference_rate import reference, smoothed, smoothing_window, used
from vgyro.fusion.types import ArrayRates

HIGH_PASS_S = 30.0
"""A motion that is slower is not told from biases."""
PARTS = 24
"""Parts of equal motion, for the jackknife."""
TERMS = 3
PRICE = 2.0
"""2Δ log likelihood a term must bring, over the logarithm of PARTS: what two parameters cost (BIC; Schwarz 1978)."""


@dataclass(frozen=True)
class Relative:
    """How N gyros answer to the motion relative to their mean: scale factor (1), delay (s) and curvature (s²).

    value      : [N, 3], posterior means of the terms; over the gyros each adds up to 0
    covariance : [3, N, N], for each term the covariance of the errors of `value`, about the mean of all
    spread     : [3], standard deviation of the true terms among gyros of this kind, as the recording shows it. The
                 error of the mean of all gyros is not seen; its standard deviation is spread/√N
    window     : samples of the window over which the motion is smoothed, odd
    gain       : scale of the plain mean of the gyros over that of the weighted mean that the motion is read from
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
    """Estimate N values, of which only the differences were measured, by shrinking them toward their mean.

    The values are taken as normal variables with one unknown variance (hierarchical Bayes).
    value   : [N], measured values, all with the same unknown number added;  error : [N, N], covariance of the
              measurement
    price   : 2Δ log likelihood by which a variance above zero must be better than none
    returns : posterior mean [N] about the mean of all, its covariance [N, N], and the standard deviation of the
              greatest likelihood; all zero where the differences are not worth their price
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


def relative_variance(array: ArrayRates, found: Relative, weights: Floats, delay_sd: float) -> Floats:
    """Variance [T], (deg/s)², of what the answers leave in Σu·y: of their errors, and of what all gyros share.

    weights : [N], Σ = 1;  delay_sd : of the delay that all share where it is known, s; NaN: as their spread has it
    """
    terms, common = motion_terms(array, reference(array, used(array))[0], found.window), found.common
    if math.isfinite(delay_sd):
        common[1] = delay_sd**2
    sizes = common + np.einsum("i,kij,j->k", weights, found.covariance, weights)
    variance: Floats = np.square(terms) @ sizes
    return variance

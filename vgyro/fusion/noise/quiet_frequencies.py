"""Covariance of the noise from the frequencies at which the motion is small, in any recording.

What all gyros have in common is in no difference. But the motion is in few frequencies, and the noise of N gyros has
N(N - 1)/2 covariances at every one. S(f) = Σ + 11'·S_w(f): the cross-spectra, weighed by the inverse square of how far
the array's rate stands out of the differences at f, are those of the noise and a little of 11'. Minimum-variance
weights do not feel 11'; how much of it is noise is told by the floor: motion falls with the frequency, white noise does
not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Bools, Floats, Ints
from vgyro.engine.cross_spectra import CrossSpectra, cross_spectra, window_length, window_starts
from vgyro.fusion.noise.difference_blocks import BlockMoments
from vgyro.fusion.types import ArrayRates

PARTS = 16
"""Parts of the recording, each with frequencies of its own at which it is quiet."""
SMOOTHED = 9
"""Lines over which a spectrum is averaged before it weighs anything."""
FAR = 4.0
"""A line so many times above what the other windows of its part say is weighed by itself."""
BANDS = 8
FLOOR = 3
"""The floor is the mean of so many of the lowest bands."""
FLAT = 0.15
"""Bands within this share of the floor are as low as it; where half of them are, the floor is noise."""
EFFICIENCY = 0.947
"""Samples that count, of windows with Hann's taper that overlap by half."""
FEWEST_WINDOWS = 4
MOSTLY = 0.5
MOST_COMMON = 0.9
"""Of what is common at most this share of the variance of the best combination is taken for motion."""


@dataclass(frozen=True)
class Quiet:
    """The covariance of the noise of N gyros, as the frequencies show it at which the motion is small.

    covariance : [N, N], in units of `variance`. A part that all gyros share, a multiple of the matrix of ones, may be
                 motion
    variance   : (deg/s)² a sample, mean square of the differences between the gyros
    samples    : number of independent samples that would tell as much
    lowest     : multiple of the matrix of ones without which the covariance is as low as its lowest frequencies show it
    flat       : half of the band is as low as those: then what is left there is white noise, and no motion
    """

    covariance: np.ndarray
    variance: float
    samples: float
    lowest: float
    flat: bool

    def noise(self, usual: np.ndarray) -> np.ndarray:
        """Covariance [N, N] of the noise alone.  usual [N, N] : correlations that it is likely to have.

        Where the floor is flat, it is noise. Else as much is motion as makes the usual correlation the median's, but no
        more noise is left than the floor allows.
        """
        best = 1.0 / float(np.linalg.pinv(self.covariance, hermitian=True).sum())
        most = MOST_COMMON * best
        shift = self.lowest if self.flat else max(self.lowest, _usual_shift(self.covariance, usual, most))
        return self.covariance - min(shift, most)


def quiet_noise(
    array: ArrayRates, weights: np.ndarray, good_in: Callable[[np.ndarray, int], np.ndarray]
) -> Quiet | None:
    """The noise of a recording where its motion is small; None: there are too few windows without a fault.

    weights [N] : about those of the least variance, Σ = 1
    good_in : first samples of windows [W], their length → which gyros are good in each [W, N]
    """
    stretches = array.stretches()
    length = window_length(array.rate_hz, max(part.stop - part.start for part in stretches))
    if length == 0:
        return None
    starts = window_starts(stretches, length)
    good = _together(good_in(starts, length))
    use = good.sum(axis=1) > 1
    starts, good = starts[use], good[use]
    if len(starts) < FEWEST_WINDOWS * 2:
        return None
    parts = min(PARTS, len(starts) // (2 * FEWEST_WINDOWS))
    place = np.arange(len(starts))
    # Windows that overlap are in one half of a part, the next ones in the other.
    group = 2 * (place * parts // len(starts)) + place // 2 % 2
    found = cross_spectra(list(array.rate.T), starts, length, good, group, array.rate_hz)
    return _weighed(found, weights)


def _together(good: np.ndarray) -> np.ndarray:
    """Good gyros [W, N] of windows in which all that are good in most windows are good, where half of them are left.

    The motion cancels in differences of spectra only if they are of the same windows.
    """
    usual = good.mean(axis=0) > MOSTLY
    whole = np.all(good[:, usual], axis=1, keepdims=True)
    both = good & usual & whole
    return both if usual.sum() > 1 and both.any(axis=1).mean() > MOSTLY else good


def good_blocks(moments: BlockMoments, starts: Ints, length: int) -> Bools:
    """[W, N]: no block of the window is excluded."""
    bad = np.concatenate([np.zeros((1, moments.excluded.shape[1])), np.cumsum(moments.excluded, axis=0)])
    first = np.searchsorted(moments.stop, starts, side="right")
    last = np.searchsorted(moments.start, starts + length, side="left")
    good: Bools = np.equal(bad[last], bad[first])
    return good


def _weighed(found: CrossSpectra, weights: np.ndarray) -> Quiet | None:
    gyros = len(weights)
    own = np.einsum("gii->gi", found.windows)
    groups = np.flatnonzero((own > 0).sum(axis=1) > 1)
    total, windows = found.total[groups], found.windows[groups]
    density = total / np.maximum(windows, 1.0)[:, None]
    share = weights * (own[groups] > 0)
    share /= np.maximum(share.sum(axis=1, keepdims=True), 1e-12)
    level = _smoothed(np.einsum("gfij,gi,gj->gf", density, share, share))
    apart = own[groups] > 0
    number = apart.sum(axis=1)
    centred = np.einsum("gi,ij->gij", apart, np.eye(gyros)) - apart[:, :, None] * share[:, None, :]
    between = _smoothed(np.einsum("gki,gfij,gkj->gf", centred, density, centred, optimize=True)) / number[:, None]
    if not (between > 0).all():
        return None
    ratio = level / between
    other = np.arange(len(groups)) ^ 1
    paired = (other < len(groups)) & np.isin(groups ^ 1, groups)
    others = np.where(paired[:, None], ratio[np.minimum(other, len(groups) - 1)], ratio)
    weight = 1.0 / np.maximum(others, ratio / FAR) ** 2
    mass = np.einsum("gf,gij->ij", weight, windows)
    pairs = np.where(mass > 0, np.einsum("gf,gfij->ij", weight / between, total) / np.where(mass > 0, mass, 1.0), 0.0)
    used = np.einsum("gi->g", own[groups]) / np.maximum(number, 1)
    count = weight * used[:, None]
    samples = EFFICIENCY * found.length / 2.0 * float(used.sum())
    samples *= float(count.sum()) ** 2 / (float(used.sum()) * weight.shape[1] * float((count * weight).sum()))
    bands = np.array([
        float(np.sum(one * two) / one.sum())
        for one, two in zip(np.array_split(count, BANDS, axis=1), np.array_split(ratio, BANDS, axis=1), strict=True)
    ])  # fmt: skip
    mean = float(np.sum(count * ratio) / count.sum())
    floor = float(np.sort(bands)[:FLOOR].mean())
    flat = bool((bands <= floor * (1.0 + FLAT)).sum() >= BANDS // 2)
    variance = float(np.sum(count * between) / count.sum())
    return Quiet(pairs, variance, samples, mean - floor, flat)


def _smoothed(values: Floats) -> Floats:
    """Means [G, F] over SMOOTHED neighbours."""
    side = SMOOTHED // 2
    padded = np.pad(values, ((0, 0), (side, side)), mode="edge")
    sums = np.cumsum(np.pad(padded, ((0, 0), (1, 0))), axis=1)
    return (sums[:, SMOOTHED:] - sums[:, :-SMOOTHED]) / SMOOTHED


def _usual_shift(covariance: np.ndarray, usual: np.ndarray, most: float) -> float:
    """What of 11' is to be taken off, so that the median of the correlations less the usual ones is zero."""
    first, second = np.triu_indices(len(covariance), 1)

    def median(shift: float) -> float:
        sigma = np.sqrt(np.maximum(np.diag(covariance) - shift, 1e-12))
        seen = (covariance[first, second] - shift) / (sigma[first] * sigma[second])
        return float(np.median(seen - usual[first, second]))

    low, high = -float(np.abs(covariance).max()), most
    if median(high) > 0:
        return high
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if median(middle) > 0 else (low, middle)
    return low


def against(quiet: Quiet, expected: np.ndarray) -> float:
    """How much better the covariance that was seen explains the recording than an expected one.

    expected : [N, N], covariance of the noise in units of quiet.variance; a part that all gyros share is added to it as
               the likelihood likes, since it may be motion
    returns  : 2Δ log likelihood of quiet.covariance over it, less the price of its parameters (BIC; Schwarz 1978)
    """
    gyros = len(expected)
    inverse = np.linalg.inv(expected)
    total = inverse.sum(axis=1)
    seen = quiet.covariance
    # The most likely multiple: the variance of the best combination that is seen, over its own.
    mass = float(total.sum())
    more = max(float(total @ seen @ total) / mass**2 - 1.0 / mass, 0.0)
    inverse = inverse - more / (1.0 + more * mass) * np.outer(total, total)
    ratio = inverse @ seen
    sign, log = np.linalg.slogdet(ratio)
    if sign <= 0:
        return -np.inf
    free = gyros * (gyros + 1) // 2 - 1 - (gyros if gyros > 2 else 1)
    return quiet.samples * float(np.trace(ratio) - log - gyros) - free * float(np.log(quiet.samples))

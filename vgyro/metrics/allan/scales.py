"""Allan covariances of an array at rest over the averaging time, for the methods that combine gyros by them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.errors import TooShort
from vgyro.metrics.allan.deviation import LEAST_USED
from vgyro.metrics.allan.slots import SlotSums
from vgyro.metrics.sampling import Sampling

LONGEST_TAU = 4  # the longest τ is a fourth of the longest stretch: half of it then holds differences
MOST_DIFFERENCES = 1 << 17  # of one τ: the variance of more of them is no better known than the noise is steady
MOST_LACKING = 0.1  # of a gyro's samples: a mean counts where nine tenths of its samples are there


@dataclass(frozen=True)
class Scales:
    """tau [J] s; covariance [J, N, N] (deg/s)², NaN for a gyro with too few values; pairs [J] of means."""

    tau: np.ndarray
    covariance: np.ndarray
    pairs: np.ndarray


def allan_scales(
    series: Sequence[np.ndarray], sampling: Sampling, engine: str = "native", lacking: Sequence[int] = ()
) -> Scales:
    """Overlapping Allan covariances at τ of 1, 2, 4, … samples.

    series   : N arrays [T], deg/s, at rest, of which one at a time is held;  sampling : when they were taken
    lacking  : places of gyros that are NaN in some samples: these samples are left out for all; a gyro that lacks more
               than a tenth of them is left out itself
    returns  : Scales, C_ij(τ) = ½⟨d_i d_j⟩, d the difference of adjacent means over τ; of more than 131,072 differences
               at one τ so many, evenly spread. Half of it is the wavelet covariance of the Haar MODWT at that scale.
    raises   : TooShort if no stretch has four samples, or losses leave too few differences at every τ
    Vaccaro & Zaki (2017), Sensors 17, 352, eq. 23; Zhang et al. (2022), arXiv 2106.15997.
    """
    present, gone = _present(series, len(sampling), lacking)
    sampling = sampling.without(gone) if gone.any() else sampling
    slot, edges = sampling.slots()
    slots = np.diff(edges)
    longest = int(slots.max(initial=0))
    factors = 2 ** np.arange((longest // LONGEST_TAU).bit_length())
    if len(factors) == 0 or not present:
        raise TooShort(f"the longest stretch has {longest} samples", remedy="4 in a row are needed")
    allan = engines.get(engine).allan
    strides = [-(-int(np.maximum(slots - 2 * m + 1, 0).sum()) // MOST_DIFFERENCES) for m in factors.tolist()]
    found: list[list[np.ndarray]] = [[] for _ in factors]
    share = np.zeros(len(factors))
    for place in present:
        column = np.asarray(series[place], dtype=float)
        sums = SlotSums.of(column[~gone] if gone.any() else column, slot, edges, allan)
        for row, (m, stride) in enumerate(zip(factors.tolist(), strides, strict=True)):
            d, _, possible = sums.differences(m, stride, 2)
            found[row].append(d)
            share[row] = len(d) / max(possible, 1)
    good = np.flatnonzero(share >= LEAST_USED)
    if len(good) == 0:
        raise TooShort("lost samples leave too few differences at every τ", remedy="Look for a less damaged recording")
    covariance = np.full((len(good), len(series), len(series)), np.nan)
    for matrix, row in zip(covariance, good.tolist(), strict=True):
        d = np.column_stack(found[row])
        matrix[np.ix_(present, present)] = d.T @ d / (2 * len(d))
    pairs = share[good] * np.maximum(slots / factors[good, None] - 1, 0).sum(axis=1)
    return Scales(factors[good] / sampling.rate_hz, covariance, pairs)


def _present(series: Sequence[np.ndarray], samples: int, lacking: Sequence[int]) -> tuple[list[int], np.ndarray]:
    """Places of the gyros that have nearly all values; the samples [T] that one of these lacks."""
    gone, present = np.zeros(samples, dtype=bool), []
    for place in range(len(series)):
        missing = np.isnan(series[place]) if place in lacking else np.zeros(1, dtype=bool)
        if missing.mean() <= MOST_LACKING:
            present.append(place)
            gone |= missing
    return present, gone

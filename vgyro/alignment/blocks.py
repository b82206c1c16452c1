"""Blocks of ten seconds: each has its own level and slope, so that slow drift between gyros does not matter."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri, stdtrit

from vgyro.arrays import Floats
from vgyro.runs import runs

BLOCK_S = 10.0
SHORTEST_S = 2.0
SMOOTHING_HZ = 1.0  # greatest width over which the spectrum of the residual is averaged
SMOOTHING_BINS = 40  # bins times blocks that are averaged: a red residual is not diluted where blocks are many
FEWEST_FOR_OWN = 8  # blocks that carry the sum, for their own sums to tell its variance


def block_numbers(time: np.ndarray, segment: np.ndarray, length_s: float = BLOCK_S) -> np.ndarray:
    """Number of the block of each sample: time [K] s, segment [K] → int [K]; no block goes across a gap.

    A stretch is cut into equal blocks of about length_s.
    """
    number = np.zeros(len(time), dtype=np.int64)
    first = 0
    for start, stop in runs(segment).tolist():
        whole = time[stop - 1] - time[start] + 1e-9
        count = max(round(whole / length_s), 1)
        inside = ((time[start:stop] - time[start]) * (count / whole)).astype(np.int64)
        number[start:stop] = first + np.minimum(inside, count - 1)
        first += count
    return number


class SampleBlocks:
    """Samples in blocks. Every array is [K] or [C, K], with samples last; values per block are [B] or [C, B].

    rows   : int [K], places of the samples in their evenly spaced series, rising
    number : int [K], block of each
    step_s : time between samples
    """

    def __init__(self, rows: np.ndarray, number: np.ndarray, step_s: float) -> None:
        names, self.block = np.unique(number, return_inverse=True)
        self.rows, self.count, self.step_s = rows, len(names), step_s
        self.size = np.bincount(self.block, minlength=self.count).astype(float)
        first = np.zeros(self.count, dtype=np.int64)
        first[self.block[::-1]] = rows[::-1]
        self.place = rows - first[self.block]
        self.length = int(self.place.max(initial=0)) + 1
        middle = self.sums(self.place.astype(float)) / self.size
        self.lever = self.place - middle[self.block]
        self.spread = np.maximum(self.sums(self.lever**2), 1e-12)

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Sum within each block."""
        if values.ndim == 1:
            return np.bincount(self.block, values, minlength=self.count)
        return np.stack([np.bincount(self.block, row, minlength=self.count) for row in values])

    def detrended(self, values: Floats) -> Floats:
        """Values less the straight line of their block."""
        level = (self.sums(values) / self.size)[..., self.block]
        slope = (self.sums(values * self.lever) / self.spread)[..., self.block]
        rest: Floats = values - level - slope * self.lever
        return rest

    def spectra(self, values: np.ndarray) -> np.ndarray:
        """Transform of each block, padded to twice its length: [..., B, F]."""
        grid = np.zeros((*values.shape[:-1], self.count, self.length))
        grid[..., self.block, self.place] = values
        return np.fft.rfft(grid, self.padded, axis=-1)

    @property
    def padded(self) -> int:
        """Length of the transforms."""
        return 2 * self.length

    @property
    def bins(self) -> np.ndarray:
        """How often each bin of a real transform counts: [F]."""
        weight = np.full(self.padded // 2 + 1, 2.0)
        weight[[0, -1]] = 1.0
        return weight

    def smoothed(self, spectrum: Floats, effective: float) -> Floats:
        """A power spectrum [..., F] of so many blocks, averaged over neighbouring bins."""
        width = int(min(SMOOTHING_HZ * self.padded * self.step_s, max(SMOOTHING_BINS / effective, 3))) | 1
        width = min(width, 2 * (spectrum.shape[-1] // 2) - 1)
        padded = np.concatenate(
            (spectrum[..., width // 2 : 0 : -1], spectrum, spectrum[..., -2 : -2 - width // 2 : -1]), axis=-1
        )
        total = np.cumsum(np.concatenate((np.zeros((*padded.shape[:-1], 1)), padded), axis=-1), axis=-1)
        means: Floats = (total[..., width:] - total[..., :-width]) / width
        return means


def score_covariance(blocks: SampleBlocks, slopes: Floats, residual: Floats) -> Floats:
    """Covariance of the sums Σ slopes · residual, [P, P].

    slopes : array [P, K], known; residual : array [K], stationary with any colour within a block
    The larger, in each direction of a parameter, of two estimates: that of a residual of one colour (its spectrum
    averaged over blocks, by their part in the sum, and over up to 1 Hz) and that of the blocks' own sums (White's).
    Where few blocks carry the sum it is widened, so that 1.96 standard errors cover 95 % (Student's t, four degrees of
    freedom a block).
    """
    weight = blocks.sums(slopes[0] ** 2)
    weight = weight / weight.sum()
    power = np.abs(blocks.spectra(residual)) ** 2 / blocks.size[:, None]
    effective = 1 / (weight**2).sum()
    colour = blocks.smoothed(weight @ power, effective)
    transforms = blocks.spectra(slopes)
    bins = blocks.bins / blocks.padded
    even: Floats = np.einsum("pbf,qbf,f->pq", transforms, transforms.conj(), colour * bins, optimize=True).real
    even *= (float(stdtrit(4 * effective, 0.975)) / float(ndtri(0.975))) ** 2
    if effective < FEWEST_FOR_OWN:
        return even
    own = blocks.sums(slopes * residual)
    own = own @ own.T * effective / (effective - len(slopes))
    factor = np.sqrt(np.maximum(np.diag(own) / np.diag(even), 1.0))
    covariance: Floats = even * np.outer(factor, factor)
    return covariance


def independent_values(blocks: SampleBlocks, one: np.ndarray, two: np.ndarray) -> float:
    """How many independent pairs of values two series are worth: [K], [K] → 1 / variance of their correlation.

    If they have nothing in common. Bartlett (1946), J. R. Stat. Soc. Suppl. 8(1), within each block, and within each
    quarter of a block: long blocks take a burst for a longer series, short ones a steady tone for several. The fewer.
    """
    quarter = blocks.block * 4 + blocks.place * 4 // blocks.length
    parts = SampleBlocks(blocks.rows, quarter, blocks.step_s)
    power = (one @ one) * (two @ two)
    return float(power / max(_product_variance(blocks, one, two), _product_variance(parts, one, two), 1e-300))


def _product_variance(blocks: SampleBlocks, one: np.ndarray, two: np.ndarray) -> float:
    products = []
    for values in (one, two):
        power = np.abs(blocks.spectra(values)) ** 2
        products.append(np.fft.irfft(power, blocks.padded, axis=-1)[:, : blocks.length])
    pairs = np.maximum(blocks.size[:, None] - np.arange(blocks.length), 1.0)
    terms = products[0] * products[1] / pairs
    return float(terms[:, 0].sum() + 2 * terms[:, 1:].sum())

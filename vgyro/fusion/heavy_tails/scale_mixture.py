"""Symmetric densities with tails of any weight: mixtures of normal densities of different sizes, Σ π_k·N(0, κ_k²)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats

LOWEST, HIGHEST, PER_OCTAVE = -12, 52, 8
"""Bins of log2 x²: from 1/64 of the usual size to 6e7 times it, each 9 % wide; what lies beyond is in the last one."""
BINS = (HIGHEST - LOWEST) * PER_OCTAVE
SMALLEST = 0.25
"""κ of the smallest component; the others follow in steps of √2."""
APART = 4.0
"""Least κ of samples far off beside a normal density."""
ROUNDS = 300
LEAST_SHARE = 1e-12
"""Smaller components are none."""


@dataclass(frozen=True)
class ScaleMixture:
    """A density of x in units of a gyro's usual deviation.

    sizes, shares [K] : κ and π
    pull [BINS + 1]   : -f'(x)/(x·f(x)) at the lower border of each bin, 1 for a standard normal density
    information       : Fisher information for location, E[(f'/f)²]; 1 for a standard normal density
    """

    sizes: np.ndarray
    shares: np.ndarray
    pull: np.ndarray
    information: float

    @classmethod
    def of(cls, sizes: np.ndarray, shares: np.ndarray) -> ScaleMixture:
        """From its components."""
        kept = shares > LEAST_SHARE
        sizes, shares = sizes[kept], shares[kept] / shares[kept].sum()
        borders = np.exp2(LOWEST + np.arange(BINS + 1) / PER_OCTAVE)
        log_density, pull = _log_density(borders, sizes, shares)
        # E[ψ²] over both sides of zero, ψ = pull·x, by the trapezoidal rule in x.
        x = np.sqrt(borders)
        information = 2.0 * float(np.trapezoid((pull * x) ** 2 * np.exp(log_density), x)) / math.sqrt(2.0 * math.pi)
        return cls(sizes, shares, pull, information)

    @classmethod
    def normal(cls) -> ScaleMixture:
        """The standard normal density."""
        return cls.of(np.ones(1), np.ones(1))

    def weight(self, square: Floats) -> Floats:
        """-f'(x)/(x·f(x)) at squares x² of any shape: how much a sample so far off counts."""
        if len(self.sizes) == 1:
            return np.full(square.shape, self.pull[0])
        place = _place(square)
        below = place.astype(np.int32)
        step = np.diff(self.pull, append=self.pull[-1])
        weight: Floats = self.pull[below] + (place - below) * step[below]
        return weight

    def log_density(self, square: np.ndarray) -> np.ndarray:
        """log f(x) + ½·log 2π at squares x² [n]."""
        return _log_density(square, self.sizes, self.shares)[0]

    def parameters(self, samples: float) -> int:
        """Numbers that it takes beside its scale: of the components of half a sample or more, but for one."""
        return 2 * (int((self.shares > 0.5 / samples).sum()) - 1)


def histogram(square: np.ndarray) -> np.ndarray:
    """Squares x² → counts [BINS]."""
    return np.bincount(_place(square).astype(np.int32).ravel(), minlength=BINS)[:BINS].astype(float)


def fitted(counts: np.ndarray) -> ScaleMixture:
    """The density of counts [BINS] of x²: a normal one with samples far off, or one with tails of any weight.

    Each has the greatest likelihood of its kind; the second must pay for its parameters (BIC; Schwarz 1978).
    """
    seen = np.flatnonzero(counts)
    highest = math.ceil(2.0 * max(0.5 * math.log2(float(middles()[seen[-1]])), 1.0))
    sizes = np.exp2(0.5 * np.arange(2.0 * math.log2(SMALLEST), highest + 1))
    apart = _most_likely(counts, np.append(1.0, sizes[sizes >= APART]))
    spread = _most_likely(counts, sizes)
    samples = float(counts.sum())
    scores = [
        2.0 * float(counts @ one.log_density(middles())) - one.parameters(samples) * math.log(samples)
        for one in (apart, spread)
    ]
    return spread if scores[1] > scores[0] else apart


def _most_likely(counts: np.ndarray, sizes: np.ndarray) -> ScaleMixture:
    """Shares of the greatest likelihood for components of the sizes [K], by EM from equal shares on.

    The likelihood of the shares is concave: there is one maximum. Kiefer & Wolfowitz (1956), Ann. Math. Statist. 27,
    887-906; Laird (1978), J. Am. Statist. Assoc. 73, 805-811.
    """
    seen = np.flatnonzero(counts)
    exponent = -0.5 * middles()[seen, None] / sizes**2 - np.log(sizes)
    likelihood = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    part = counts[seen] / counts.sum()
    shares = np.full(len(sizes), 1.0 / len(sizes))
    for _ in range(ROUNDS):
        shares = shares * ((part / (likelihood @ shares)) @ likelihood)
    return ScaleMixture.of(sizes, shares)


def middles() -> np.ndarray:
    """x² in the middle of each bin [BINS]."""
    return np.exp2(LOWEST + (np.arange(BINS) + 0.5) / PER_OCTAVE)


def _place(square: Floats) -> Floats:
    """Place of each square among the borders of the bins, 0 to just under BINS."""
    with np.errstate(divide="ignore"):
        place = (np.log2(square) - LOWEST) * PER_OCTAVE
    return np.clip(place, 0.0, BINS - 1e-3, out=place)


def _log_density(square: np.ndarray, sizes: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """log f(x) + ½·log 2π and -f'(x)/(x·f(x)) at squares x² [n]."""
    logs = -0.5 * square[:, None] / sizes**2 + np.log(shares / sizes)
    highest = logs.max(axis=1, keepdims=True)
    parts = np.exp(logs - highest)
    total = parts.sum(axis=1)
    return highest[:, 0] + np.log(total), (parts @ sizes**-2.0) / total

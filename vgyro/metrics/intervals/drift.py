"""Noise of several series together, fitted to their Allan covariances, and drawn again: what blocks cannot resample."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from vgyro.arrays import Floats, Ints
from vgyro.metrics.allan.coefficient_limits import Drawing
from vgyro.metrics.allan.covariance import CrossAllan
from vgyro.metrics.allan.deviation import LONGEST_TAU

MOST_BLOCKS = 1024
FEWEST_TAUS = 4
EVIDENCE = 0.05
KNOWN_AT = 0.6  # of the longest τ: a fifth of the recording
FEWEST_FREEDOM = 3.0
FLICKER = 2 * math.log(2) / math.pi
PASSES, SWEEPS = 3, 60
BATCH = 1 << 19  # numbers that are drawn together
SMALL = 1e-9


@dataclass(frozen=True)
class DriftModel:
    """Covariances [S, S] of white noise (deg/s)²/Hz, flicker (deg/s)² and random walk (deg/s)²/s of S series.

    freedom : degrees of freedom that the size of flicker and walk is known with
    """

    white: np.ndarray
    flicker: np.ndarray
    walk: np.ndarray
    freedom: float

    @property
    def drifts(self) -> bool:
        """Is there flicker or a random walk?"""
        return bool(self.flicker.any() or self.walk.any())

    def variances(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Allan variances at tau [M] of the white noise, and of flicker and walk, each [M, S]."""
        white, flicker, walk = (np.diag(matrix) for matrix in (self.white, self.flicker, self.walk))
        basis = _basis(tau)
        return np.outer(basis[:, 0], white), np.outer(basis[:, 1], flicker) + np.outer(basis[:, 2], walk)

    def correlation(self, tau: float) -> np.ndarray:
        """Correlation [S, S] of the Allan variations at tau, s; 0: of the white noise."""
        white, flicker, walk = _basis(np.array([tau]))[0] if tau > 0 else (1.0, 0.0, 0.0)
        covariance = white * self.white + flicker * self.flicker + walk * self.walk
        scale = np.sqrt(np.diag(covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            found = np.where(np.outer(scale, scale) > 0, covariance / np.outer(scale, scale), 0.0)
        return np.clip(found, -1, 1)


@dataclass(frozen=True)
class Drawn:
    """R replicates of S series over the whole recording, in deg/s; beside each what the model that it is of expects.

    mean     [R, S] : mean about the bias that the series began with
    variance [R, S] : of the means of blocks of block_s about their mean;  variance_expected [R, S]
    lowest   [R, S] : minimum of the Allan deviation from τ = block_s on;  lowest_expected [R, S]
    """

    mean: np.ndarray
    variance: np.ndarray
    variance_expected: np.ndarray
    lowest: np.ndarray
    lowest_expected: np.ndarray
    block_s: float

    def scaled(self, factor: np.ndarray) -> Drawn:
        """The draws of series that are so many times as large [S]."""
        return Drawn(
            self.mean * factor, self.variance * factor**2, self.variance_expected * factor**2, self.lowest * factor,
            self.lowest_expected * factor, self.block_s,
        )  # fmt: skip

    def only(self, series: list[int]) -> Drawn:
        """The draws of some of the series."""
        names = ("mean", "variance", "variance_expected", "lowest", "lowest_expected")
        return replace(self, **{name: getattr(self, name)[:, series] for name in names})


def fit_drift(found: CrossAllan, singles: int, shortest: float = 0.0) -> DriftModel | None:
    """White noise, flicker and random walk with their covariances, from Allan covariances of S series, deg/s.

    singles  : the first so many series are gyros, which decide whether there is a drift
    shortest : τ below are left out, s (a low-pass is felt there)
    returns  : None where there are too few τ; without flicker and walk where the gyros do not show a drift: a term that
               may not be negative would be found in white noise, too
    Least squares of C(τ) = W/τ + (2 ln2/π)F + Kτ/3 with weights edf/σ⁴, each matrix positive semidefinite: one is
    fitted at a time and cut at zero, until it settles. What such a fit says of the variance of the mean of the whole
    recording scatters as chi² with the degrees of freedom that σ² has at a fifth of the recording (by simulation 3.2;
    the edf of a random walk there is 3.1).
    """
    freedom = np.diagonal(found.edf, axis1=1, axis2=2)[:, :singles].mean(axis=1)
    used = (found.tau >= shortest * (1 - SMALL)) & (freedom >= 1)
    tau, covariance, edf = found.tau[used], found.covariance[used], freedom[used]
    if len(tau) < FEWEST_TAUS or not np.all(np.diagonal(covariance[0]) > 0):
        return None
    terms = 3 if _drifts(tau, covariance[:, :singles, :singles], edf) else 1
    white, flicker, walk = _fit(tau, covariance, edf, terms)
    known = edf[max(int(np.searchsorted(tau, KNOWN_AT * tau[-1], side="right")) - 1, 0)]
    return DriftModel(white, flicker, walk, max(float(known), FEWEST_FREEDOM))


def _drifts(tau: np.ndarray, covariance: np.ndarray, edf: np.ndarray) -> bool:
    """Is the Allan covariance [M, N, N] above that of white noise at any τ?

    C(τ₀)⁻¹·C(τ)·τ/τ₀ has the mean trace N of white noise, as chi² with N·edf degrees of freedom; τ₀ is the shortest τ.
    """
    from scipy.special import chdtrc

    trace = np.trace(np.linalg.pinv(covariance[0], hermitian=True) @ covariance, axis1=1, axis2=2) * tau / tau[0]
    rank = np.linalg.matrix_rank(covariance[0], hermitian=True)
    p_value = chdtrc(rank * edf[1:], trace[1:] * edf[1:])
    octaves = max(math.log2(tau[-1] / tau[0]), 1.0)
    return bool(p_value.min() < EVIDENCE / octaves)


def draw(model: DriftModel, stretches: int, seconds: float, taus: np.ndarray, unit_s: float, drawing: Drawing) -> Drawn:
    """Draw the series of a model again and again.

    stretches : how many, each `seconds` long; noise of one does not go on in the next
    taus      : at which the Allan deviation is looked at, s, rounded to blocks;  unit_s : shortest block, s
    """
    block_s = unit_s * max(math.ceil(stretches * seconds / unit_s / MOST_BLOCKS), 1)
    blocks = max(int(seconds / block_s), 1)
    factors = np.unique(np.round(taus / block_s).astype(int))
    factors = factors[(factors >= 1) & (factors <= blocks // LONGEST_TAU)]
    found: list[tuple[np.ndarray, ...]] = []
    sizes: list[np.ndarray] = []
    generator = np.random.default_rng(drawing.seed)
    for white, drift in _series(model, stretches, blocks, block_s, drawing.replicates, generator):
        # How large the drift is, is not known: its variance is freedom/χ² times the one found.
        size, series = np.ones(len(white)), white
        apart = [_variance(white), np.zeros(white.shape[:2])]
        if drift is not None:
            size = model.freedom / generator.chisquare(model.freedom, len(white))
            series = white + drift * np.sqrt(size)[:, None, None, None]
            apart[1] = _variance(drift)
        found.append((series.mean(axis=(-2, -1)), _variance(series), _lowest(series, factors), *apart))
        sizes.append(size)
    mean, variance, lowest, of_white, of_drift = (np.concatenate(part) for part in zip(*found, strict=True))
    share = np.concatenate(sizes)[:, None]
    expected = of_white.mean(axis=0) + share * of_drift.mean(axis=0)
    curve, rise = model.variances(factors * block_s)
    minimum = np.sqrt(np.min(curve[:, None] + share * rise[:, None], axis=0, initial=math.inf))
    return Drawn(mean, variance, expected, lowest, minimum, block_s)


def _variance(series: Floats) -> Floats:
    """Variance [r, S] of block means [r, S, stretches, blocks] about the mean of their stretch."""
    variance: Floats = np.var(series, axis=-1).mean(axis=-1)
    return variance


def _basis(tau: np.ndarray) -> np.ndarray:
    return np.column_stack([1 / tau, np.full(len(tau), FLICKER), tau / 3])


def _fit(tau: Floats, covariance: Floats, edf: Floats, number: int) -> Floats:
    """White, flicker and walk [3, S, S];  number : of these that are fitted, the others are 0"""
    scale = np.sqrt(np.diagonal(covariance[0]) * tau[0])
    scale = np.where(scale > 0, scale, 1.0)
    size = np.outer(scale, scale)
    target = covariance / size
    basis = _basis(tau)
    terms = np.zeros((3, *size.shape))
    level = np.trace(target, axis1=1, axis2=2)
    for _ in range(PASSES):
        weights = edf / np.maximum(level, SMALL * level.max()) ** 2
        left = np.tensordot((weights[:, None] * basis).T, target, axes=1)
        gram = (weights[:, None] * basis).T @ basis
        for _ in range(SWEEPS):
            for term in range(number):
                others = left[term] - sum(gram[term, other] * terms[other] for other in range(number) if other != term)
                terms[term] = _positive(others / gram[term, term])
        level = basis @ np.trace(terms, axis1=1, axis2=2)
    fitted: Floats = terms * size
    return fitted


def _positive(matrix: Floats) -> Floats:
    values, vectors = np.linalg.eigh(matrix)
    positive: Floats = (vectors * np.maximum(values, 0)) @ vectors.T
    return positive


def _root(matrix: Floats) -> Floats:
    """[S, r] with root·root' = matrix, r its rank."""
    values, vectors = np.linalg.eigh(matrix)
    there = values > SMALL * max(values[-1], 0)
    root: Floats = vectors[:, there] * np.sqrt(values[there])
    return root


def _series(
    model: DriftModel, stretches: int, blocks: int, block_s: float, replicates: int, generator: np.random.Generator
) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
    """Block means [r, S, stretches, blocks] of some replicates at a time: of white noise, and of drift (None: none)."""
    white, flicker, walk = (_root(matrix) for matrix in (model.white, model.flicker, model.walk))
    shape = len(model.white), stretches, blocks
    some = max(BATCH // math.prod(shape), 1)
    for first in range(0, replicates, some):
        count = min(some, replicates - first)
        noise = _mixed(white, generator.standard_normal((count, white.shape[1], *shape[1:]))) / math.sqrt(block_s)
        drift = None
        if model.drifts:
            steps = generator.standard_normal((count, walk.shape[1], *shape[1:]))
            # A walk's mean over a block: halfway between its ends, and what it wanders between them (Brownian bridge).
            means = np.cumsum(steps, axis=-1) - steps / 2 + generator.standard_normal(steps.shape) / math.sqrt(12)
            drift = _mixed(walk, means) * math.sqrt(block_s)
            drift += _mixed(flicker, _unit_flicker(generator, (count, flicker.shape[1], stretches), blocks))
        yield noise, drift


def _mixed(root: Floats, unit: Floats) -> Floats:
    """root [S, r] · unit [n, r, stretches, blocks] → [n, S, stretches, blocks]."""
    count, rank, *rest = unit.shape
    return (root @ unit.reshape(count, rank, math.prod(rest))).reshape(count, len(root), *rest)


def _unit_flicker(generator: np.random.Generator, shape: tuple[int, ...], blocks: int) -> Floats:
    """Flicker noise with B = 1, density 1/(2πf), by normal Fourier coefficients over twice the length."""
    from scipy.fft import irfft, next_fast_len

    length = next_fast_len(2 * blocks, real=True)
    bins = np.maximum(np.arange(length // 2 + 1), 1)
    spectrum = generator.standard_normal((*shape, 2 * len(bins))).view(complex)
    spectrum *= length / np.sqrt(4 * np.pi * bins)
    spectrum[..., 0] = 0
    flicker: Floats = irfft(spectrum, length, overwrite_x=True)[..., :blocks]
    return flicker


def _lowest(series: Floats, factors: Ints) -> Floats:
    """Lowest Allan deviation [r, S] of block means [r, S, stretches, blocks] at averaging factors."""
    angle = np.zeros((*series.shape[:-1], series.shape[-1] + 1))
    np.cumsum(series, axis=-1, out=angle[..., 1:])
    lowest = np.full(series.shape[:2], math.inf)
    for factor in factors.tolist():
        step = angle[..., factor:] - angle[..., :-factor]
        difference = step[..., factor:] - step[..., :-factor]
        mean = np.einsum("rsnt,rsnt->rs", difference, difference) / difference[0, 0].size
        np.minimum(lowest, mean / (2 * factor**2), out=lowest)
    deviation: Floats = np.sqrt(lowest)
    return deviation

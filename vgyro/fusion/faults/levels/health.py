"""How far the bias of each gyro wanders in health: a small hierarchical Bayes over the array.

A gyro's residual in coarse means is white noise, flicker and random walk about a level that may change once: on a
ramp, at once, or for a while. So a fault is no wander. The gyros of an array are mostly of one kind: what the others
do is the prior of each one's flicker and walk, which half an hour of its own tells roughly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import helmert

from vgyro.arrays import Floats
from vgyro.fusion.faults.candidate import lengths_up_to
from vgyro.fusion.faults.levels.drift_variance import Slow
from vgyro.runs import runs

POINTS = 96
FEWEST_POINTS = 4
FLICKERS = 4.0 ** np.arange(-4, 6)
WALKS = 4.0 ** np.arange(-7, 7)
"""Variances in units of the white part of a coarse mean: of the difference of neighbouring means, and of a step."""
LIKENESS = np.array([0.5, 1.0, 2.0])
"""Standard deviations of the logarithms of these variances among gyros of a kind."""
ODD = 0.003
"""Share of gyros that are of no kind with the others."""
POWER = 0.25
"""Of drifts in 600 s, 22 of 25 are found with it, 21 with 0.5, 23 with the mean logarithm. Of 20 arrays with a gyro of
ten times the others' walk that gyro is accused in one with it (7.2 σ), with the mean logarithm in two of 24."""
CHANGED = 0.5
"""Prior probability of a change of level in a run."""
CHANGE_SD = 5.0
"""Size of a change, standard deviations of the mean of one block."""
UNKNOWN = 20
"""Power of four: variance of a mean of nothing, in units of the usual one."""


@dataclass(frozen=True)
class DriftGrid:
    """The likelihoods of all pairs of F flickers and W random walks, made ready for series of n points.

    It serves every series whose points have the same variances of their white parts relative to each other. With any
    level taken out, one basis makes the covariances of all walks beside one flicker diagonal.
    basis     : [F, n-1, n] of independent parts of the points;  precision : [F, W, n-1], inverse variances of these
    log_norm  : [F, W], logarithm of the determinants that belongs to them
    changes   : [F, n-1, T], forms that a change of level may have, in that basis
    gain      : [F, W, T], what a change gains for the square of its product with the points
    log_prior : [F, W, T], logarithm of the probability of each form, less what its unknown size costs
    """

    basis: np.ndarray
    precision: np.ndarray
    log_norm: np.ndarray
    changes: np.ndarray
    gain: np.ndarray
    log_prior: np.ndarray

    def log_likelihood(self, mean: Floats) -> Floats:
        """Log likelihood [F, W] of the points, with one change of level or none.

        mean : [n], means in units of the root of their usual white variance
        """
        parts = self.basis @ mean
        weighted = self.precision * parts[:, None, :]
        steady = -0.5 * (self.log_norm + (weighted @ parts[:, :, None])[:, :, 0])
        changed = (weighted @ self.changes) ** 2 * self.gain + self.log_prior
        most = changed.max(axis=2, keepdims=True)
        log_sum = most[:, :, 0] + np.log(np.exp(changed - most).sum(axis=2))
        likelihood: Floats = steady + np.logaddexp(np.log1p(-CHANGED), np.log(CHANGED) + log_sum)
        return likelihood


def covariances(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Covariances of the means of n neighbouring stretches of one length, for flicker noise and for a random walk.

    returns : flicker [n, n], such that neighbouring means differ by the variance 1; walk [n, n], such that a step from
              one stretch to the next has the variance 1. FLICKERS and WALKS are multiples of these
    1/f noise has the covariance -ln|t| up to a constant, which is a level; its second integral is t²/2·ln|t| - 3/4·t².
    """
    lag = np.arange(points + 1, dtype=float)
    double = np.where(lag > 0, lag**2 * (0.5 * np.log(np.maximum(lag, 1.0)) - 0.75), 0.0)
    row = -(double[1:] - 2.0 * double[:-1] + np.append(double[1], double[:-2])) / (4.0 * np.log(2.0))
    places = np.arange(points)
    flicker = row[np.abs(places[:, None] - places)]
    walk = np.minimum(places[:, None], places) + 0.5 - np.eye(points) / 6.0
    return flicker - row[-1], walk


def changes_of_level(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Ramps and jumps to a new level, and levels that return [n, T], of size 1; logarithms of their prior [T].

    The three sorts are equally likely.
    """
    middle = np.arange(points) + 0.5
    rises = sorted({rise for length in lengths_up_to(points) for rise in (length, 3 * length // 2) if rise > 1})
    ramps = [
        np.clip((middle - begin) / rise, 0.0, 1.0)
        for rise in rises
        for begin in range(0, points - rise // 2, max(1, rise // 4))
    ]
    jumps = [1.0 * (middle > place) for place in range(1, points)]
    visits = [
        1.0 * ((middle > begin) & (middle < begin + length))
        for length in lengths_up_to(points // 3)
        for begin in range(1, points - length, max(1, length // 2))
    ]
    sorts = [sort for sort in (ramps, jumps, visits) if sort]
    log_prior = np.concatenate([np.full(len(sort), -np.log(len(sort) * len(sorts))) for sort in sorts])
    return np.array([form for sort in sorts for form in sort]).T, log_prior


@lru_cache(maxsize=16)
def _grid(points: int, profile: tuple[int, ...], size: float) -> DriftGrid:
    """profile : [n] powers of four, the variance of the white part of each point over its usual one

    size : s.d. of a change, in units of the usual white part.  Points of which nothing is known have no part in it.
    """
    known = np.array(profile) < UNKNOWN
    flicker, walk = (one[np.ix_(known, known)] for one in covariances(points))
    forms, log_prior = changes_of_level(points)
    contrasts = helmert(int(known.sum()))
    white = np.diag(4.0 ** np.array(profile, dtype=float)[known])
    steady = contrasts @ (white + FLICKERS[:, None, None] * flicker) @ contrasts.T
    factor = np.linalg.cholesky(steady)
    spread = np.linalg.solve(factor, contrasts @ walk @ contrasts.T)
    spread, vectors = np.linalg.eigh(np.linalg.solve(factor, spread.transpose(0, 2, 1)))
    basis = np.zeros((len(FLICKERS), len(contrasts), points))
    basis[:, :, known] = vectors.transpose(0, 2, 1) @ np.linalg.solve(factor, contrasts)
    variance = 1.0 + WALKS[:, None] * np.maximum(spread, 0.0)[:, None, :]
    log_norm = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)[:, None] + np.log(variance).sum(axis=2)
    changes = basis @ forms
    power = (1.0 / variance) @ changes**2
    gain = 0.5 / (power + size**-2.0)
    return DriftGrid(basis, 1.0 / variance, log_norm, changes, gain, log_prior - 0.5 * np.log1p(power * size**2))


@dataclass(frozen=True)
class Likelihood:
    """How likely each pair of flicker and random walk is for the bias of one gyro.

    table  : [F, W], log likelihood of each of FLICKERS with each of WALKS
    unit   : (deg/s)², in which those variances are: the usual white variance of a mean
    length : blocks of samples of each mean
    """

    table: np.ndarray
    unit: float
    length: int


def likelihood_of(slow: Slow) -> Likelihood:
    """Of one gyro's flicker and walk, from the whole recording; runs have levels and changes of their own."""
    length = max(1, -(-len(slow.mean) // POINTS))
    runs = [coarse for coarse in (_coarse(slow, rows, length) for rows in _runs(slow.run)) if coarse is not None]
    table = np.zeros((len(FLICKERS), len(WALKS)))
    if not runs:
        return Likelihood(table, slow.usual_white / length, length)
    known = np.concatenate([white[np.isfinite(white)] for _, white in runs])
    unit = float(np.median(known))
    size = CHANGE_SD * float(np.sqrt(length))
    for mean, white in runs:
        profile = np.where(np.isfinite(white), np.rint(0.5 * np.log2(white / unit)), UNKNOWN).astype(int)
        table += _grid(len(mean), tuple(profile.tolist()), size).log_likelihood(mean / np.sqrt(unit))
    return Likelihood(table, unit, length)


def _runs(run: np.ndarray) -> list[slice]:
    return [slice(begin, end) for begin, end in runs(run).tolist()]


def _coarse(slow: Slow, rows: slice, length: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Means over `length` blocks that count [n], less their level, and their white variance, inf where none counts."""
    points = (rows.stop - rows.start) // length
    if points < FEWEST_POINTS:
        return None
    begins = rows.start + np.arange(points) * (rows.stop - rows.start) // points
    counts = slow.counts[rows].astype(float)
    number = np.add.reduceat(counts, begins - rows.start)
    if (number > 0).sum() < FEWEST_POINTS:
        return None
    mean = np.add.reduceat(counts * slow.mean[rows], begins - rows.start)
    white = np.add.reduceat(counts * slow.white[rows], begins - rows.start)
    some = np.maximum(number, 1.0)
    mean = np.where(number > 0, mean / some, 0.0)
    level = float(np.median(mean[number > 0]))
    return np.where(number > 0, mean - level, 0.0), np.where(number > 0, white / some**2, np.inf)


def healthy_array(parts: Sequence[Slow]) -> list[Slow]:
    """The parts with what their bias does in health: each one's own likelihood times the prior that the others are.

    Of the others are learnt the centre and the spread of the logarithms of flicker and walk. A gyro has no part in its
    own prior, and may be of another kind.
    """
    tables = [likelihood_of(part) for part in parts]
    axes = [(np.log(FLICKERS * one.unit), np.log(WALKS * one.unit / one.length)) for one in tables]
    flickers, walks = (_centres([axis[of] for axis in axes]) for of in (0, 1))
    near = [(_near(flickers, flicker), _near(walks, walk)) for flicker, walk in axes]
    likelihoods = [np.exp(one.table - one.table.max()) for one in tables]
    evidence = [np.log((1.0 - ODD) * (flicker @ like @ walk.T) + ODD * like.mean())
                for (flicker, walk), like in zip(near, likelihoods, strict=True)]  # fmt: skip
    total, found = np.sum(evidence, axis=0), []
    for part, one, (of_flicker, of_walk), like, own in zip(parts, tables, near, likelihoods, evidence, strict=True):
        weight = np.exp(total - own - (total - own).max())
        prior = (1.0 - ODD) * (of_flicker.T @ weight @ of_walk) + ODD * weight.sum() / like.size
        posterior = prior * like / (prior * like).sum()
        flicker = _mean(posterior.sum(axis=1), FLICKERS) * one.unit
        walk = _mean(posterior.sum(axis=0), WALKS) * one.unit / one.length
        found.append(replace(part, flicker=flicker, walk=walk))
    return found


def _mean(probability: Floats, variance: Floats) -> float:
    """Power mean between the mean and that of the logarithm, as the posterior is wide."""
    mean: float = float(probability @ variance**POWER) ** (1.0 / POWER)
    return mean


def _centres(axes: Sequence[np.ndarray]) -> np.ndarray:
    low, high = min(axis[0] for axis in axes), max(axis[-1] for axis in axes)
    return np.linspace(low, high, 2 * len(axes[0]))


def _near(centres: Floats, own: Floats) -> Floats:
    """Probabilities of the values `own` [V] for every spread and centre [S·C, V]."""
    log = -0.5 * ((own - centres[:, None]) / LIKENESS[:, None, None]) ** 2
    weight = np.exp(log - log.max(axis=2, keepdims=True))
    near: Floats = (weight / weight.sum(axis=2, keepdims=True)).reshape(-1, len(own))
    return near

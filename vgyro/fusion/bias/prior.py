"""What is known of the constants beforehand, from their own spread: hierarchical Bayes.

The biases of healthy gyros are normal variables about one centre, of one standard deviation s that is not known, with
the prior density 1/s; a few gyros may be far off. What all share goes to the motion where nothing anchors it, so the
common bias is as well known as the mean of the healthy ones: their spread says how well, not the noise of the means.
Where standstill anchors it the centre is measured, and nothing is known of it beforehand: it may lie anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from vgyro.fusion.bias.model import BiasEvidence, Constants
from vgyro.fusion.bias.smoother import Filtered

FAR_OFF = 0.003
"""Share of gyros whose bias has nothing to do with the spread of the rest."""
CANDIDATES, MOST_FAR_OFF = 6, 3
"""Gyros that may be far off, those farthest from the median, how many at once; less than half in any case."""
LEAST, LARGEST, FINENESS = 0.5, 5.0, 0.5
"""s begins at this part of the s.d. with which one constant is measured, ends at this multiple of the largest
constant, and goes in steps of this in its logarithm. Spreads below a measurement's s.d. are not told apart."""
OPEN = 1e4
"""Variance of the constants for a first look at them, of that with which each is measured: wide, but not so that
rounding is taken for what all share."""
WIDE = 100.0
"""Variance of the biases while the slopes' is sought, and of a centre that is measured, of the largest square seen."""


@dataclass(frozen=True)
class Prior:
    """What is believed of the k constants before the blocks are seen: a mixture of M normal priors.

    In each of them the constants are sums of p independent normal variables of mean 0: one of its own for each
    constant, and centres that several constants share.
    share    : [M], posterior weight of each prior; they add up to 1
    variance : [M, p], (deg/s)² for biases and steps, (deg/s/K)² for slopes, variance of the variables
    sums     : [k, p], which variables each constant is the sum of: constants = sums @ variables
    """

    share: np.ndarray
    variance: np.ndarray
    sums: np.ndarray

    def spread(self, constants: slice) -> float:
        """Largest mean variance of some of the constants."""
        return float((self.sums**2 @ (self.share @ self.variance))[constants].max())

    def posterior(self, filtered: Filtered) -> Constants:
        """Mean and covariance of the constants over the mixture."""
        means, covariances, _ = _posteriors(_of_variables(filtered, self.sums), self.variance)
        mean = self.share @ means
        apart = means - mean
        covariance = np.tensordot(self.share, covariances, axes=1) + (apart.T * self.share) @ apart
        return Constants(self.sums @ mean, self.sums @ covariance @ self.sums.T)


def empirical_prior(evidence: BiasEvidence, filtered: Filtered) -> Prior:
    """The prior of the constants that the recording itself suggests: a mixture over how far the biases scatter.

    evidence : the block means;  filtered : the forward pass with the walks that were chosen
    returns  : Prior, each part weighed by the likelihood of the blocks. The parts differ in the standard deviation s of
               the biases about their centre, with the density 1/s beforehand, and in which gyros are far off. A gyro
               that is far off has a variance of its own, the square of what it is seen to be off by, and costs
               log(FAR_OFF)
    The density 1/s makes the variance of the centre that of the mean of N normal variables times (N - 1)/(N - 3), so
    that error²/variance is 1 on average. Slopes that no record at rest knows have one variance, its posterior mean
    likewise. Gelman et al. (2013), Bayesian Data Analysis, ch. 5 (hierarchical normal model).
    """
    gyros, many = evidence.gyros, len(filtered.squares) - 1
    groups = [slice(0, gyros)]
    if many > evidence.plain and not evidence.known_slopes:
        groups.append(slice(evidence.plain, many))
    looks = [_Look.of(filtered, group) for group in groups]
    open_wide = [np.full(gyros, look.open_wide) for look in looks]
    sums, centres = np.eye(many), np.zeros(0)
    if evidence.anchored:
        shared = [np.isin(np.arange(many), np.r_[group]) for group in groups]
        sums, centres = np.column_stack([sums, *shared]), np.array([look.open_wide for look in looks])
    slopes: list[np.ndarray] = []
    if evidence.known_slopes and many > evidence.plain:
        slopes = [np.ones(gyros)]
    elif len(groups) > 1:

        def with_slopes(variance: np.ndarray) -> np.ndarray:
            return np.concatenate([open_wide[0], evidence.steps, variance, centres])

        slope_sizes = [np.full(gyros, size) for size in looks[1].sizes()]
        found = _weighed(filtered, slope_sizes, np.zeros(len(slope_sizes)), with_slopes, sums)
        slopes = [np.full(gyros, (found.share @ found.variance)[evidence.plain])]

    def with_biases(variance: np.ndarray) -> np.ndarray:
        return np.concatenate([variance, evidence.steps, *slopes, centres])

    variances, logarithms = looks[0].with_far_off()
    return _weighed(filtered, variances, logarithms, with_biases, sums)


@dataclass(frozen=True)
class _Look:
    """A first look at N constants of one kind, with a wide prior.

    square [N] : square of what each is about the median, and its variance;  sure [N] : its variance if alone
    farthest : those that may be far off, the farthest first;  open_wide : a wide variance
    """

    square: np.ndarray
    sure: np.ndarray
    farthest: list[int]
    open_wide: float

    @classmethod
    def of(cls, filtered: Filtered, group: slice) -> _Look:
        diagonal = np.diag(filtered.squares)[1:]
        inside = diagonal[group] > 0
        if not inside.any():
            return cls(np.ones(len(inside)), np.ones(len(inside)), [], 1.0)
        sure = 1.0 / np.where(diagonal > 0, diagonal, np.inf)
        alone = (filtered.squares[1:, 0] * sure) ** 2
        means, covariances, _ = _posteriors(filtered, OPEN * sure[None])
        mean, covariance = means[0, group], covariances[0][group, group]
        centred = np.eye(len(mean)) - inside / inside.sum()
        apart = mean - np.median(mean[inside])
        own = np.diag(centred @ covariance @ centred.T)
        usual = np.median(apart[inside] ** 2)
        order = np.argsort(np.where(inside, -(apart**2) / (own + usual), np.inf), kind="stable")
        farthest = order[: min(CANDIDATES, int(inside.sum()))].tolist()
        square = np.where(inside, apart**2 + own, usual)
        return cls(
            square,
            np.where(inside, sure[group], np.median(sure[group][inside])),
            farthest,
            WIDE * float(np.maximum(alone, sure)[group].max()),
        )

    def sizes(self) -> np.ndarray:
        """Variances s², evenly in the logarithm."""
        low = LEAST * math.sqrt(float(np.median(self.sure)))
        high = max(LARGEST * math.sqrt(float(self.square.max())), low)
        return np.geomspace(low, high, math.ceil(math.log(high / low) / FINENESS) + 1) ** 2

    def with_far_off(self) -> tuple[list[np.ndarray], np.ndarray]:
        """Variances [N] of each s and each set of gyros far off, and the logarithm of what the set has beforehand."""
        most = min(MOST_FAR_OFF, (len(self.square) - 1) // 2, len(self.farthest))
        sets = [one for number in range(most + 1) for one in combinations(self.farthest, number)]
        variances, logarithms = [], []
        for far in sets:
            off = np.isin(np.arange(len(self.square)), far)
            for size in self.sizes():
                variances.append(np.where(off, np.maximum(self.square, size), size))
                logarithms.append(len(far) * math.log(FAR_OFF / (1.0 - FAR_OFF)))
        return variances, np.array(logarithms)


def _weighed(
    filtered: Filtered,
    variances: list[np.ndarray],
    logarithms: np.ndarray,
    complete: Callable[[np.ndarray], np.ndarray],
    sums: np.ndarray,
) -> Prior:
    """The mixture of priors whose shares are the posterior ones.

    logarithms [M] : of the shares beforehand;  complete : variances of one kind → those of all variables [p]
    sums : as of Prior
    """
    every = np.stack([complete(one) for one in variances])
    found = logarithms + _posteriors(_of_variables(filtered, sums), every)[2]
    share = np.exp(found - found.max())
    return Prior(share / share.sum(), every, sums)


def _of_variables(filtered: Filtered, sums: np.ndarray) -> Filtered:
    """What the innovations say of p variables of which the constants are sums [k, p]."""
    turn = np.zeros((len(sums) + 1, sums.shape[1] + 1))
    turn[0, 0], turn[1:, 1:] = 1.0, sums
    return replace(filtered, squares=turn.T @ filtered.squares @ turn)


def _posteriors(filtered: Filtered, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means [M, k], covariances [M, k, k] and log likelihoods [M] (less one constant) with M priors [M, k]."""
    seen, score = filtered.squares[1:, 1:], filtered.squares[1:, 0]
    root = np.sqrt(variance)
    matrix = np.eye(len(score)) + root[:, :, None] * seen * root[:, None, :]
    inside = np.linalg.inv(matrix)
    covariance = root[:, :, None] * (inside + inside.transpose(0, 2, 1)) / 2 * root[:, None, :]
    means = covariance @ score
    return means, covariance, 0.5 * (means @ score - np.linalg.slogdet(matrix)[1])

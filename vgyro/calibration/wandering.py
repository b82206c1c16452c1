"""Straight lines and other linear models through values whose errors wander: white, flicker and random walk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats

SHARES = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)  # flicker, and random walk, over the white variance of one value
SEED = 1431
BISECTIONS = 50
ROUNDING = 1e-12  # of the largest value: no scatter is smaller
FEWEST_FREE = 6  # degrees of freedom that can tell slow noise from white


@dataclass(frozen=True)
class LinearFit:
    """Coefficients of a linear model and how the errors of the values look.

    estimate [p], covariance [p, p] : of the coefficients
    noise [P, P]  : covariance of the errors of the values
    freedom       : degrees of freedom of every t distribution here
    evidence      : log marginal likelihood of the model, but for a constant of the values
    share [G], centre [G, p], root [G, p, p] : the coefficients' distribution is a mixture of t distributions, one for
                    every shape of the noise that was allowed for: centre - estimate + root · t with probability `share`
    """

    estimate: np.ndarray
    covariance: np.ndarray
    noise: np.ndarray
    freedom: int
    evidence: float
    share: np.ndarray
    centre: np.ndarray
    root: np.ndarray

    def half_width(self, combination: np.ndarray, confidence: float) -> float:
        """Half the interval of combination · coefficients, [p] · [p]; a t interval if there is one shape of noise."""
        middle, spread = self._parts(combination)
        low, high = 0.0, float(np.max(np.abs(middle) + student(self.freedom, confidence) * spread))
        for _ in range(BISECTIONS):
            half = (low + high) / 2
            low, high = (half, high) if self._inside(middle, spread, half) < confidence else (low, half)
        return high

    def p_value(self, combination: np.ndarray) -> float:
        """Two-sided, of combination · coefficients being 0."""
        return 1.0 - self._inside(*self._parts(combination), abs(float(combination @ self.estimate)))

    def standard_error(self, combination: np.ndarray) -> float:
        """Of combination · coefficients."""
        return float(np.sqrt(max(combination @ self.covariance @ combination, 0.0)))

    def draws(self, combinations: Floats, number: int) -> Floats:
        """Errors of combinations [J, p] · coefficients: [J, number], the same for the same fit."""
        generator = np.random.default_rng(SEED)
        shape = generator.choice(len(self.share), size=number, p=self.share)
        unit = generator.standard_normal((number, len(self.estimate)))
        unit *= np.sqrt(self.freedom / generator.chisquare(self.freedom, number))[:, None]
        moved = self.centre[shape] - self.estimate + np.einsum("nqr,nr->nq", self.root[shape], unit)
        draws: Floats = combinations @ moved.T
        return draws

    def _parts(self, combination: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Middle, from the estimate, and spread of each part of the mixture for a combination: [G], [G]."""
        spread = np.linalg.norm(np.einsum("gqr,q->gr", self.root, combination), axis=1)
        return (self.centre - self.estimate) @ combination, np.maximum(spread, np.finfo(float).tiny)

    def _inside(self, middle: np.ndarray, spread: np.ndarray, half: float) -> float:
        """Probability that the error is within ± half."""
        from scipy.special import stdtr

        inside = stdtr(self.freedom, (half - middle) / spread) - stdtr(self.freedom, (-half - middle) / spread)
        return float(self.share @ inside)


def student(freedom: int, confidence: float) -> float:
    """Quantile of Student's t that a two-sided interval needs."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + confidence / 2))


class Errors:
    """What the errors of P values may look like: σ²·(white + a·flicker + b·random walk), a and b on a grid.

    Flicker and random walk are taken about their mean over the values: a constant in the model is the mean over the
    test, its wander included. Slow noise is a little less likely beforehand the larger it is, 1/√k for the k-th of
    SHARES.
    """

    def __init__(
        self,
        number: int,
        weight: np.ndarray | None = None,
        time: np.ndarray | None = None,
        seconds: np.ndarray | None = None,
    ) -> None:
        """number  : P

        weight  : [P], white variance of each value but for a common factor (None: equal)
        time    : [P], s, middle of what each value is the mean of; None: errors are independent
        seconds : [P], length of that mean (None: from one to the next)
        """
        white = np.diag(np.ones(number) if weight is None else weight / np.mean(weight))
        self._shapes, self._belief = white[None], np.zeros(1)
        if time is not None:
            length = np.full(number, np.median(np.diff(np.sort(time)))) if seconds is None else seconds
            flicker, walk = (_about_mean(shape) for shape in (flicker_shape(time, length), walk_shape(time)))
            self._shapes = np.stack([white + a * flicker + b * walk for a in SHARES for b in SHARES])
            self._belief = np.add.outer(*2 * [-0.5 * np.log(np.arange(1, len(SHARES) + 1))]).ravel()
        lower = np.linalg.cholesky(self._shapes)
        self._whitening = np.linalg.inv(lower)
        self._size = np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)

    def fit(self, design: np.ndarray, values: np.ndarray) -> LinearFit:
        """Generalised least squares of values [P] on a design [P, p] of full rank, p < P.

        Each shape of the errors gets the weight of its restricted likelihood (Patterson & Thompson 1971; σ² integrated
        out), and the estimates are averaged over the shapes, the scatter between them counting as error. So slow noise
        is not mistaken for precision. With fewer than 6 degrees of freedom the errors are taken as white: weighted
        least squares, σ² from the residuals.
        """
        freedom = len(values) - design.shape[1]
        kept = slice(None) if freedom >= FEWEST_FREE else slice(1)  # the first shape is white
        shapes, whitening = self._shapes[kept], self._whitening[kept]
        model, data = whitening @ design, whitening @ values
        basis, triangle = np.linalg.qr(model)
        inverse = np.linalg.inv(triangle)
        projected = np.einsum("gpq,gp->gq", basis, data)
        estimates = np.einsum("gqr,gr->gq", inverse, projected)
        squares = np.sum((data - np.einsum("gpq,gq->gp", basis, projected)) ** 2, axis=1)
        squares = np.maximum(squares, freedom * (ROUNDING * np.abs(values).max()) ** 2 + np.finfo(float).tiny)
        determinant = np.log(np.abs(np.diagonal(triangle, axis1=1, axis2=2))).sum(axis=1)
        likelihood = self._belief[kept] - 0.5 * freedom * np.log(squares) - self._size[kept] - determinant
        share = np.exp(likelihood - likelihood.max())
        evidence = float(likelihood.max() + np.log(share.sum()))
        share /= share.sum()
        estimate = share @ estimates
        apart = estimates - estimate
        root = inverse * np.sqrt(squares / freedom)[:, None, None]
        covariance = np.einsum("g,gqr,gsr->qs", share, root, root) + np.einsum("g,gq,gr->qr", share, apart, apart)
        noise = np.einsum("g,gpq->pq", share * squares / freedom, shapes)
        return LinearFit(estimate, covariance, noise, freedom, evidence, share, estimates, root)


def average_fits(fits: list[LinearFit], evidence: np.ndarray) -> LinearFit:
    """One fit of several models of the same values and as many coefficients, weighted by e^evidence [n]."""
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    estimates = np.stack([fit.estimate for fit in fits])
    estimate = weight @ estimates
    apart = estimates - estimate
    return LinearFit(
        estimate,
        np.einsum("n,nqr->qr", weight, np.stack([fit.covariance for fit in fits]))
        + np.einsum("n,nq,nr->qr", weight, apart, apart),
        np.einsum("n,npq->pq", weight, np.stack([fit.noise for fit in fits])),
        fits[0].freedom,
        float(evidence.max()),
        np.concatenate([share * fit.share for share, fit in zip(weight, fits, strict=True)]),
        np.concatenate([fit.centre for fit in fits]),
        np.concatenate([fit.root for fit in fits]),
    )


def _about_mean(shape: Floats) -> Floats:
    """The covariance [P, P] of a wander about its own mean over the values; the mean as if they were independent."""
    centred = shape - shape.mean(axis=0) - shape.mean(axis=1)[:, None] + shape.mean()
    shape_about_mean: Floats = centred + np.trace(centred) / len(shape) ** 2
    return shape_about_mean


def flicker_shape(time: Floats, seconds: Floats) -> Floats:
    """Covariance [P, P] of means of flicker noise, but for the factor B²/π and for a constant.

    Flicker of the two-sided density B²/(2πf) has the covariance (B²/π)·ln(1/lag) but for a constant. Averaged over two
    stretches by integrating twice: ∬ ln x = x²/2 ln x - 3x²/4.
    """

    def twice(lag: Floats) -> Floats:
        size = np.maximum(np.abs(lag), np.finfo(float).tiny)
        return size**2 / 2 * np.log(size) - 0.75 * size**2

    lag = np.abs(time[:, None] - time[None, :])
    half = (seconds[:, None] + seconds[None, :]) / 2
    apart = (seconds[:, None] - seconds[None, :]) / 2
    whole = twice(lag + half) + twice(lag - half) - twice(lag + apart) - twice(lag - apart)
    return -whole / (seconds[:, None] * seconds[None, :])


def walk_shape(time: Floats) -> Floats:
    """Covariance [P, P] of a random walk, but for the factor K²·span/2 and for a constant: -lag / span."""
    lag = np.abs(time[:, None] - time[None, :])
    return -lag / max(float(lag.max()), np.finfo(float).tiny)

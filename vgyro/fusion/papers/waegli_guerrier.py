"""Waegli and Guerrier: the variance of each gyro follows from its residual against the array, by ARMA and GARCH."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vgyro import engine as engines
from vgyro.engine.models import FAILED, GARCH_STATUSES, NO_VARIANCE, TOO_SHORT
from vgyro.engine.protocols.engines import Engine
from vgyro.fusion.blocks import PIECE, SampleWeights
from vgyro.fusion.papers.arma import FEWEST, Arma, LowPass, fit_arma
from vgyro.fusion.types import ArrayRates, CannotRun, FilterParameters, Fused

SOURCE = "Waegli et al. (2010), Meas. Sci. Technol. 21; Guerrier (2009), ION GNSS, 3114-3121"
SAME_AT_ANY_RATE = {"": "Σw = 1, and the residual is without the array's own rate"}
INFERRED = (
    "W = I in the residual, for weights that are fed back favour the best gyro more with each pass; ARMA and GARCH of "
    "order (1,1), fitted once to each gyro's residual at the full rate, one after the other"
)
LONGEST_FIT = 1_000_000
"""Samples at most of the longest gap-free stretch to which the models are fitted."""


@dataclass(frozen=True)
class ResidualModel:
    """Of one gyro's residual: ARMA(1,1), and GARCH(1,1) of its innovations: h_t = ω + α·e²_{t-1} + β·h_{t-1}.

    omega, mean_square : (deg/s)²; the latter of the innovations, it stands for e² and h before the first one
    """

    arma: Arma
    omega: float
    alpha: float
    beta: float
    mean_square: float


def waegli_guerrier(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Weights from the conditional variance of each gyro's residual against the array.

    v = (I - H(H'WH)⁻¹H'W)y with H = 1, W = I: v_i = y_i - mean(y). Of each gyro ARMA(1,1), v → e; GARCH(1,1), e → h;
    w = Σ(y_i/h_i)/Σ(1/h_i). The models are fitted to the longest gap-free stretch, at most its first 1,000,000 samples,
    and begin anew in each stretch with e² = h = mean(e²) (Fiorentini, Calzolari & Panattoni 1996). Σw = 1 and v knows
    nothing of a rate common to all gyros, so it works in motion.
    raises : CannotRun if no stretch has FEWEST samples or a residual does not vary
    In the style of Waegli et al. (2010) and Guerrier (2009).
    """
    models = fit_residuals(array, parameters.engine)
    weights = residual_weights(array, models, parameters.engine)
    fused, _ = weights.combine(array.rate)
    return Fused.undelayed(fused, weights, _note(array, models))


def fit_residuals(array: ArrayRates, engine: str) -> list[ResidualModel]:
    """The model of each gyro.  raises : as waegli_guerrier"""
    longest = max(array.stretches(), key=lambda part: part.stop - part.start)
    part = array.rate[longest.start : min(longest.stop, longest.start + LONGEST_FIT)]
    if len(part) < FEWEST:
        raise CannotRun(f"no stretch of {FEWEST} samples without a gap", remedy="a longer recording is needed")
    run = engines.get(engine)
    mean = part.mean(axis=1, dtype=float)
    return [_model(part[:, gyro] - mean, gyro, run) for gyro in range(part.shape[1])]


def _model(v: np.ndarray, gyro: int, run: Engine) -> ResidualModel:
    arma = fit_arma(v, run.kalman.low_pass)
    # e_1 = 0 is a convention, not an observation.
    errors = arma.innovations(v[1:], float(v[0]), 0.0, run.kalman.low_pass)
    mean_square = float(np.mean(errors**2))
    fit = run.garch.fit_garch_windows(errors[None, :, None])
    status = GARCH_STATUSES[int(fit.status[0, 0])]
    if status in (NO_VARIANCE, TOO_SHORT):
        raise CannotRun(f"residual of gyro {gyro + 1}: {status}")
    if status == FAILED:
        return ResidualModel(arma, mean_square, 0.0, 0.0, mean_square)
    return ResidualModel(arma, float(fit.omega[0, 0]), float(fit.alpha[0, 0]), float(fit.beta[0, 0]), mean_square)


def residual_weights(array: ArrayRates, models: list[ResidualModel], engine: str) -> SampleWeights:
    """Weights 1/h_i, Σw = 1, of every sample; they are computed when they are asked for, and are not kept."""
    low_pass = engines.get(engine).kalman.low_pass
    block = np.arange(len(array.rate), dtype=np.int32)

    def rows(slices: list[slice]) -> Iterator[np.ndarray]:
        variances = _variances(array, models, low_pass, slices)
        for variance in variances:
            inverse = 1.0 / variance
            yield (inverse / inverse.sum(axis=0)).T

    return SampleWeights(block, rows, array.rate.shape[1])


def _variances(
    array: ArrayRates, models: list[ResidualModel], low_pass: LowPass, slices: list[slice]
) -> Iterator[np.ndarray]:
    """h [N, n] of the samples of each slice; they follow each other, and the first may begin anywhere."""
    first = slices[0].start if slices else 0
    before = [slice(start, min(start + PIECE, first)) for start in range(0, first, PIECE)]
    starts = {part.start for part in array.stretches()}
    recursions = [_Recursion(model, low_pass) for model in models]
    for samples in [*before, *slices]:
        edges = [samples.start, *sorted(one for one in starts if samples.start < one < samples.stop), samples.stop]
        found = np.empty((len(models), samples.stop - samples.start))
        for start, stop in pairwise(edges):
            piece = np.asarray(array.rate[start:stop], dtype=float, order="F")
            mean = piece.mean(axis=1)
            for gyro, recursion in enumerate(recursions):
                if start in starts:
                    recursion.begin()
                found[gyro, start - samples.start : stop - samples.start] = recursion.advance(piece[:, gyro] - mean)
        if samples.start >= first:
            yield found


class _Recursion:
    """v → h of one gyro, a piece at a time."""

    def __init__(self, model: ResidualModel, low_pass: LowPass) -> None:
        self._model, self._low_pass = model, low_pass
        self.begin()

    def begin(self) -> None:
        """Forget what was before: the next sample is the first."""
        self._fresh, self._residual, self._error, self._square, self._variance = True, 0.0, 0.0, 0.0, 0.0

    def advance(self, v: np.ndarray) -> np.ndarray:
        """h [n] of the next n >= 1 samples."""
        model, fresh = self._model, self._fresh
        errors = np.zeros(len(v))
        # The first sample of a stretch has no innovation: the mean square stands for its square.
        later = v[1:] if fresh else v
        if len(later):
            before = float(v[0]) if fresh else self._residual
            errors[-len(later) :] = model.arma.innovations(later, before, self._error, self._low_pass)
        squares = errors**2
        if fresh:
            squares[0] = model.mean_square
        driven = model.omega + model.alpha * np.concatenate([[self._square], squares[:-1]])
        if fresh:
            driven[0] = model.mean_square
        variance = self._low_pass(driven, model.beta, 1.0, self._variance)
        self._fresh, self._residual, self._error = False, float(v[-1]), float(errors[-1])
        self._square, self._variance = float(squares[-1]), float(variance[-1])
        return variance


def operations(gyros: int) -> float:
    """Floating-point operations a sample: residual, two recursions, weight and sum of each gyro."""
    return 18.0 * gyros


def _note(array: ArrayRates, models: list[ResidualModel]) -> str:
    longest = max(part.stop - part.start for part in array.stretches())
    seconds = min(longest, LONGEST_FIT) * array.period
    memory = [f"{model.alpha:.2g}, {model.beta:.3g}" for model in models]
    return f"models of {seconds:.4g} s without a gap; α, β of each gyro: {'; '.join(memory)}"

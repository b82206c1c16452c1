"""Rolling windows, and which window's model gives the weights of which sample (Liu et al. 2015, sections 4 and 5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vgyro.config import CorrelationModel, Definition, Mode
from vgyro.engine.models import NOT_POSITIVE_DEFINITE
from vgyro.engine.recursions import dcc_correlation, garch_variance
from vgyro.volatility.series import window_residuals
from vgyro.volatility.stretches import Window, stretches

OK = "ok"
NO_MODEL_YET = "no model yet"


@dataclass(frozen=True)
class ModelWindow:
    """The fitted model of one window.

    omega (deg/s)², alpha, beta : [N]; NaN for a gyro that has no model (no variance): its weight is 0
    a, b, target [N, N] : DCC; target is the identity where S was singular, NaN in the rows of a gyro without a model
    note : what to say beside the weights; "" for nothing
    """

    window: Window
    omega: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    a: float
    b: float
    target: np.ndarray
    note: str = ""


@dataclass(frozen=True)
class RollingWeights:
    """weights [M, N]; sigma [M] = √(w'Hw) and deviation [M, N] = √h, deg/s, NaN without a model; status [M]"""

    weights: np.ndarray
    sigma: np.ndarray
    deviation: np.ndarray
    status: np.ndarray


def conditional_covariance(
    r: np.ndarray, inside: int, model: ModelWindow, correlation: CorrelationModel
) -> tuple[np.ndarray, np.ndarray]:
    """H_t = D_t R_t D_t over a window and beyond, and which gyros it holds.

    r       : [L, N] deg/s, the window's `inside` samples and those after it; leading NaN rows take the first H
    returns : H [L, n, n] (deg/s)² of the n gyros that have a model, and those gyros [N] as a mask
    Parameters and start (mean(e²), S) are the window's own: H_t beyond it uses r up to t - 1, nothing later.
    """
    gyros = np.isfinite(model.omega)
    e = r[:, gyros]
    first = int(np.argmax(np.all(np.isfinite(e), axis=1)))
    e = e[first:]
    omega, alpha, beta = model.omega[gyros], model.alpha[gyros], model.beta[gyros]
    start = omega + (alpha + beta) * np.mean(np.square(e[: inside - first]), axis=0)
    variance = garch_variance(e, omega, alpha, beta, start)
    deviation = np.sqrt(variance)
    target = model.target[np.ix_(gyros, gyros)]
    if correlation == "ccc" or model.a == 0:
        matrix = np.broadcast_to(target, (len(e), *target.shape))
    else:
        matrix = dcc_correlation(e / deviation, model.a, model.b, target)
    covariance = deviation[:, :, None] * matrix * deviation[:, None, :]
    return np.concatenate([np.repeat(covariance[:1], first, axis=0), covariance]), gyros


def rolling_weights(
    values: np.ndarray,
    segment: np.ndarray,
    models: list[ModelWindow],
    definition: Definition,
    mode: Mode,
    correlation: CorrelationModel,
    weigh: Callable[[np.ndarray], np.ndarray],
    step: int,
    span: int = 15,
    too_short: str = "too short",
) -> RollingWeights:
    """Weights of every sample of the series.

    values  : [M, N] deg/s;  segment : [M]
    models  : the windows of each segment in order, `step` apart
    weigh   : H [T, n, n] -> w [T, n], the minimum-variance weights; NaN where H_t cannot be used
    span    : of the definition `residual`
    too_short : status of the samples of a segment that holds no window; their weights are equal

    in_sample : the newest `step` samples of a window take its H_t; the first window of a segment gives all of its own
    causal    : a window's parameters are carried forward over the `step` samples after it; H_t knows nothing of
                sample t or later. Before the first window of a segment is complete the weights are equal.
    After the last window of a segment its model is carried forward to the end, in both modes.
    Liu et al. (2015), sections 4 and 5; `causal` is ours.
    """
    count, n = values.shape
    result = RollingWeights(
        weights=np.full((count, n), 1 / n),
        sigma=np.full(count, np.nan),
        deviation=np.full((count, n), np.nan),
        status=np.full(count, too_short, dtype=object),
    )
    for stretch in stretches(segment):
        inside = [model for model in models if stretch.start <= model.window.start < stretch.stop]
        if inside:
            result.status[stretch.start : stretch.stop] = NO_MODEL_YET
        for index, model in enumerate(inside):
            begin, end = _taken(model.window, stretch, mode, step, index == 0, index == len(inside) - 1)
            ahead = max(0, end - model.window.stop)
            r = window_residuals(values, model.window, definition, span, ahead, stretch.start)
            _fill(result, r, begin, end, model, correlation, weigh)
    return result


def _taken(window: Window, stretch: Window, mode: Mode, step: int, first: bool, last: bool) -> tuple[int, int]:
    """The samples that take their weights from this window's model."""
    if mode == "causal":
        return window.stop, stretch.stop if last else window.stop + step
    return window.start if first else window.stop - step, stretch.stop if last else window.stop


def _fill(
    result: RollingWeights,
    r: np.ndarray,
    begin: int,
    end: int,
    model: ModelWindow,
    correlation: CorrelationModel,
    weigh: Callable[[np.ndarray], np.ndarray],
) -> None:
    if begin == end:
        return
    if not np.any(np.isfinite(model.omega)):
        result.status[begin:end] = model.note or "no variance"
        return
    start = model.window.start
    covariance, gyros = conditional_covariance(r, model.window.length, model, correlation)
    covariance = covariance[begin - start : end - start]
    weights = weigh(covariance) if covariance.shape[1] > 1 else np.ones((end - begin, 1))
    lost = np.asarray(np.isnan(weights).any(axis=1))
    weights = np.where(lost[:, None], 1 / weights.shape[1], weights)
    whole = np.zeros((end - begin, len(gyros)))
    whole[:, gyros] = weights
    deviation = np.full_like(whole, np.nan)
    deviation[:, gyros] = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    result.weights[begin:end] = whole
    result.deviation[begin:end] = deviation
    result.sigma[begin:end] = np.sqrt(np.einsum("ti,tij,tj->t", weights, covariance, weights))
    result.status[begin:end] = np.where(lost, NOT_POSITIVE_DEFINITE, model.note or OK)

"""Methods without a model of time: average, median, fixed inverse-variance weights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vgyro.fusion.array import ArrayRates, CannotRun, FilterParameters, Fused


def average(array: ArrayRates, parameters: FilterParameters) -> Fused:  # noqa: ARG001
    """The mean of the gyros."""
    size = array.rate.shape[1]
    return Fused(array.rate.mean(axis=1), np.full(size, 1.0 / size))


def median(array: ArrayRates, parameters: FilterParameters) -> Fused:  # noqa: ARG001
    """The median of the gyros, sample by sample: not linear, so it has no weights and no transfer function."""
    return Fused(np.median(array.rate, axis=1))


def inverse_variance_arw(array: ArrayRates, parameters: FilterParameters) -> Fused:  # noqa: ARG001
    """Fixed weights w_i ∝ 1/N_i² from the measured angle random walk: least white noise, correlations left out."""
    return _inverse_variance(array, array.noise.arw, "angle random walk")


def inverse_variance_rrw(array: ArrayRates, parameters: FilterParameters) -> Fused:  # noqa: ARG001
    """Fixed weights w_i ∝ 1/K_i² from the measured rate random walk: least drift, correlations left out."""
    return replace(_inverse_variance(array, array.noise.rrw, "rate random walk"), note=array.noise.rrw_note)


def _inverse_variance(array: ArrayRates, coefficient: np.ndarray, name: str) -> Fused:
    unknown = np.flatnonzero(~(np.isfinite(coefficient) & (coefficient > 0)))
    if len(unknown):
        which = ", ".join(str(index + 1) for index in unknown)
        raise CannotRun(f"no {name} was found for gyro {which} of {len(coefficient)}")
    # The largest is taken out first, so that the squares neither overflow nor vanish.
    inverse = (coefficient.max() / coefficient) ** 2
    weights = inverse / inverse.sum()
    return Fused(array.rate @ weights, weights)

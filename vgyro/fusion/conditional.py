"""Fusion by the conditional covariance: weights of CCC and DCC, made by vgyro.volatility and min_variance_weights."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vgyro.fusion.array import ArrayRates, CannotRun, FilterParameters, Fused

LEVEL_IN_MOTION = (
    "in motion the second moment of the level holds the motion itself: the weights are not those of the noise, and "
    "they bias the rate; use the definition residual"
)
DEMEANED_IN_MOTION = "in motion r_t holds the motion but for its mean; use the definition residual"
DIFFERENCE_IN_MOTION = "in motion r_t holds the change of the rate over a step; use the definition residual"
WARNINGS = {"level": LEVEL_IN_MOTION, "demeaned": DEMEANED_IN_MOTION, "difference": DIFFERENCE_IN_MOTION}


def conditional(model: str, mode: str) -> Callable[[ArrayRates, FilterParameters], Fused]:
    """The method that fuses with the weights of `model` (dcc, ccc) and `mode` (in_sample, causal).

    fused rate = Σ w_i(t)·y_i(t), w(t) of min w'H_t w, Σw = 1, 0 ≤ w ≤ 1. Liu et al. (2015), eq. 15-17. Which H_t, that
    is which definition of r_t, is named by FilterParameters.definition.
    """

    def fuse(array: ArrayRates, parameters: FilterParameters) -> Fused:
        key = (model, mode, parameters.definition)
        if key not in array.weights:
            raise CannotRun(
                f"there are no {mode} weights of {model.upper()} for the definition {parameters.definition!r}"
            )
        weights = array.weights[key]
        if weights.shape != array.rate.shape:
            raise CannotRun(f"weights {weights.shape} do not fit the rates {array.rate.shape}")
        note = WARNINGS.get(parameters.definition, "") if parameters.in_motion else ""
        return Fused(np.einsum("tn,tn->t", array.rate, weights), weights, note=note)

    return fuse

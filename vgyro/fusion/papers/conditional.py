"""Fusion by the conditional covariance: weights of CCC and DCC, made by vgyro.volatility and min_variance_weights."""

from __future__ import annotations

from collections.abc import Callable

from vgyro.fusion.types import ArrayRates, CannotRun, FilterParameters, Fused

LEVEL_IN_MOTION = (
    "in motion the second moment of the level holds the motion itself: the weights are not those of the noise, and "
    "they bias the rate; use the definition residual"
)
DEMEANED_IN_MOTION = "in motion r_t holds the motion but for its mean; use the definition residual"
DIFFERENCE_IN_MOTION = "in motion r_t holds the change of the rate over a step; use the definition residual"
SAME_AT_ANY_RATE = {
    "demeaned": "Σw = 1, and r_t is without the window's mean",
    "difference": "Σw = 1, and r_t is a difference",
    "residual": "Σw = 1, and r_t is without the array's own rate",
}
"""Why a constant rate leaves the weights of a definition as they are. `level` is not among them: r_t holds the rate."""
WARNINGS = {"level": LEVEL_IN_MOTION, "demeaned": DEMEANED_IN_MOTION, "difference": DIFFERENCE_IN_MOTION}


def conditional(model: str, mode: str) -> Callable[[ArrayRates, FilterParameters], Fused]:
    """The method that fuses with the weights of `model` (dcc, ccc) and `mode` (in_sample, causal).

    fused rate = Σ w_i(t)·y_i(t), w(t) of min w'H_t w, Σw = 1, 0 ≤ w ≤ 1. Liu et al. (2015), eq. 15-17. Which H_t, that
    is which definition of r_t, is named by FilterParameters.definition.
    """

    def fuse(array: ArrayRates, parameters: FilterParameters) -> Fused:
        key = (model, mode, parameters.definition)
        if key not in array.weights:
            none = f"the volatility stage made no {mode} weights of {model.upper()} for this definition of r_t"
            if parameters.in_motion:
                none = "the volatility of a recording in motion is not analysed"
            raise CannotRun(array.no_weights.get(key, none))
        weights = array.weights[key]
        shape = (len(weights.block), weights.gyros)
        if shape != array.rate.shape:
            raise CannotRun(f"weights {shape} do not fit the rates {array.rate.shape}")
        fused, equal = weights.combine(array.rate)
        return Fused.undelayed(fused, weights, _note(array, parameters, equal))

    return fuse


def _note(array: ArrayRates, parameters: FilterParameters, equal: float) -> str:
    notes = []
    # Where stretches at rest are known, only they were analysed: the motion has equal weights.
    if parameters.in_motion and not array.at_rest.any():
        notes.append(WARNINGS.get(parameters.definition, ""))
    if equal > 0:
        notes.append(f"equal weights for {equal:.1%} of the samples: no window before them, motion, or a gap near")
    return "; ".join(note for note in notes if note)

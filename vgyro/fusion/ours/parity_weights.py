"""Fusion by the variances that parity shows, without smoothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vgyro.fusion.blocks import combined
from vgyro.fusion.noise.parity import Variances, parity_variances, shared_variances
from vgyro.fusion.types import ArrayRates, FilterParameters, Fused


def parity_weights(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Fixed minimum-variance weights from the constant variances of the parity space.

    They hold in motion, where no gyro's own scatter is its noise. Faults that were found have no say: a gyro is left
    out only where it is stuck half of the time or more. A gyro that drifts is not known by its drift, but by its noise.
    """
    found = parity_variances(replace(array, faults=()), parameters, changing=False)
    stuck = found.shares @ found.excluded >= 0.5 * len(array.rate)
    own = found.variance[:1] - (0.0 if found.added is None else found.added[0])
    once = replace(found, start=found.start[:1], stop=found.stop[:1], variance=own, excluded=stuck[None], added=None)
    weights = once.weights(parameters.engine)[0]
    return Fused.undelayed(combined(array.rate, weights), weights, found.note)


def residual_weights(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """Minimum-variance weights of each block from variances that change with time; a gyro at fault has none."""
    found = shared_variances(array, parameters, True)
    weights = found.sample_weights(parameters.engine)
    return Fused.undelayed(weights.combine(array.rate)[0], weights, f"{found.note}; {described(found)}")


def described(found: Variances) -> str:
    """How fast the variance of each gyro changes, in words."""
    words = [f"τ = {tau:g} s" if np.isfinite(tau) else "constant" for tau in found.tau_s.tolist()]
    return "variances: " + ", ".join(words)

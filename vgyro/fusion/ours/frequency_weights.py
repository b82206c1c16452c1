"""Row: zero-phase weights that depend on the frequency, w_i(f) ∝ 1/S_i(f), with Σw = 1 at every frequency."""

from __future__ import annotations

import math

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion import design
from vgyro.fusion.bias.estimate import combined_without, slow_errors
from vgyro.fusion.types import ArrayRates, FilterParameters, Fused, cannot_run


def frequency_weights(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """z = u'(y - b̂), u = R⁻¹1/(1'R⁻¹1): white noise of the ARW, biases b that walk, b̂ two-sided from the parity.

    In the middle of a long recording the gain of gyro i is weights_at(f)_i: near u where white noise prevails, near the
    weights of the walks below that; a rate that all share passes as it is. K is that of the walks that the likelihood
    chooses; where they fade S_i(f) levels off below 1/(2πτ). Steps, temperature and anchors as in slow_errors.
    raises : CannotRun where an ARW is missing or the correlation is not positive definite
    """
    noise = array.noise.with_arw(parameters.arw)
    with cannot_run():
        u = design.gain_direction(noise.R)
        slow = slow_errors(array, parameters, noise.arw**2 * array.rate_hz, noise.correlation)
    note = "; ".join(filter(None, ["weights of the white noise; the slow errors are taken out beforehand", slow.note]))
    return Fused.undelayed(combined_without(array, u, slow), u, note)


def weights_at(frequency: Floats, arw: Floats, rrw: Floats, correlation: Floats) -> Floats:
    """Weights S⁻¹1/(1'S⁻¹1) [F, N] of the least variance at each frequency.

    frequency   : [F] Hz, above 0
    arw, rrw    : [N], deg/s/√Hz two-sided and deg/s/√s;  correlation : [N, N], of both
    S(f) = R + Q/(2πf)², R_ij = arw_i·arw_j·corr_ij, Q_ij = rrw_i·rrw_j·corr_ij.
    """
    scale = (2.0 * math.pi * np.asarray(frequency, dtype=float)) ** -2
    density = np.outer(arw, arw) * correlation + scale[:, None, None] * np.outer(rrw, rrw) * correlation
    solved = np.linalg.solve(density, np.ones((len(density), len(arw), 1)))[..., 0]
    weights: Floats = solved / solved.sum(axis=1)[:, None]
    return weights

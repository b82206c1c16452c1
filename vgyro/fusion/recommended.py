"""The recommended virtual gyroscope: every part of the offline case put together, each chosen from the data.

1. Faults (vgyro.fusion.faults) are left out while they last.
2. R_t, the white noise of each gyro, comes from the parity of the array: constant, changing with a time constant or
   with change points, gyro by gyro, by predictive likelihood (vgyro.fusion.parity); or from DCC of the residual where
   its causal forecasts are better by the test of Diebold & Mariano (1995).
3. Slow errors b come from parity by a two-sided smoother (vgyro.fusion.slow): random walk, temperature where the
   likelihood supports it, anchors where the board is declared to stand still between motion.
4. u = minimum-variance weights of R_t;  z = u'(y - b).
5. The motion: model and parameters by likelihood, two-sided smoother of z with u'R_t·u (vgyro.fusion.smoother).
6. The sensor's low-pass, where parity shows its colour in the noise, is undone on the smoothed rate.

The posterior variance of a sample is that of 5 plus that of u'(b - its estimate) of 3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vgyro.fusion.array import ArrayRates, FilterParameters, Fused
from vgyro.fusion.parity import Variances
from vgyro.fusion.parity_dcc import prefer_dcc
from vgyro.fusion.slow import SlowErrors, combined_without, slow_errors, slow_variance
from vgyro.fusion.slow_blocks import SlowBlocks
from vgyro.fusion.smoothed import DCC, Signal, shared_variances, smoothed
from vgyro.fusion.weights import min_variance_weights


@dataclass(frozen=True)
class Analysed:
    """What the array's own differences say.  variances : R_t;  slow : b;  note : what was chosen"""

    variances: Variances
    slow: SlowErrors
    note: str


def recommended(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """All of it, smoothed, with the posterior standard deviation of each sample."""
    known = analysed(array, parameters)
    weights = known.variances.sample_weights()
    signal = Signal(
        combined_without(array, weights, known.slow),
        known.variances.combined_variance()[known.variances.block_of_sample()],
        known.variances.colour(),
        weights,
        known.note,
        known.slow.at_samples(slow_variance(weights, known.slow)),
        undo_pole=True,
    )
    return smoothed(array, parameters, signal)


def recommended_unsmoothed(array: ArrayRates, parameters: FilterParameters) -> Fused:
    """The same without a model of the motion: u(t)'(y - b), full bandwidth, no delay."""
    known = analysed(array, parameters)
    weights = known.variances.sample_weights()
    return Fused.undelayed(combined_without(array, weights, known.slow), weights, known.note)


def static_weights(array: ArrayRates, parameters: FilterParameters) -> np.ndarray:
    """One weight a gyro [N]: minimum-variance weights of the mean covariance of the recording's white noise."""
    variances = analysed(array, parameters).variances
    used = variances.shares[:, None] * ~variances.excluded
    deviation = np.sqrt((variances.variance * used).sum(axis=0) / np.maximum(used.sum(axis=0), 1))
    return min_variance_weights(np.outer(deviation, deviation) * variances.correlation, parameters.engine)


def analysed(array: ArrayRates, parameters: FilterParameters) -> Analysed:
    """R_t and b of a recording, estimated once for the methods that need them.

    raises : CannotRun, as parity_variances
    """
    return array.once("analysed", lambda: _analysed(array, parameters))


def _analysed(array: ArrayRates, parameters: FilterParameters) -> Analysed:
    variances = shared_variances(array, parameters, True)
    score = prefer_dcc(array, parameters, variances)
    if score.prefer:
        variances = _of_dcc(array, parameters, variances)
    blocks = SlowBlocks.of(array)
    lasting = variances.variance * (1.0 + variances.phi) / (1.0 - variances.phi)
    white = blocks.mean_of(variances.start, lasting)
    white[blocks.mean_of(variances.start, variances.excluded.astype(float)) > 0] = np.inf
    slow = slow_errors(array, parameters, white, variances.correlation, blocks)
    notes = [variances.note, score.note, slow.note, f"{len(array.faults)} faults left out" if array.faults else ""]
    return Analysed(variances, slow, "; ".join(note for note in notes if note))


def _of_dcc(array: ArrayRates, parameters: FilterParameters, variances: Variances) -> Variances:
    """The same with the variances that in-sample GARCH gives, where it gives any."""
    deviations = array.deviations[DCC]
    length = max(1, round(array.rate_hz / parameters.block_hz))
    table = np.concatenate(list(deviations.rows([slice(0, int(deviations.block.max()) + 1)])))
    block = deviations.block[(variances.start + variances.stop) // 2]
    variance = length * table[np.maximum(block, 0)] ** 2
    known = (block >= 0)[:, None] & np.isfinite(variance) & (variance > 0)
    return replace(variances, variance=np.where(known, variance, variances.variance))

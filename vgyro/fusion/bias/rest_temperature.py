"""Temperature coefficients of the gyros from a record at rest, for the recordings in motion.

In motion the differences between gyros show how their biases follow the temperature one against another; what all of
them follow alike goes into the rate. A record at rest shows both, and about where the biases are zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vgyro.fusion.bias.blocks import SlowBlocks
from vgyro.fusion.bias.choice import choose
from vgyro.fusion.bias.common_walk import common_walk
from vgyro.fusion.bias.estimate import usual_arw
from vgyro.fusion.bias.followed import blocks_temperature
from vgyro.fusion.bias.model import BiasEvidence, BlockNoise, Constants, Regressor
from vgyro.fusion.bias.prior import empirical_prior
from vgyro.fusion.rest_scales import own_scales
from vgyro.fusion.types import AllanScales, ArrayRates, CannotRun, TemperatureAtRest

NULLED_WITHIN = 30.0
"""K, 1σ: so far from the record's temperature lies the one at which the array was nulled, before anything is seen."""


def temperature_at_rest(array: ArrayRates) -> TemperatureAtRest | None:
    """The coefficients, where the record shows that the biases follow the temperature.

    array : a record at rest, as a whole or in part, of samples of 1 s or shorter; a constant rate counts as bias
    None  : no temperature is known, it hardly changes, or the likelihood prefers biases that walk without it
    """
    blocks = SlowBlocks.of(array)
    degrees = blocks_temperature(array, blocks)[0]
    resting = blocks.all(array.at_rest)
    if degrees is None or not resting.any():
        return None
    centre = float(np.average(degrees, weights=blocks.length))
    found = _constants(array, blocks, resting, degrees - centre, 0.0)
    if found is None:
        return None
    gyros = array.rate.shape[1]
    scales = _scales_without(array, found.mean[-gyros:]) if array.at_rest.all() else None
    common = common_walk(scales)
    if common:
        found = _constants(array, blocks, resting, degrees - centre, common) or found
    slope, covariance = found.mean[-gyros:], found.covariance[-gyros:, -gyros:]
    return TemperatureAtRest(slope, covariance, *_nulled(found.mean[:gyros], slope, centre), scales)


def _constants(
    array: ArrayRates, blocks: SlowBlocks, resting: np.ndarray, relative: np.ndarray, common: float
) -> Constants | None:
    """Posterior of biases, steps and slopes; None where the slopes are not believed."""
    variance = np.tile(array.noise.arw**2 * array.rate_hz, (len(blocks), 1))
    noise = BlockNoise(variance, array.noise.correlation)
    evidence = BiasEvidence.of(array, blocks, noise, resting, Regressor(relative), common)
    choice = choose(evidence, blocks, array.noise.rrw, usual_arw(variance, array.period), None)
    return empirical_prior(evidence, choice.filtered).posterior(choice.filtered) if choice.slopes else None


def _scales_without(array: ArrayRates, slope: np.ndarray) -> AllanScales | None:
    assert array.temperature is not None
    degrees = np.asarray(array.temperature, dtype=float)
    try:
        return replace(own_scales(replace(array, rate=array.rate - np.outer(degrees, slope))), own=False)
    except CannotRun:
        return None


def _nulled(bias: np.ndarray, slope: np.ndarray, centre: float) -> tuple[float, float]:
    """Temperature at which the mean of the biases is zero, and its s.d., °C and K.

    bias [N] at the temperature `centre`. Seen is the mean bias, slope·(centre - T₀) and what the gyros' own spread
    leaves; T₀ is normal about `centre` beforehand, of the s.d. NULLED_WITHIN.
    """
    gyros, common = len(bias), float(slope.mean())
    left = float(bias.var(ddof=1)) / gyros if gyros > 1 else float(bias[0]) ** 2
    precision = NULLED_WITHIN**-2 + common**2 / left if left > 0 else np.inf
    mean = common * float(bias.mean()) / left / precision if left > 0 else 0.0
    return centre - mean, float(precision**-0.5)

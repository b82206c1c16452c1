"""How long the blocks of a bootstrap are."""

from __future__ import annotations

import numpy as np

from vgyro.metrics.correlation import autocorrelation, correlation_length

FEWEST_UNITS = 8
FEWEST_BLOCKS = 8


def block_length(units: np.ndarray) -> int:
    """Length of the bootstrap's blocks for a series [U] of unit means.

    (6^(1/2) ρ/(1-ρ²))^(2/3) · U^(1/3), the rule for an AR(1) series (Carlstein 1986; Politis & White 2004), ρ that of
    the AR(1) with the series' own correlation length; at least U^(1/3), at most U/8, so that there are blocks to
    choose from. No length serves a series that drifts all the time: see vgyro.metrics.intervals.drift.
    """
    number = len(units)
    if number == 0:
        return 1
    lowest, highest = int(np.ceil(number ** (1 / 3))), max(number // FEWEST_BLOCKS, 1)
    centred = units - units.mean()
    if number < FEWEST_UNITS or not np.any(centred):
        return min(lowest, highest)
    length = correlation_length(autocorrelation(centred, max(number // 2, 2)))
    rho = (length - 1) / (length + 1)
    rule = int(np.ceil((np.sqrt(6) * rho / (1 - rho**2)) ** (2 / 3) * number ** (1 / 3)))
    return int(min(max(rule, lowest), highest))

"""What the steps of the gyros' values do to means and variances of blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.fusion.samples.quantised import lasting_variance, least_variance, noise_before

COARSE = 0.25
"""Steps are coarse where the variance of rounding is so much of a gyro's."""


@dataclass(frozen=True)
class Rounding:
    """What the steps of the values of N gyros add to the means and variances of blocks.

    lasting : [N], (deg/s)², variance of the part of the rounding error that stays the same as long as the rate does
    toggles : [N], (deg/s)², by how much the variance of a sample in one block may exceed the usual one: coarse values
              are constant in some blocks, and go to and fro between two of them in others; 0 where the steps are fine
    """

    lasting: np.ndarray
    toggles: np.ndarray


def rounding_of(step: np.ndarray, variance: np.ndarray) -> Rounding:
    """The effect of rounding on the block means and variances of N gyros.

    step     : [N], deg/s, distance of neighbouring values of each gyro; 0 where no steps are seen
    variance : [N], (deg/s)², usual variance of a sample, rounding included
    """
    pairs = zip(step.tolist(), variance.tolist(), strict=True)
    lasting = np.array([lasting_variance(q, noise_before(q, seen)) if q > 0 else 0.0 for q, seen in pairs])
    coarse = (step > 0) & (least_variance(step) > COARSE * variance)
    return Rounding(lasting, np.where(coarse, step**2 / 4.0 - least_variance(step), 0.0))

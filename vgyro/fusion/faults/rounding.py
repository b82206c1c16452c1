"""What the steps of the gyros' values do to means and variances of blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.fusion.samples.quantised import lasting_variance, least_variance, noise_before

COARSE = 0.25
"""Steps are coarse where the variance of rounding is so much of a gyro's."""


@dataclass(frozen=True)
class Rounding:
    """lasting : [N] (deg/s)², of the part of the error that stays while the rate does
    toggles : [N] (deg/s)², by how much a sample's variance may be above the usual one: coarse values are constant in
              some blocks, and go to and fro between two in others
    """

    lasting: np.ndarray
    toggles: np.ndarray


def rounding_of(step: np.ndarray, variance: np.ndarray) -> Rounding:
    """step [N] deg/s, 0: none is seen;  variance [N] : of a sample, as rounded, (deg/s)²"""
    pairs = zip(step.tolist(), variance.tolist(), strict=True)
    lasting = np.array([lasting_variance(q, noise_before(q, seen)) if q > 0 else 0.0 for q, seen in pairs])
    coarse = (step > 0) & (least_variance(step) > COARSE * variance)
    return Rounding(lasting, np.where(coarse, step**2 / 4.0 - least_variance(step), 0.0))

"""Allan covariances of the gyros for the methods that need them: of the noise record, or of this recording at rest."""

from __future__ import annotations

import numpy as np

from vgyro.arrays import Floats
from vgyro.fusion.types import AllanScales, ArrayRates, CannotRun, FilterParameters

LONGEST_TAU = 4  # the longest τ is a fourth of the longest stretch: half of it then holds differences
MOST_DIFFERENCES = 1 << 17
NO_RECORD = "no record at rest has given the Allan covariances of the gyros"
FROM_ITSELF = "weights made from this very recording"
"""Part of the note of a row that has seen what it weighs; the report looks for it."""


def rest_scales(array: ArrayRates, parameters: FilterParameters) -> tuple[AllanScales, str]:
    """Allan covariances of the array, and what to know of them.

    From the noise record; where that has none, from the recording itself if it is at rest as a whole.
    raises : CannotRun if neither is there
    """
    known = array.noise.scales
    if known is not None:
        return known, FROM_ITSELF if known.own else ""
    if parameters.in_motion or not array.at_rest.all():
        raise CannotRun(NO_RECORD, remedy="add a recording at rest to the data set")
    return array.once("rest_scales", lambda: own_scales(array)), FROM_ITSELF


def own_scales(array: ArrayRates) -> AllanScales:
    """The Allan covariances of a recording, as vgyro.metrics.allan_scales has them of one without losses.

    raises : CannotRun if no gap-free stretch has four samples
    """
    stretches = array.stretches()
    length = np.array([part.stop - part.start for part in stretches])
    factors = 2 ** np.arange((int(length.max()) // LONGEST_TAU).bit_length())
    if len(factors) == 0:
        raise CannotRun(f"the longest stretch has {length.max()} samples, fewer than 4")
    found: list[list[np.ndarray]] = [[] for _ in factors]
    for column in array.rate.T:
        angles = [angle_of(column[part]) for part in stretches]
        for differences, m in zip(found, factors.tolist(), strict=True):
            total = int(np.maximum(length - 2 * m + 1, 0).sum())
            stride = -(-total // MOST_DIFFERENCES)
            differences.append(np.concatenate([second_differences(one, m, stride) for one in angles]))
    covariance = np.array([_covariance(np.column_stack(differences)) for differences in found])
    pairs = np.maximum(length / factors[:, None] - 1, 0).sum(axis=1)
    return AllanScales(factors / array.rate_hz, covariance, pairs, own=True)


def angle_of(rate: np.ndarray) -> np.ndarray:
    """Sum of the samples [T] before each border [T + 1], about their mean."""
    rate = np.asarray(rate, dtype=float)
    return np.concatenate([[0.0], np.cumsum(rate - rate.mean())])


def second_differences(angle: Floats, factor: int, stride: int) -> Floats:
    """Differences of adjacent means over `factor` samples, `stride` samples from one to the next; none if too short."""
    number = len(angle) - 2 * factor
    if number <= 0:
        return np.empty(0)
    first, middle, last = (angle[part * factor : part * factor + number : stride] for part in range(3))
    return (last - 2.0 * middle + first) / factor


def _covariance(differences: Floats) -> Floats:
    return differences.T @ differences / (2.0 * len(differences))

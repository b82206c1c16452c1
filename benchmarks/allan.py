"""Overlapping Allan deviation of a day at 200 Hz, against allantools."""

from __future__ import annotations

from importlib.metadata import version

import numpy as np

from benchmarks.contest import Accuracy, Contest, Rival, Side
from benchmarks.limits import arithmetic
from benchmarks.series import rates
from vgyro import engine

RATE_HZ = 200.0
RELATIVE = 1e-7
# A second difference, its square and the sum: 5 operations for each of the T + 1 - 2m of a factor m; the rate is read.
FLOPS, READ = 5, 8


def contests(quick: bool) -> list[Contest]:
    """The same factors for both, three an octave, up to a third of the record."""
    samples = 200_000 if quick else 17_280_000
    rate = rates(samples, seed=16)
    factors = octave_factors(samples)
    native = engine.get("native").allan
    ours = Side("vgyro", lambda: native.differences(rate, factors), samples)
    allantools = Side(f"AllanTools {version('AllanTools')}", lambda: by_allantools(rate, factors), samples)

    def accuracy() -> list[Accuracy]:
        sums, counts = native.differences(rate, factors)
        mine, theirs = np.sqrt(sums / counts), by_allantools(rate, factors)
        return [Accuracy("deviation, largest relative difference", float(np.max(np.abs(mine / theirs - 1))), RELATIVE)]

    terms = float(np.sum(samples + 1 - 2 * factors))
    size = f"{samples:,} samples".replace(",", " ")
    return [
        Contest(
            "allan", f"Allan deviation, {size}, {len(factors)} τ", "sample", ours, (Rival(allantools, 4),),
            arithmetic(FLOPS * terms / samples, 0, READ), accuracy,
        )
    ]  # fmt: skip


def octave_factors(samples: int) -> np.ndarray:
    """Averaging factors, three an octave, up to a third of the record."""
    octaves = np.arange(0, 3 * np.log2(samples / 3) + 1e-9)
    return np.unique(np.floor(2 ** (octaves / 3)).astype(np.int64))


def by_allantools(rate: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """allantools from the rate; the mean is taken off before, else its running sum loses digits."""
    import allantools

    return allantools.oadev(rate - rate.mean(), RATE_HZ, "freq", factors / RATE_HZ)[1]

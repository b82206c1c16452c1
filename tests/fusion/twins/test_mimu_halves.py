"""Real array, held-out halves: weights from one half of the rest poses, the error on the other half."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from harness import Columns, with_faults

from benchmarks.mimu import AXES, CAPTURES, LONG_S, RATE_HZ, SCALE
from vgyro.calibration import find_rest
from vgyro.config import MetricsOptions
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters
from vgyro.fusion.noise.band import in_band
from vgyro.fusion.noise.parity import parity_variances
from vgyro.metrics import Sampling
from vgyro.tasks.fusion.noise import noise_at_rest, record_of

PASSED_HZ = 1.2
"""Noise bandwidth of the smoother at rest, of 1 Hz."""


@cache
def poses(folder: Path, capture: str) -> tuple[list[str], list[np.ndarray]]:
    """Names of the gyros, and the rest poses of a capture, [n, 24] deg/s each."""
    table = pq.read_table(folder / "mimu4444-array" / f"{capture}.parquet")
    names = [name for name in table.column_names if "_g" in name]
    rates = np.column_stack([table.column(name).to_numpy() * SCALE for name in names])
    still = find_rest(rates, RATE_HZ)
    edges = [0, *(np.flatnonzero(np.diff(still)) + 1).tolist(), len(still)]
    runs = [rates[start:stop] for start, stop in pairwise(edges) if still[start]]
    return names, [run for run in runs if len(run) > LONG_S * RATE_HZ]


def array_of(half: list[np.ndarray], gyros: list[str]) -> ArrayRates:
    """One array at rest, a stretch a pose; its noise as the noise stage finds it."""
    rate = np.asfortranarray(np.concatenate(half))
    segment = np.repeat(np.arange(len(half), dtype=np.int32), [len(pose) for pose in half])
    found = noise_at_rest(Columns(rate), Sampling.of(RATE_HZ, segment), MetricsOptions(bootstrap=50), "native")
    record = record_of(found, gyros, "", "")
    arw, rrw = (np.array([record[name][gyro] for gyro in gyros], dtype=float) for name in ("arw", "rrw"))
    noise = ArrayNoise(arw, rrw, np.array(record["correlation"]))
    begins = np.cumsum([0.0, *(len(pose) / RATE_HZ + 5.0 for pose in half[:-1])])
    array = ArrayRates(rate, RATE_HZ, segment, np.ones(len(rate), dtype=bool), noise, stretch_time=begins)
    return with_faults(array)


def weights_of(array: ArrayRates) -> dict[str, np.ndarray]:
    """Fixed weights [N] of four methods, from one half."""
    from vgyro.fusion.ours.recommended import static_weights

    inverse = array.noise.arw**-2.0
    ours = static_weights(array, FilterParameters())
    found = in_band(array, parity_variances(array, FilterParameters(), changing=False), PASSED_HZ)[0]
    return {
        "ours": ours,
        "band": found.weights()[0],
        "inverse": inverse / inverse.sum(),
        "average": np.full(len(ours), 1 / len(ours)),
    }


def scatter(half: list[np.ndarray], weights: np.ndarray, seconds: float) -> float:
    """S.d. of the fused rate about each pose's mean, deg/s; seconds > 0: of its means over so long."""
    size = max(1, round(seconds * RATE_HZ))
    squares, freedom = 0.0, 0
    for pose in half:
        fused = pose @ weights
        means = fused[: len(fused) // size * size].reshape(-1, size).mean(axis=1)
        squares += float(((means - means.mean()) ** 2).sum())
        freedom += len(means) - 1
    return float(np.sqrt(squares / freedom))


def held_out(folder: Path, axis: str, captures: Sequence[str]) -> dict[str, tuple[float, float]]:
    """R.m.s. over captures and both directions of the s.d. on the half that the weights are not from.

    returns : method → s.d. of the samples and of the means of 1 s, deg/s
    """
    found: dict[str, list[list[float]]] = {}
    for capture in captures:
        names, every = poses(folder, capture)
        signs = [1.0 if int(name[3]) % 2 else -1.0 for name in AXES[axis]]
        columns = [names.index(name) for name in AXES[axis]]
        turned = [pose[:, columns] * signs for pose in every]
        for known, unseen in ((turned[::2], turned[1::2]), (turned[1::2], turned[::2])):
            for name, weights in weights_of(array_of(known, AXES[axis])).items():
                found.setdefault(name, []).append([scatter(unseen, weights, seconds) for seconds in (0.0, 1.0)])
    return {name: tuple(np.sqrt(np.mean(np.square(values), axis=0))) for name, values in found.items()}


def holds(found: dict[str, tuple[float, float]], axis: str) -> None:
    """Ours <= inverse variance <= average at the sample rate, but for one pair.

    On y the gyro of IMU 7 is bad at the sample rate and not at 1 s (tests/metrics/test_real_recordings.py). ARW does
    not see that, so that weights from it are no better than equal ones.
    """
    ours, inverse, average = (found[name][0] for name in ("ours", "inverse", "average"))
    assert ours <= inverse
    assert ours <= average
    # Over a second: the weights of the band that passes, as `recommended` has them. Inverse variance of the ARW is made
    # for that band; it may be 3 % better (it is by 2 % on x), not more.
    sample, band, arw = (found[name][1] for name in ("ours", "band", "inverse"))
    assert band <= 0.99 * sample
    assert band <= 1.03 * arw
    if axis != "y":
        assert inverse <= average


@pytest.mark.parametrize("axis", AXES)
def test_held_out_half_of_one_capture(shared_data: Path, axis: str):
    holds(held_out(shared_data, axis, CAPTURES[:1]), axis)


@pytest.mark.full
@pytest.mark.parametrize("axis", AXES)
def test_held_out_halves_of_both_captures(shared_data: Path, axis: str):
    holds(held_out(shared_data, axis, CAPTURES), axis)

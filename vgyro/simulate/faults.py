"""Faults of single gyros, as arrays that act on the noise, the bias, the gain and the counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.simulate.twin import EVERY_GYRO, Fault


@dataclass(frozen=True)
class Faults:
    """[T, N] each but the last two: [N] lists of stretches [first, last) of samples.

    added_bias, burst, burst_sd : deg/s;  noise_gain, gain : 1;  active : true while any fault acts
    """

    added_bias: np.ndarray
    burst: np.ndarray
    burst_sd: np.ndarray
    noise_gain: np.ndarray
    gain: np.ndarray
    active: np.ndarray
    stuck: list[list[tuple[int, int]]]
    dropout: list[list[tuple[int, int]]]


def faults_of(
    faults: Sequence[Fault], gyros: list[str], time: np.ndarray, generators: list[np.random.Generator]
) -> Faults:
    """Lay the faults of a recording over its samples.

    gyros : names, in the order of the columns;  time : [T], s;  generators : one a gyro, for the bursts
    """
    shape = (time.size, len(gyros))
    laid = Faults(
        np.zeros(shape), np.zeros(shape), np.zeros(shape), np.ones(shape), np.ones(shape), np.zeros(shape, dtype=bool),
        [[] for _ in gyros], [[] for _ in gyros],
    )  # fmt: skip
    for fault in faults:
        stop = time[-1] + (time[1] - time[0]) if fault.stop is None else fault.stop
        first, last = (int(index) for index in np.searchsorted(time, [fault.start - 1e-9, stop - 1e-9]))
        for index, name in enumerate(gyros):
            if fault.gyro in (name, EVERY_GYRO) and last > first:
                laid.active[first:last, index] = True
                _lay(
                    laid,
                    fault,
                    slice(first, last),
                    index,
                    (time[first:last] - fault.start) / (stop - fault.start),
                    generators,
                )
    return laid


def _lay(
    laid: Faults, fault: Fault, rows: slice, gyro: int, share: np.ndarray, generators: list[np.random.Generator]
) -> None:
    """share : [rows], part of the fault's time that has passed."""
    size = fault.size or 0.0
    match fault.kind:
        case "drift":
            laid.added_bias[rows, gyro] += size * share
        case "step":
            laid.added_bias[rows, gyro] += size
        case "burst":
            laid.burst[rows, gyro] += size * generators[gyro].standard_normal(share.size)
            laid.burst_sd[rows, gyro] = np.hypot(laid.burst_sd[rows, gyro], size)
        case "noise":
            laid.noise_gain[rows, gyro] *= size
        case "scale":
            laid.gain[rows, gyro] *= 1.0 + size
        case "stuck":
            laid.stuck[gyro].append((rows.start, rows.stop))
        case "dropout":
            laid.dropout[gyro].append((rows.start, rows.stop))

"""Faults of single gyros, as arrays that act on the noise, the bias, the gain and the counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.simulate.rows import row_at
from vgyro.simulate.twin import EVERY_GYRO, Fault


@dataclass(frozen=True)
class Stretch:
    """A fault of one gyro over rows [first, last) of the recording; it lasts until `stop`, s."""

    fault: Fault
    gyro: int
    first: int
    last: int
    stop: float
    generator: np.random.Generator | None  # of a burst


@dataclass(frozen=True)
class Faults:
    """What the faults do to a piece of a recording, [T, N] each.

    added_bias, burst, burst_sd : deg/s;  noise_gain, gain : 1;  active : true while any fault acts
    """

    added_bias: np.ndarray
    burst: np.ndarray
    burst_sd: np.ndarray
    noise_gain: np.ndarray
    gain: np.ndarray
    active: np.ndarray


def stretches_of(
    faults: Sequence[Fault],
    gyros: list[str],
    samples: int,
    rate_hz: float,
    generator: Callable[[str, int], np.random.Generator],
) -> list[Stretch]:
    """The faults of a recording of so many samples, gyro by gyro.

    gyros : names, in the order of the columns;  generator : of the nth burst of a gyro
    """
    end = (samples - 1) / rate_hz + 1.0 / rate_hz
    laid: list[Stretch] = []
    for fault in faults:
        stop = end if fault.stop is None else fault.stop
        first, last = (min(row_at(moment - 1e-9, rate_hz), samples) for moment in (fault.start, stop))
        for index, name in enumerate(gyros):
            if fault.gyro in (name, EVERY_GYRO) and last > first:
                bursts = sum(other.gyro == index and other.generator is not None for other in laid)
                source = generator(name, bursts) if fault.kind == "burst" else None
                laid.append(Stretch(fault, index, first, last, stop, source))
    return laid


def faults_of(stretches: Sequence[Stretch], gyros: int, time: np.ndarray, first: int) -> Faults:
    """Lay the faults over one piece; the pieces must come in order.  time : [T], s, of rows first, first + 1, …"""
    shape = (time.size, gyros)
    laid = Faults(
        np.zeros(shape), np.zeros(shape), np.zeros(shape), np.ones(shape), np.ones(shape), np.zeros(shape, dtype=bool)
    )
    for stretch in stretches:
        start, stop = max(stretch.first - first, 0), min(stretch.last - first, time.size)
        if stop > start:
            _lay(laid, stretch, slice(start, stop), time[start:stop])
    return laid


def _lay(laid: Faults, stretch: Stretch, rows: slice, time: np.ndarray) -> None:
    fault, gyro = stretch.fault, stretch.gyro
    size = fault.size or 0.0
    laid.active[rows, gyro] = True
    match fault.kind:
        case "drift":
            laid.added_bias[rows, gyro] += size * ((time - fault.start) / (stretch.stop - fault.start))
        case "step":
            laid.added_bias[rows, gyro] += size
        case "burst":
            assert stretch.generator is not None
            laid.burst[rows, gyro] += size * stretch.generator.standard_normal(time.size)
            laid.burst_sd[rows, gyro] = np.hypot(laid.burst_sd[rows, gyro], size)
        case "noise":
            laid.noise_gain[rows, gyro] *= size
        case "scale":
            laid.gain[rows, gyro] *= 1.0 + size
        case "stuck" | "dropout":
            pass  # these act on the counts: see vgyro.simulate.adc

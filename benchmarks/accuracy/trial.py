"""What a simulated trial is: its recordings, and everything that is true of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.accuracy.scenario import FaultSort, Scenario


@dataclass(frozen=True)
class TrueFault:
    """gyros : place of the gyro at fault, or of those of which any may be named;  samples [start, stop)"""

    gyros: tuple[int, ...]
    sort: FaultSort
    start: int
    stop: int


@dataclass(frozen=True)
class Known:
    """What only the oracle knows of a recording.

    deviation   : [T, N] deg/s, s.d. of the white noise of each sample (before a low-pass, where it passes one)
    correlation : [N, N], or [B, N, N] of each block;  block : [T] number of the block, None: one for all
    walk        : [T, N] deg/s, s.d. of each step of the biases;  bias_sd : deg/s, at the beginning
    usable      : bool [T, N], false where a gyro says nothing of the rate
    scale       : [N] scale factor errors;  offset : [T, N] deg/s, slow errors that are no random walk
    moving      : [T] factor on the motion, 0 at rest;  line : [T] deg/s, the vibration in the truth
    values      : [T, N] deg/s, the rates before they were rounded
    poles       : [N] decay of each gyro's pole per made sample, 0: none;  late : [N] samples by which each is late
    """

    deviation: np.ndarray
    correlation: np.ndarray
    block: np.ndarray | None
    walk: np.ndarray
    bias_sd: float
    usable: np.ndarray
    scale: np.ndarray
    offset: np.ndarray
    moving: np.ndarray
    line: np.ndarray
    values: np.ndarray
    poles: np.ndarray
    late: np.ndarray


@dataclass(frozen=True)
class Recording:
    """One recording of one array, as a log would hold it, and its truth.

    rate    : [T, N] deg/s, columns contiguous, NaN where a gyro has no value;  time : [T] s;  segment : [T] int32
    kind    : as a manifest declares it;  temperature : [T] °C, None: not logged
    at_rest : [T] bool, true;  truth : [T] deg/s, at the moments of the samples
    """

    kind: str
    rate: np.ndarray
    rate_hz: float
    time: np.ndarray
    segment: np.ndarray
    at_rest: np.ndarray
    truth: np.ndarray
    temperature: np.ndarray | None
    faults: tuple[TrueFault, ...]
    known: Known

    @property
    def stretch_time(self) -> np.ndarray:
        """Time of the first sample of each gap-free stretch [S], s."""
        return self.time[np.append(0, np.flatnonzero(np.diff(self.segment)) + 1)]

    @property
    def missing(self) -> np.ndarray:
        """bool [T, N], where a gyro has no value."""
        return np.isnan(self.rate)


@dataclass(frozen=True)
class Trial:
    """One array of a scenario.  rest : its rest recording, None: there is none;  motion : its motion"""

    scenario: Scenario
    seed: int
    motion: Recording
    rest: Recording | None

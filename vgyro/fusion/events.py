"""Events: stretches of a recording in which one gyro is at fault."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

FaultKind = Literal[
    "drift", "step", "noise", "burst", "stuck", "dropout", "scale", "dead", "copy", "outlier", "clipped"
]
FAULT_KINDS: tuple[FaultKind, ...] = (
    "drift", "step", "noise", "burst", "stuck", "dropout", "scale", "dead", "copy", "outlier", "clipped",
)  # fmt: skip
"""drift: the bias leaves its random walk; step: at once; noise: more of it, for long; burst: for a short time;
stuck: one value is repeated; dropout: zero or nothing; scale: the sensitivity changes (seen in motion only);
dead: nothing of the motion is in its rate; copy: its samples are those of another gyro; outlier: a few samples are
absurd; clipped: its range ends where the other gyros go on."""


@dataclass(frozen=True)
class FaultEvent:
    """One gyro at fault over samples [start, stop) of the recording.

    gyro     : place in the array, from 0
    evidence : size over its standard error, σ; infinite where the values alone show it (stuck, dropout, copy, clipped)
    size     : in `unit`: deg/s of a drift (greatest), step or outlier (greatest), ratio of the noise, ratio of the
               scale minus 1, deg/s of the end of the range; NaN for stuck, dropout and copy
    other    : place of the gyro that a copy repeats; None: of another kind
    """

    gyro: int
    kind: FaultKind
    start: int
    stop: int
    evidence: float
    size: float
    unit: str
    other: int | None = None

    def within(self, first: int, last: int) -> FaultEvent:
        """The part of it in samples [first, last), counted from `first`."""
        return replace(self, start=max(self.start, first) - first, stop=min(self.stop, last) - first)


def excluded(events: Iterable[FaultEvent], samples: int, gyros: int) -> list[np.ndarray]:
    """Stretches [M, 2] of samples in which each gyro is at fault, in order and without overlap: one array a gyro.

    A gyro that clips is right between the ends of its range: the samples that are not: vgyro.fusion.samples.clipped.
    """
    found = []
    at_fault = [one for one in events if one.kind != "clipped"]
    for gyro in range(gyros):
        spans = sorted((max(one.start, 0), min(one.stop, samples)) for one in at_fault if one.gyro == gyro)
        merged: list[list[int]] = []
        for start, stop in spans:
            if stop <= start:
                continue
            if merged and start <= merged[-1][1]:
                merged[-1][1] = max(merged[-1][1], stop)
            else:
                merged.append([start, stop])
        found.append(np.array(merged, dtype=np.int64).reshape(-1, 2))
    return found

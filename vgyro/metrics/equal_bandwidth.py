"""Every series brought to one bandwidth, so that their 1σ can be compared."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.metrics.allan import stretches

SETTLED = 8.0  # time constants after which a start is forgotten: e^-8 of it is left, e^-16 of its variance
ALIKE = 1e-6


@dataclass(frozen=True)
class LowPass:
    """What a method does to a series: -3 dB bandwidth, Hz (None: not limited), and gain for a constant rate.

    As the filters of vgyro.fusion: y_k = k·y_{k-1} + (1 - k)·gain·x_k, k = e^(-2π·bandwidth/rate).
    """

    bandwidth_hz: float | None = None
    dc_gain: float = 1.0


@dataclass(frozen=True)
class Equaliser:
    """A first-order low-pass to one bandwidth.

    runs : first sample and last + 1 of the gap-free stretches that are long enough;  settling : samples that each of
    them loses at its start;  engine : who runs the recursion
    """

    bandwidth_hz: float
    rate_hz: float
    runs: list[tuple[int, int]]
    settling: int
    engine: str = "native"

    @classmethod
    def of(cls, bandwidth_hz: float, rate_hz: float, segment: np.ndarray, engine: str = "native") -> Equaliser:
        """segment : array [T] int, number of the gap-free stretch of each sample"""
        settling = math.ceil(SETTLED * rate_hz / (2 * math.pi * bandwidth_hz))
        runs = [(start, stop) for start, stop in stretches(segment) if stop - start > settling]
        return cls(bandwidth_hz, rate_hz, runs, settling, engine)

    @property
    def cuts(self) -> list[tuple[int, int]]:
        """First sample and last + 1 of each stretch, counted in the samples that `apply` returns."""
        ends = np.cumsum([0, *(stop - start - self.settling for start, stop in self.runs)]).tolist()
        return list(itertools.pairwise(ends))

    def apply(self, values: np.ndarray, low_pass: LowPass) -> np.ndarray:
        """A series [T] at the common bandwidth and a DC gain of 1, without the settling of each stretch.

        low_pass : what it went through. A first-order low-pass of another bandwidth is undone exactly, sample by
        sample, before the common one is put on: lead-lag; a series that is at the common bandwidth stays as it is.
        """
        cuts = self.cuts
        found = np.empty(cuts[-1][1] if cuts else 0)
        for (first, last), (start, stop) in zip(cuts, self.runs, strict=True):
            np.divide(self._run(values[start:stop], low_pass), low_pass.dc_gain, out=found[first:last])
        return found

    def _run(self, values: np.ndarray, low_pass: LowPass) -> np.ndarray:
        own = low_pass.bandwidth_hz
        if own is not None and abs(own / self.bandwidth_hz - 1) <= ALIKE:
            return values[self.settling :]
        if own is not None:
            keep = self._keep(own)
            raw = np.array(values, dtype=float)
            raw[1:] -= keep * values[:-1]
            raw[1:] /= 1 - keep
            values = raw
        keep = self._keep(self.bandwidth_hz)
        recursion = engines.get(self.engine).kalman.low_pass
        return recursion(values, keep, 1 - keep, float(values[0]))[self.settling :]

    def _keep(self, bandwidth_hz: float) -> float:
        return math.exp(-2 * math.pi * bandwidth_hz / self.rate_hz)


def common_bandwidth(filters: Sequence[LowPass], chosen: float | None) -> float | None:
    """The bandwidth at which series are compared, Hz: as chosen, else the narrowest; None where nothing limits them."""
    limits = [one.bandwidth_hz for one in filters if one.bandwidth_hz is not None]
    return chosen if chosen is not None else min(limits, default=None)

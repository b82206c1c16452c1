"""Every series brought to one bandwidth, so that their 1σ can be compared."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Floats
from vgyro.metrics.allan.deviation import stretches

SETTLED = 8.0  # time constants after which a start is forgotten: e^-8 of it is left, e^-16 of its variance
ALIKE = 1e-6
BOTH_WAYS = math.sqrt(math.sqrt(2) - 1)
"""-3 dB bandwidth of a first-order low-pass that runs forward and back, over that of one run: 1/(1 + x²)² = 1/2."""
BY_SHAPE = f"forward and back: by its shape alone it passes {math.sqrt(1 / (2 * BOTH_WAYS)):.2f} of the 1σ of one pass"
"""White noise: noise-equivalent bandwidths of π/4 · bandwidth/BOTH_WAYS and π/2 · bandwidth."""
OTHER_SHAPE = "its smoother has another shape"


@dataclass(frozen=True)
class LowPass:
    """What a method does to a series: -3 dB bandwidth, Hz (None: not limited), and gain for a constant rate.

    passes : 1, as the filters of vgyro.fusion: y_k = k·y_{k-1} + (1 - k)·gain·x_k, k = e^(-2π·bandwidth/rate);
             2, such a low-pass forward and back, bandwidth_hz that of both together; 0, limited in another way
    """

    bandwidth_hz: float | None = None
    dc_gain: float = 1.0
    passes: int = 1

    @property
    def other_shape(self) -> bool:
        """Is the bandwidth limited, but not by a first-order low-pass?"""
        return self.bandwidth_hz is not None and self.passes == 0

    @property
    def shortest_tau(self) -> float:
        """τ below which the Allan curve is the low-pass's own and not the noise's, s: 2Tc of one pass; 0: none is."""
        return 0.0 if self.bandwidth_hz is None else 1 / (math.pi * self.bandwidth_hz)

    @property
    def both_ways(self) -> bool:
        """Did a first-order low-pass run over it forward and back?"""
        return self.bandwidth_hz is not None and self.passes == 2

    @property
    def constant(self) -> float:
        """Time constant of each pass, s; 0 where there is none."""
        if self.bandwidth_hz is None or self.other_shape:
            return 0.0
        return 1 / (2 * math.pi * pass_hz(self.bandwidth_hz, self.passes))


def pass_hz(bandwidth_hz: float, passes: int) -> float:
    """-3 dB bandwidth of each pass of a first-order low-pass whose passes together have `bandwidth_hz`."""
    return bandwidth_hz / BOTH_WAYS if passes == 2 else bandwidth_hz


@dataclass(frozen=True)
class Equaliser:
    """A first-order low-pass to one bandwidth.

    runs : first sample and last + 1 of the gap-free stretches that are long enough;  settling : samples that each of
    them loses at its start, and at its end where `back`;  engine : who runs the recursion
    back : some of the series were filtered backward, which settles from the end on
    """

    bandwidth_hz: float
    rate_hz: float
    runs: list[tuple[int, int]]
    settling: int
    engine: str = "native"
    back: bool = False

    @classmethod
    def of(
        cls, bandwidth_hz: float, rate_hz: float, segment: np.ndarray, engine: str = "native", back: bool = False
    ) -> Equaliser:
        """segment : array [T] int, number of the gap-free stretch of each sample"""
        settling = math.ceil(SETTLED * rate_hz / (2 * math.pi * bandwidth_hz))
        lost = settling * (1 + back)
        runs = [(start, stop) for start, stop in stretches(segment) if stop - start > lost]
        return cls(bandwidth_hz, rate_hz, runs, settling, engine, back)

    @property
    def cuts(self) -> list[tuple[int, int]]:
        """First sample and last + 1 of each stretch, counted in the samples that `apply` returns."""
        lost = self.settling * (1 + self.back)
        ends = np.cumsum([0, *(stop - start - lost for start, stop in self.runs)]).tolist()
        return list(itertools.pairwise(ends))

    def apply(self, values: np.ndarray, low_pass: LowPass) -> np.ndarray:
        """A series [T] at the common bandwidth and a DC gain of 1, without the settling of each stretch.

        low_pass : what it went through, not of another shape. A first-order low-pass of another bandwidth is undone
        exactly, sample by sample, before the common one is put on: lead-lag, forward and back where it ran so; a series
        that is at the common bandwidth stays as it is.
        """
        cuts = self.cuts
        found = np.empty(cuts[-1][1] if cuts else 0)
        for (first, last), (start, stop) in zip(cuts, self.runs, strict=True):
            run = self._run(values[start:stop], low_pass)
            np.divide(run[self.settling : self.settling + last - first], low_pass.dc_gain, out=found[first:last])
        return found

    def _run(self, values: np.ndarray, low_pass: LowPass) -> np.ndarray:
        own = low_pass.bandwidth_hz
        if own is None:
            return self._put_on(values, self.bandwidth_hz)
        if abs(own / self.bandwidth_hz - 1) <= ALIKE:
            return values
        there, wanted = (pass_hz(one, low_pass.passes) for one in (own, self.bandwidth_hz))
        values = self._put_on(self._undone(values, there), wanted)
        if low_pass.both_ways:
            values = self._put_on(self._undone(values[::-1], there), wanted)[::-1]
        return values

    def _undone(self, values: np.ndarray, bandwidth_hz: float) -> np.ndarray:
        """What a low-pass made these values from; the first one stays."""
        keep = self._keep(bandwidth_hz)
        raw = np.array(values, dtype=float)
        raw[1:] -= keep * values[:-1]
        raw[1:] /= 1 - keep
        return raw

    def _put_on(self, values: Floats, bandwidth_hz: float) -> Floats:
        keep = self._keep(bandwidth_hz)
        recursion = engines.get(self.engine).kalman.low_pass
        filtered: Floats = recursion(values, keep, 1 - keep, float(values[0]))
        return filtered

    def _keep(self, bandwidth_hz: float) -> float:
        return math.exp(-2 * math.pi * bandwidth_hz / self.rate_hz)


def common_bandwidth(filters: Sequence[LowPass], chosen: float | None) -> float | None:
    """The bandwidth at which series are compared, Hz: as chosen, else the narrowest; None where nothing limits them.

    A smoother of another shape sets no bandwidth for the others.
    """
    limits = [one.bandwidth_hz for one in filters if one.bandwidth_hz is not None and not one.other_shape]
    return chosen if chosen is not None else min(limits, default=None)


def run_back(filters: Sequence[LowPass]) -> bool:
    """Was any of the series filtered backward?"""
    return any(one.both_ways for one in filters)

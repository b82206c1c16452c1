"""What models of the rate are compared on: stretches of a recording, and their likelihood."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vgyro import engine as engines
from vgyro.engine.linear import StateSpace
from vgyro.errors import DataError, TooShort
from vgyro.fusion.motion_models import Dynamics, dynamics

MOST_SAMPLES = 1 << 14
"""A recording of no more samples is used as it is. Of a longer one: windows at its full rate, and block means."""
WINDOWS, WINDOW = 4, 1 << 12
BLOCKS = 1 << 13
RUNS = 16
"""The most gap-free stretches that are used, the longest ones."""
SHORTEST = 32
SKIP = 16
"""First samples of each stretch that are given, not predicted: the same for every model, wherever it starts."""
WIDE = 1e5
"""Variance of a start that counts as knowing nothing, over that of the noise."""


@dataclass(frozen=True)
class Series:
    """A gap-free stretch of samples, or of means of `size` of them.

    z, r : [T], deg/s and (deg/s)²;  phi : of the noise;  shrink : r over the mean variance of the samples
    """

    z: np.ndarray
    r: np.ndarray
    size: int = 1
    phi: float = 0.0
    shrink: float = 1.0


@dataclass(frozen=True)
class Evidence:
    """What the models are compared on.

    noise_density : of the noise at low frequency, deg²/s;  duration_s : from the first sample to the last
    excess        : variance of the rate beside its noise, (deg/s)², at least a little
    """

    series: list[Series]
    rate_hz: float
    noise_density: float
    duration_s: float
    excess: float
    phi: float
    engine: str = "native"

    def log_likelihood(self, model: str, parameters: Mapping[str, float], engine: str = "") -> tuple[float, int]:
        """Summed over the series, and the number of samples that were predicted; -inf where a model breaks down."""
        run = engines.get(engine or self.engine).statespace.log_likelihood
        total, count = self._sum(
            model, parameters, lambda one, space: run(one.z, one.r, space, min(SKIP, len(one.z) // 4))
        )
        return (total if math.isfinite(total) else -math.inf), count

    def risk(self, model: str, parameters: Mapping[str, float]) -> float:
        """Unbiased estimate of the smoother's squared error, in units of the noise at low frequency, summed, but for a
        constant; infinite where a model breaks down.

        E(ŵ - w)² = E(z - ŵ)² - r + 2·cov(ŵ, v), and the covariance is the variance P that the smoother claims, whatever
        the rate does and whatever the noise's colour is. Stein (1981), Ann. Statist. 9, 1135-1151.
        """
        run = engines.get(self.engine).statespace.smooth

        def of(one: Series, space: StateSpace) -> tuple[float, int]:
            smoothed, variance = run(one.z, one.r, space)
            told = np.isfinite(one.r)
            if not np.all(variance > 0.0):
                return math.inf, 0
            squares = (one.z[told] - smoothed[told]) ** 2 + 2.0 * variance[told]
            return float(np.sum(squares / one.r[told])) * (1.0 - one.phi) / (1.0 + one.phi), 0

        return self._sum(model, parameters, of)[0]

    def _sum(
        self, model: str, parameters: Mapping[str, float], run: Callable[[Series, StateSpace], tuple[float, int]]
    ) -> tuple[float, int]:
        total, count = 0.0, 0
        single = dynamics(model, parameters, 1.0 / self.rate_hz)
        blocks = {size: single.of_blocks(size) for size in {one.size for one in self.series} if size > 1}
        for one in self.series:
            own = blocks.get(one.size, single)
            start = wide_start(one.z, one.r, own, one.size)
            if start is None:
                continue
            space = StateSpace(own.transition, own.process, own.reads, own.reads, *start, pole=one.phi)
            score, terms = run(one, space)
            total, count = total + score, count + terms
        return total, count


def wide_start(z: np.ndarray, r: np.ndarray, model: Dynamics, size: int = 1) -> tuple[np.ndarray, np.ndarray] | None:
    """Mean [n] and covariance [n, n] of the state at the first sample; None where no sample says anything.

    States that have a variance start with it about zero; the others at the first sample that says something, with WIDE
    times the variance of the noise and 100 times that of the steps.
    size : of the blocks whose mean is read, with a model of blocks
    """
    told = np.flatnonzero(np.isfinite(r[:SKIP])) if r.ndim else np.zeros(1, dtype=int)
    if told.size == 0:
        told = np.flatnonzero(np.isfinite(r))[:SKIP]
    if told.size == 0:
        return None
    noise = float(np.max(r[told])) if r.ndim else float(r)
    inside = z[: 1 << 12] if r.ndim == 0 else z[np.isfinite(r[: 1 << 12]).nonzero()[0]]
    step = float(np.mean(np.diff(inside) ** 2)) if len(inside) > 1 else 0.0
    wide = (WIDE * noise + 100.0 * step) / float(size) ** (2.0 * model.order)
    states = len(model.reads)
    wanders = np.isnan(np.diagonal(model.stationary))
    spread = np.where(np.diag(wanders), np.diag(wide), model.stationary)
    start = np.zeros(states)
    start[np.flatnonzero(wanders & (model.order == 0))[:1]] = z[told[0]]
    if size > 1:
        start, spread = model.transition @ start, model.transition @ spread @ model.transition.T + model.process
    return start, spread


def gather(
    z: np.ndarray,
    r: float | np.ndarray,
    segment: np.ndarray,
    rate_hz: float,
    phi: float,
    moving: np.ndarray | None,
) -> Evidence:
    """The stretches of a recording on which models are compared."""
    z, r = np.asarray(z, dtype=float), np.asarray(r, dtype=float)
    runs = _runs(segment, moving, len(z))
    total = sum(stop - start for start, stop in runs)
    if total < SHORTEST:
        raise TooShort(f"{total} samples in stretches of {SHORTEST} or more", remedy="a longer recording is needed")
    _refuse(r, runs)
    if total <= MOST_SAMPLES:
        series = [_piece(z, r, run, phi) for run in runs]
    else:
        size = max(-(-total // BLOCKS), math.ceil(20.0 / (1.0 - phi)) if phi else 2)
        series = [_piece(z, r, run, phi) for run in _windows(runs, total)]
        series += [_means(z, r, run, size, phi) for run in runs if run[1] - run[0] >= SHORTEST * size]
    told = [one for one in series if _told(one) >= SHORTEST]
    if not told:
        raise TooShort(f"fewer than {SHORTEST} samples that say anything in every stretch")
    values = np.concatenate([one.z[np.isfinite(one.r)] for one in told])
    noises = np.concatenate([one.r[np.isfinite(one.r)] for one in told])
    if np.all(values == values[0]):
        raise DataError(f"the rate is {values[0]:g} deg/s at every sample: no gyro", remedy="look at the recording")
    density = float(np.median(noises / np.repeat([one.shrink for one in told], [_told(one) for one in told])))
    density *= (1.0 + phi) / (1.0 - phi) / rate_hz
    excess = max(float(np.var(values)) - float(np.mean(noises)), 1e-3 * density * rate_hz / math.sqrt(total))
    return Evidence(told, rate_hz, density, total / rate_hz, excess, phi)


def _told(one: Series) -> int:
    return int(np.isfinite(one.r).sum())


def _refuse(r: np.ndarray, runs: list[tuple[int, int]]) -> None:
    for start, stop in runs:
        usable = (r if r.ndim == 0 else r[start:stop]) > 0
        if not np.all(usable):
            raise DataError(
                "the variance of the noise is not above zero",
                f"sample {start + int(np.argmin(usable))}",
                "look for gyros that are stuck, or copies of each other",
            )


def _runs(segment: np.ndarray, moving: np.ndarray | None, samples: int) -> list[tuple[int, int]]:
    """First sample and last + 1 of the longest gap-free stretches in which all samples count, in order."""
    breaks = np.diff(segment) != 0
    if moving is not None:
        breaks |= np.diff(np.asarray(moving, dtype=bool))
    edges = [0, *(np.flatnonzero(breaks) + 1).tolist(), samples]
    found = [
        (start, stop)
        for start, stop in pairwise(edges)
        if stop - start >= SHORTEST and (moving is None or moving[start])
    ]
    return sorted(sorted(found, key=_shortness)[:RUNS])


def _shortness(run: tuple[int, int]) -> int:
    return run[0] - run[1]


def _windows(runs: list[tuple[int, int]], total: int) -> list[tuple[int, int]]:
    """WINDOWS windows about evenly spread over the runs, none twice."""
    found = set()
    for number in range(WINDOWS):
        middle = (2 * number + 1) * total // (2 * WINDOWS)
        for start, stop in runs:
            if middle < stop - start:
                first = min(max(start + middle - WINDOW // 2, start), max(stop - WINDOW, start))
                found.add((first, min(first + WINDOW, stop)))
                break
            middle -= stop - start
    return sorted(found)


def _piece(z: np.ndarray, r: np.ndarray, run: tuple[int, int], phi: float) -> Series:
    part = slice(*run)
    return Series(z[part], np.broadcast_to(r, z.shape)[part], phi=phi)


def _means(z: np.ndarray, r: np.ndarray, run: tuple[int, int], size: int, phi: float) -> Series:
    """Means of blocks of `size` samples; one sample that says nothing, and the block says nothing."""
    count = (run[1] - run[0]) // size
    part = slice(run[0], run[0] + count * size)
    means = z[part].reshape(count, size).mean(axis=1)
    variances = np.broadcast_to(r, z.shape)[part].reshape(count, size).mean(axis=1)
    # Variance of the mean of AR(1) noise over that of one sample.
    power, rest = phi**size, 1.0 - phi
    shrink = ((1.0 + phi) / rest - 2.0 * phi * (1.0 - power) / (size * rest**2)) / size
    return Series(means, variances * shrink, size, shrink=shrink)

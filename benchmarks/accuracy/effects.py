"""What happens to rates beside noise: slow errors, faults, rounding, a range that ends, gaps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.accuracy.scenario import Fault, Gaps, Scenario
from benchmarks.accuracy.signals import balanced, decay_of, poles_in_a_row, stream
from benchmarks.accuracy.trial import TrueFault

START_C = 20.0
GUARD_S = 2.0
AT_ENDS = {"noise", "stuck"}
SHAPING = {"noise", "burst"}


def coefficients(scenario: Scenario, seed: int) -> dict[str, np.ndarray]:
    """Constants [N] of the gyros, the same in all recordings: scale errors, deg/s/K, deg/s/g."""
    gyros, found = scenario.gyros, {"scale": np.zeros(scenario.gyros)}
    rng = stream(seed, "constants")
    signs, even, warm, heavy = (
        rng.choice([-1.0, 1.0], gyros), rng.random(gyros), rng.standard_normal(gyros), rng.standard_normal(gyros),
    )  # fmt: skip
    if scenario.scale:
        found["scale"] = signs * (scenario.scale.low + even * (scenario.scale.high - scenario.scale.low))
    if scenario.temperature:
        found["per_k"] = scenario.temperature.per_k * (1.0 + scenario.temperature.spread * warm)
    if scenario.tilt:
        found["per_g"] = scenario.tilt.per_g * (1.0 + scenario.tilt.spread * heavy)
    return found


def celsius(scenario: Scenario, samples: int) -> np.ndarray | None:
    """Temperature of the board [T], °C; None: it stays as it is."""
    if scenario.temperature is None:
        return None
    return START_C + scenario.temperature.ramp_k * np.arange(samples) / max(samples - 1, 1)


def slow_offset(scenario: Scenario, seed: int, part: str, samples: int) -> np.ndarray:
    """Slow errors that are no random walk [T, N], deg/s: of temperature, gravity (in motion only) and warming up."""
    offset, constants = np.zeros((samples, scenario.gyros)), coefficients(scenario, seed)
    degrees = celsius(scenario, samples)
    if degrees is not None:
        offset += np.outer(degrees - START_C, constants["per_k"])
    if scenario.tilt and part == "motion":
        decay = decay_of(scenario.tilt.pole_hz, scenario.rate_hz)
        angle = poles_in_a_row(stream(seed, "tilt"), samples, decay, 2) * np.deg2rad(scenario.tilt.degrees)
        offset += np.outer(np.sin(angle), constants["per_g"])
    if scenario.warm_up:
        size = scenario.warm_up.sd * balanced(seed, f"warm-up {part}", scenario.gyros)
        offset += np.outer(np.exp(-np.arange(samples) / (scenario.warm_up.time_s * scenario.rate_hz)), size)
    return offset


def stretches(fault: Fault, scenario: Scenario, seed: int, samples: int) -> list[tuple[int, int]]:
    """Samples [start, stop) of a fault; of bursts, several, GUARD_S from the ends and from one another."""
    rate_hz = scenario.rate_hz
    start = 0 if fault.start_s is None else round(fault.start_s * rate_hz)
    stop = samples if fault.stop_s is None else min(round(fault.stop_s * rate_hz), samples)
    if fault.sort == "absurd":
        return [(start, start + 1)]
    if fault.sort != "burst":
        return [(start, stop)]
    length = round(fault.seconds * rate_hz)
    free = stop - start - fault.count * (length + round(GUARD_S * rate_hz))
    breaks = np.sort(stream(seed, f"bursts {fault.gyro}").random(fault.count)) * max(free, 0)
    begins = start + breaks + np.arange(fault.count) * (length + round(GUARD_S * rate_hz))
    return [(int(begin), int(begin) + length) for begin in begins]


def noise_factor(
    faults: Sequence[Fault], scenario: Scenario, seed: int, samples: int
) -> tuple[np.ndarray, list[TrueFault]]:
    """Factor on the noise [T, N] of the faults that are noise, and these faults."""
    factor, found = np.ones((samples, scenario.gyros)), []
    for fault in faults:
        if fault.sort not in SHAPING:
            continue
        for start, stop in stretches(fault, scenario, seed, samples):
            size = np.linspace(1.0, fault.factor, stop - start) if fault.sort == "noise" else fault.factor
            factor[start:stop, fault.gyro] *= size
            found.append(TrueFault((fault.gyro,), fault.sort, start, stop))
    return factor, found


def break_gyros(
    rate: np.ndarray, usable: np.ndarray, faults: Sequence[Fault], scenario: Scenario, seed: int
) -> list[TrueFault]:
    """Put the faults that replace values into rate [T, N] and usable [T, N], in their place."""
    found = []
    rng = stream(seed, "broken")
    for fault in faults:
        if fault.sort in SHAPING:
            continue
        [(start, stop)] = stretches(fault, scenario, seed, len(rate))
        column = rate[:, fault.gyro]
        if fault.sort == "stuck":
            column[start:stop] = column[max(start - 1, 0)]
        elif fault.sort == "adc_noise":
            column[start:stop] = fault.size * rng.standard_normal(stop - start)
        elif fault.sort == "copy":
            column[start:stop] = rate[start:stop, fault.of]
        else:
            column[start:stop] = 0.0 if fault.sort == "zero" else fault.size
        usable[start:stop, fault.gyro] = False
        named = (fault.gyro, fault.of) if fault.sort == "copy" else (fault.gyro,)
        found.append(TrueFault(named, fault.sort, start, stop))
    return found


def clipped(rate: np.ndarray, full_scale: Sequence[float]) -> np.ndarray:
    """Clip rate [T, N] in its place; true where that changed it [T, N]."""
    if not full_scale:
        return np.zeros(rate.shape, dtype=bool)
    limit = np.asarray(full_scale)
    over = np.abs(rate) >= limit
    np.clip(rate, -limit, limit, out=rate)
    return over


def rounded(rate: np.ndarray, quantum: float, seed: int, from_zero: bool = False) -> np.ndarray:
    """rate [T, N] in steps of `quantum`. Unless from_zero, zero is no count: each gyro's counts lie elsewhere.

    A gyro at rest whose noise is far below a step then says one value that is wrong by as much as half a step.
    """
    shift = quantum * (stream(seed, "counts").random(rate.shape[1]) - 0.5) * (not from_zero)
    return np.asfortranarray(np.rint((rate - shift) / quantum) * quantum + shift)


def kept_samples(gaps: Gaps, seed: int, samples: int, rate_hz: float) -> np.ndarray:
    """bool [T]: false in the gaps."""
    rng, kept = stream(seed, "gaps"), np.ones(samples, dtype=bool)
    low, high = np.log(gaps.shortest_s), np.log(gaps.longest_s)
    lengths = np.maximum(np.rint(np.exp(rng.uniform(low, high, gaps.count)) * rate_hz).astype(int), 1)
    for start, length in zip(rng.integers(1, samples - 1, gaps.count), lengths, strict=True):
        kept[start : min(start + length, samples - 1)] = False
    return kept

"""The unit of plain-number time stamps."""

from __future__ import annotations

import math
import re

import numpy as np

from vgyro.errors import DataError

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
WORDS = {
    "s": ("s", "sec", "secs", "second", "seconds", "sekunden"),
    "ms": ("ms", "msec", "msecs", "milli", "millis", "millisecond", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "usecs", "micro", "micros", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nsecs", "nano", "nanos", "nanosecond", "nanoseconds"),
    "min": ("min", "mins", "minute", "minutes"),
}
LOWEST_HZ, HIGHEST_HZ = 5.0, 20_000.0  # rates of gyro logs, where nothing else tells the unit
NAMED_LOWEST_HZ, NAMED_HIGHEST_HZ = 0.01, 200_000.0  # rates that do not contradict a column's name
EPOCH_S = (9e8, 3e9)  # 1998 to 2065
NEAR_RATE = 1.25  # a unit agrees with the declared rate within this factor
FAR_FROM_RATE = 3.0  # … and contradicts it beyond this one


def guess_unit(stamps_head: np.ndarray, name: str = "", rate_hz: float | None = None) -> tuple[str, str]:
    """The unit of a column of time stamps, and why.

    In this order: the column's name, unless it contradicts the declared rate by more than a factor of 3 while another
    unit agrees within 25 %; the declared rate; dates since 1970; the first of s, ms, us, ns that makes a rate of 5 to
    20 000 Hz; s.

    stamps_head : [n] numbers from the beginning of the recording
    returns     : (unit, why); unit is one of s, ms, us, ns, min
    """
    step = _step(stamps_head)
    named = _named(name)
    by_rate = _by_rate(step, rate_hz)
    if named is not None:
        hz = _rate(step, named)
        clash = rate_hz is not None and hz is not None and not 1 / FAR_FROM_RATE <= hz / rate_hz <= FAR_FROM_RATE
        if clash and by_rate is not None:
            return by_rate, f"{rate_hz:g} Hz was declared; with {named}, as {name!r} says, it would be {hz:.4g} Hz"
        if hz is None or NAMED_LOWEST_HZ <= hz <= NAMED_HIGHEST_HZ:
            return named, f"the name {name!r} says so"
    if by_rate is not None:
        return by_rate, f"it makes {_rate(step, by_rate):.4g} Hz, and {rate_hz:g} Hz was declared"
    for unit in ("s", "ms", "us", "ns"):
        hz = _rate(step, unit)
        if _is_epoch(stamps_head, unit) and (hz is None or NAMED_LOWEST_HZ <= hz <= NAMED_HIGHEST_HZ):
            return unit, f"the stamps are {unit} since 1970"
    for unit in ("s", "ms", "us", "ns"):
        hz = _rate(step, unit)
        if hz is not None and LOWEST_HZ <= hz <= HIGHEST_HZ:
            return unit, f"the usual step of {step:.6g} makes {hz:.4g} Hz"
    return "s", "nothing else was known"


def resolve_unit(unit: str, stamps_head: np.ndarray, name: str, rate_hz: float | None) -> tuple[str, str]:
    """The unit that was set, or the one that is guessed.  raises : DataError for a unit that does not exist"""
    if unit == "auto":
        return guess_unit(stamps_head, name, rate_hz)
    if unit not in SECONDS:
        raise DataError(f"no unit of time is called {unit!r}", name or None, f"use one of {', '.join(SECONDS)} or auto")
    return unit, "it was set"


def _step(stamps: np.ndarray) -> float | None:
    """The usual step from row to row, in ticks; a mean, as stamps may come in bursts."""
    values = stamps.astype(np.float64)
    values = values[np.isfinite(values) & (np.abs(values) < 1e19)]
    lag = max(1, len(values) // 8)
    if len(values) < 2:
        return None
    step = float(np.median(values[lag:] - values[:-lag])) / lag
    return step if step > 0 else None


def _rate(step: float | None, unit: str) -> float | None:
    if step is None:
        return None
    period = step * SECONDS[unit]
    return 1 / period if period > 1e-300 else math.inf


def _named(name: str) -> str | None:
    """The unit that a column's name holds: t_us, millis, Time (ms), timestampNs."""
    parts = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = [word.lower() for word in re.split(r"[^A-Za-zµμ]+", parts) if word]
    for unit, known in WORDS.items():
        if any(word in known for word in words[-1:]):
            return unit
    for unit, known in WORDS.items():
        if any(word in known for word in words):
            return unit
    return None


def _by_rate(step: float | None, rate_hz: float | None) -> str | None:
    if step is None or not rate_hz:
        return None
    for unit in SECONDS:
        hz = _rate(step, unit)
        if hz is not None and 1 / NEAR_RATE <= hz / rate_hz <= NEAR_RATE:
            return unit
    return None


def _is_epoch(stamps: np.ndarray, unit: str) -> bool:
    values = stamps.astype(np.float64)
    values = values[np.isfinite(values)]
    return len(values) > 0 and EPOCH_S[0] < float(np.median(values)) * SECONDS[unit] < EPOCH_S[1]

"""Simulate one array of a scenario: its rest recording and its motion, with the truth. NumPy alone.

Independent of vgyro.simulate on purpose. The same seed gives the same motion and the same noise in all scenarios of one
size, so that scenarios and methods are compared on common random numbers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.accuracy import effects
from benchmarks.accuracy.scenario import Fault, Scenario, load
from benchmarks.accuracy.signals import (
    LEAD_S,
    balanced,
    changing,
    correlation_of,
    decay_of,
    delay,
    mixed,
    on_circle,
    pole,
    poles_in_a_row,
    sizes,
    stream,
    walks,
)
from benchmarks.accuracy.trial import Known, Recording, Trial, TrueFault

TAPER_S = 1.0
LINE_PHASE = 0.7


def simulate(scenario: Scenario | str, seed: int) -> Trial:
    """One array, by scenario or its name."""
    known = load(scenario) if isinstance(scenario, str) else scenario
    rest = _recording(known, seed, "rest") if known.rest_s > 0 else None
    return Trial(known, seed, _recording(known, seed, "motion"), rest)


def _recording(scenario: Scenario, seed: int, part: str) -> Recording:
    """The rest recording or the motion."""
    samples = round((scenario.rest_s if part == "rest" else scenario.motion_s) * scenario.rate_hz)
    faults = tuple(one for one in scenario.faults if part == "motion" or one.rest)
    moments = _moments(scenario, seed, part, samples)
    truth, through, moving, line = _motion(scenario, seed, part, moments)
    noise, known = _noise(scenario, seed, part, samples)
    factor, events = effects.noise_factor(faults, scenario, seed, samples)
    walk = _walk_steps(scenario, samples)
    start = scenario.bias_sd * balanced(seed, f"bias {part}", scenario.gyros)
    bias = start + walks(stream(seed, f"walk {part}"), samples, walk)
    offset = effects.slow_offset(scenario, seed, part, samples)
    scale = effects.coefficients(scenario, seed)["scale"]
    values = np.asfortranarray((1.0 + scale) * through + bias + offset + noise * factor)
    usable = ~effects.clipped(values, scenario.full_scale)
    rate = values.copy(order="F")
    if scenario.quantum > 0:
        rate = effects.rounded(rate, scenario.quantum, seed, scenario.from_zero)
    events += effects.break_gyros(rate, usable, faults, scenario, seed)
    known = replace(
        known, deviation=known.deviation * factor, walk=walk, usable=usable, scale=scale, offset=offset, moving=moving,
        line=line, values=values,
    )  # fmt: skip
    whole = _as_logged(scenario, part, moments, rate, truth, events, known)
    return _with_gaps(whole, scenario, seed) if scenario.gaps and part == "motion" else whole


def _moments(scenario: Scenario, seed: int, part: str, samples: int) -> np.ndarray:
    """True times of the samples [T], in periods."""
    moments = np.arange(samples, dtype=float)
    if scenario.jitter and part == "motion":
        moments[1:-1] += scenario.jitter * stream(seed, "jitter").uniform(-1.0, 1.0, samples - 2)
    return moments


def _motion(
    scenario: Scenario, seed: int, part: str, moments: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """True rate [T], what reaches each gyro [T, N], the motion's factor [T] and the line [T], deg/s.

    moments [T] : of the samples, in periods
    """
    how, many, rate_hz = scenario.motion, scenario.oversample, scenario.rate_hz
    lead = round(LEAD_S * rate_hz) * many
    fine_hz, made = rate_hz * many, len(moments) * many + lead
    moment = (np.arange(made) - lead) / fine_hz
    kept = moments * many + lead
    rest = part == "rest"
    factor = np.zeros(made) if rest else _taper(moment, how.start_s, how.stop_s)
    wander = poles_in_a_row(stream(seed, f"motion {rate_hz:g}"), made, decay_of(how.pole_hz, fine_hz), how.poles)
    amplitude = how.line_rest if rest else how.line
    line = amplitude * np.sin(2.0 * np.pi * how.line_hz * moment + LINE_PHASE)
    rate = how.sd * factor * wander + line
    truth = _at(rate, kept)
    through = np.repeat(truth[:, None], scenario.gyros, axis=1)
    filters = scenario.bandwidth
    if filters is not None:
        late = filters.late or (0.0,) * scenario.gyros
        for gyro, (pole_hz, samples_late) in enumerate(zip(filters.poles_hz, late, strict=True)):
            passed = rate
            if filters.motion:
                passed = on_circle(passed, pole(decay_of(pole_hz, fine_hz)))
            if samples_late:
                passed = on_circle(passed, delay(samples_late * many))
            through[:, gyro] = _at(passed, kept)
    return truth, through, _at(factor, kept), _at(line, kept)


def _taper(moment: np.ndarray, start_s: float | None, stop_s: float | None) -> np.ndarray:
    """1 while the board moves, 0 while it rests, half a cosine between. moment [T], s"""
    if start_s is None or stop_s is None:
        return np.ones(len(moment))
    inside = np.clip(np.minimum(moment - start_s, stop_s - moment) / TAPER_S, 0.0, 1.0)
    return 0.5 - 0.5 * np.cos(np.pi * inside)


def _at(fine: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Values of a fine series at places in it, on straight lines between its samples."""
    whole = places.astype(int)
    if np.array_equal(whole, places):
        return fine[whole]
    return np.interp(places, np.arange(len(fine)), fine)


def _noise(scenario: Scenario, seed: int, part: str, samples: int) -> tuple[np.ndarray, Known]:
    """White noise [T, N], deg/s, low-passed where the gyros are, and what is known of it."""
    gyros, rate_hz, many = scenario.gyros, scenario.rate_hz, scenario.oversample if scenario.bandwidth else 1
    rng = stream(seed, f"noise {part} {gyros}")
    poles = np.zeros(gyros)
    if scenario.bandwidth is None:
        unit = rng.standard_normal((samples, gyros))
    else:
        poles = np.array([decay_of(pole_hz, rate_hz * many) for pole_hz in scenario.bandwidth.poles_hz])
        lead = round(LEAD_S * rate_hz) * many
        unit = np.empty((samples, gyros))
        for gyro, decay in enumerate(poles):
            made = on_circle(rng.standard_normal(samples * many + lead), pole(decay))
            unit[:, gyro] = np.sqrt(many) * made[lead::many]
    correlation, block = correlation_of(scenario.groups, gyros), None
    deviation = np.tile(np.asarray(scenario.arw) * np.sqrt(rate_hz), (samples, 1))
    if scenario.tails:
        tails = scenario.tails
        deviation *= sizes(stream(seed, f"tails {part}"), deviation.shape, tails.dof, tails.share, tails.factor)
    if scenario.volatility:
        length = max(round(scenario.volatility.block_s * rate_hz), 1)
        block = np.arange(samples) // length
        shape, correlation = changing(
            stream(seed, f"volatility {part}"), int(block[-1]) + 1, gyros, scenario.volatility
        )
        deviation *= shape[block]
        roots = np.linalg.cholesky(correlation)
        unit = np.einsum("tij,tj->ti", roots[block], unit)
    else:
        unit = mixed(unit, correlation)
    late = np.asarray(scenario.bandwidth.late if scenario.bandwidth else ()) * 1.0
    nothing = np.empty(0)
    known = Known(
        deviation, correlation, block, nothing, scenario.bias_sd, nothing, nothing, nothing, nothing, nothing, nothing,
        poles, late if late.size else np.zeros(gyros),
    )  # fmt: skip
    return unit * deviation, known


def _walk_steps(scenario: Scenario, samples: int) -> np.ndarray:
    """S.d. of each step of the biases [T, N], deg/s."""
    step = np.full(samples, scenario.rrw / np.sqrt(scenario.rate_hz))
    if scenario.fading:
        time = np.arange(samples) / scenario.rate_hz
        step *= 1.0 + (scenario.fading.factor - 1.0) * np.exp(-time / scenario.fading.time_s)
    return np.repeat(step[:, None], scenario.gyros, axis=1)


def _as_logged(
    scenario: Scenario, part: str, moments: np.ndarray, rate: np.ndarray, truth: np.ndarray,
    faults: list[TrueFault], known: Known,
) -> Recording:  # fmt: skip
    """The recording without gaps.  moments [T] : of the samples, in periods"""
    samples = len(rate)
    degrees = effects.celsius(scenario, samples)
    logged = degrees if scenario.temperature and scenario.temperature.logged else None
    kind = "static" if part == "rest" else scenario.kind
    faults = sorted(faults, key=lambda one: (one.start, one.gyros))
    return Recording(
        kind, rate, scenario.rate_hz, moments / scenario.rate_hz, np.zeros(samples, dtype=np.int32),
        known.moving == 0.0, truth, logged, tuple(faults), known,
    )  # fmt: skip


def _with_gaps(whole: Recording, scenario: Scenario, seed: int) -> Recording:
    """The same without the samples in the gaps."""
    assert scenario.gaps is not None
    kept = effects.kept_samples(scenario.gaps, seed, len(whole.rate), whole.rate_hz)
    number = np.cumsum(np.diff(kept, prepend=True) & kept)
    before = np.concatenate([[0], np.cumsum(kept)])
    faults = tuple(replace(one, start=int(before[one.start]), stop=int(before[one.stop])) for one in whole.faults)
    known = whole.known
    columns = ("deviation", "usable", "offset", "moving", "line", "values")
    # Of the steps of the walks that were lost the sum counts.
    variance = np.cumsum(known.walk**2, axis=0)[kept]
    walk = np.sqrt(np.diff(variance, axis=0, prepend=0.0))
    known = replace(known, walk=walk, **{name: getattr(known, name)[kept] for name in columns})
    if known.block is not None:
        known = replace(known, block=known.block[kept])
    return replace(
        whole, rate=np.asfortranarray(whole.rate[kept]), time=whole.time[kept], segment=number[kept].astype(np.int32),
        at_rest=whole.at_rest[kept], truth=whole.truth[kept], faults=faults, known=known,
        temperature=None if whole.temperature is None else whole.temperature[kept],
    )  # fmt: skip


__all__ = ["Fault", "Known", "Recording", "Scenario", "Trial", "simulate"]

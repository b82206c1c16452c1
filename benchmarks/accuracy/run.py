"""Run methods on a simulated trial as the pipeline would: noise from rest, faults, parameters, rates, scores.

What is not as in the pipeline: nothing is written, the values are not rounded to single precision, the rest recording
is believed to be at rest, and no GARCH/DCC weights are fitted (rows that need them say that they cannot run).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.accuracy.ledger import LEDGER, TimedRates, timed
from benchmarks.accuracy.oracle import oracle
from benchmarks.accuracy.scenario import Scenario
from benchmarks.accuracy.scores import errors_of, fault_score, honesty_of
from benchmarks.accuracy.simulate import simulate
from benchmarks.accuracy.trial import Recording, Trial
from vgyro.calibration import find_rest
from vgyro.config import FaultOptions, FusionOptions, MetricsOptions, RestOptions
from vgyro.fusion import METHODS, ArrayNoise, ArrayRates, FilterParameters, Method, Outcome
from vgyro.fusion.bias.rest_temperature import temperature_at_rest
from vgyro.fusion.faults import search_faults
from vgyro.fusion.registry import run_methods, select
from vgyro.fusion.samples.missing import fill_missing
from vgyro.fusion.types import TemperatureAtRest
from vgyro.metrics import Sampling
from vgyro.tasks.fusion.array_inputs import in_motion
from vgyro.tasks.fusion.noise import noise_at_rest, noise_in_motion, record_of
from vgyro.tasks.fusion.noise_record import noise_of_record
from vgyro.tasks.rates.rates_file import ArrayFile, FileColumns

Row = dict[str, Any]
NO_WEIGHTS = "no weights of DCC or CCC are fitted here"
NOWHERE = Path("simulated")
FIGURES = ("sd", "rms", "sd_1s", "rms_1s", "nees", "coverage", "cpu_s")
NO_RATE = ("zero", "constant", "adc_noise")


@dataclass(frozen=True)
class PartArrays:
    """One recording as methods take it.  search_note : what faults were not looked for

    injected : constant rate, deg/s, added to every gyro at rest, and to the truth, as the pipeline does for its second
        table: at rest the truth is zero, and weights that see the rates themselves draw toward it
    """

    recording: Recording
    array: ArrayRates
    parameters: FilterParameters
    search_note: str
    injected: float = 0.0

    def without(self, parts: frozenset[str]) -> PartArrays:
        """The same for a run without some parts of `recommended`, in which nothing is known yet of the array."""
        if not parts:
            return self
        faults = () if "faults" in parts else self.array.faults
        array = replace(self.array, faults=faults)
        return replace(self, array=array, parameters=replace(self.parameters, without=parts))


def trial_arrays(trial: Trial) -> dict[str, PartArrays]:
    """Part ("motion", "rest") → what the pipeline would hand to the methods."""
    recordings = {"motion": trial.motion, **({"rest": trial.rest} if trial.rest is not None else {})}
    wanted = {part: one for part, one in recordings.items() if part in trial.scenario.score}
    noise = _noise(trial)
    return {part: _arrays(one, noise, trial.scenario.declared_hz) for part, one in wanted.items()}


def _arrays(recording: Recording, noise: ArrayNoise, declared_hz: float | None) -> PartArrays:
    rate = recording.rate.copy(order="F")
    missing = fill_missing(rate, recording.rate_hz)
    at_rest = np.full(len(rate), recording.kind == "static")
    if recording.kind == "free":
        at_rest = find_rest(rate, recording.rate_hz, RestOptions(), recording.segment)
    declared: dict[str, Any] = {}
    if declared_hz and "lowpass_hz" in {one.name for one in fields(ArrayRates)}:
        declared["lowpass_hz"] = np.full(rate.shape[1], declared_hz)
    array = TimedRates(
        rate, recording.rate_hz, recording.segment, at_rest, noise, temperature=recording.temperature,
        stretch_time=recording.stretch_time, missing=missing, **declared,
    )  # fmt: skip
    parameters = FilterParameters.of(FusionOptions(), in_motion(recording.kind, at_rest, moved=False))
    zero = np.zeros((rate.shape[1], 2))
    unknown = replace(array, noise=_unknown(rate.shape[1]))
    search = search_faults(unknown, FaultOptions(), zero, in_hand=recording.kind == "free")
    injected = MetricsOptions().injected_rate or 0.0 if recording.kind == "static" else 0.0
    array = replace(array, rate=array.rate + injected, faults=tuple(search.events))
    return PartArrays(recording, array, parameters, search.note, injected)


def _unknown(gyros: int) -> ArrayNoise:
    return ArrayNoise(np.full(gyros, math.nan), np.full(gyros, math.nan), np.eye(gyros))


def _noise(trial: Trial) -> ArrayNoise:
    """The noise record as vgyro.tasks.fusion.noise makes it: of the rest recording, else of differences in motion."""
    recording = trial.motion if trial.rest is None else trial.rest
    rate = recording.rate.copy(order="F")
    fill_missing(rate, recording.rate_hz)
    names = [f"g{gyro + 1}" for gyro in range(rate.shape[1])]
    columns = dict(zip(names, rate.T, strict=True))
    if trial.rest is None:
        frame = ArrayFile(rate, recording.segment, recording.at_rest, recording.rate_hz, NOWHERE, "z")
        found = noise_in_motion(list(rate.T), frame, "native")
    else:
        places = [(NOWHERE, name) for name in names]
        sampling = Sampling.of(recording.rate_hz, recording.segment)
        held = {(NOWHERE, name): column for name, column in columns.items()}
        found = noise_at_rest(FileColumns(places, held=held), sampling, MetricsOptions(), "native")
    noise = noise_of_record(record_of(found, names, "z", "rest"), names)
    if trial.rest is None or trial.rest.temperature is None:
        return noise
    return replace(noise, temperature=_slopes_at_rest(trial.rest, noise))


def _slopes_at_rest(rest: Recording, noise: ArrayNoise) -> TemperatureAtRest | None:
    array = ArrayRates(
        rest.rate, rest.rate_hz, rest.segment, rest.at_rest, noise, temperature=rest.temperature,
        stretch_time=rest.stretch_time,
    )  # fmt: skip
    return temperature_at_rest(array)


def score(
    scenario: Scenario | str, seed: int, methods: Sequence[str] = (), without: frozenset[str] = frozenset()
) -> list[Row]:
    """One row a part and method of one trial.

    methods : names of METHODS, () : all;  without : parts of `recommended` that are left out
    """
    return score_variants(scenario, seed, methods, [without])


def score_variants(
    scenario: Scenario | str, seed: int, methods: Sequence[str], variants: Sequence[frozenset[str]]
) -> list[Row]:
    """The same for several sets of parts that are left out; each row says which, in `without`."""
    trial = simulate(scenario, seed)
    LEDGER.clear()
    chosen = select(list(methods or METHODS))
    try:
        arrays = trial_arrays(trial)
    except Exception as reason:  # Noise or faults fail: so would every method.
        note = f"before any method: {type(reason).__name__}: {reason}"
        parts = {part: getattr(trial, part) for part in trial.scenario.score}
        common = [_about(trial, part) | _yardsticks(trial, one) | {"without": ""} for part, one in parts.items()]
        return [about | _row(method, "failed", note) for about in common for method in chosen]
    rows = []
    for part, known in arrays.items():
        yardsticks = _yardsticks(trial, known.recording, known.array.rate - known.injected)
        common_row = _about(trial, part) | yardsticks | _faults(trial, known)
        for without in variants:
            left = {"without": " ".join(sorted(without))}
            rows += [common_row | left | row for row in _outcomes(known.without(without), chosen)]
    return rows


def _about(trial: Trial, part: str) -> Row:
    """Which trial it is. spoilt_average : at rest a gyro without a rate brings the average nearer to the truth, zero"""
    broken = any(one.sort in NO_RATE for one in trial.scenario.faults)
    return {
        "scenario": trial.scenario.name, "seed": trial.seed, "part": part, "oracle_kind": trial.scenario.oracle,
        "spoilt_average": part == "rest" and broken,
    }  # fmt: skip


def _row(method: Method, state: str, note: str) -> Row:
    """Without figures."""
    about = {"method": method.name, "title": method.title, "family": method.family, "causal": method.causal}
    return about | dict.fromkeys(FIGURES, math.nan) | {"state": state, "note": note}


def _outcomes(known: PartArrays, methods: Sequence[Method]) -> Iterator[Row]:
    """Run the methods; a row each, of what came out or why nothing did."""
    recording = known.recording
    for method in methods:
        if "weights" in method.needs and not known.array.weights:
            yield _row(method, "left out", NO_WEIGHTS)
            continue
        outcome, seconds = timed(partial(_outcome, known, method))
        if outcome.fused is None:
            yield _row(method, outcome.state, outcome.note)
            continue
        rate, time = outcome.fused.rate - known.injected, recording.time
        figures = asdict(errors_of(rate, recording.truth, time, recording.rate_hz))
        figures |= asdict(honesty_of(rate, outcome.fused.sd, recording.truth, time))
        yield _row(method, "ran", outcome.note) | figures | {"cpu_s": seconds}


def _outcome(known: PartArrays, method: Method) -> Outcome:
    return next(run_methods(known.array, known.parameters, [method], [""]))


def _yardsticks(trial: Trial, recording: Recording, rate: np.ndarray | None = None) -> Row:
    """Errors of the plain average, of the best gyro by itself, and of the oracle.  rate [T, N] : filled in"""
    if rate is None:
        rate = recording.rate.copy(order="F")
        fill_missing(rate, recording.rate_hz)

    def errors(one: np.ndarray) -> dict[str, float]:
        return asdict(errors_of(one, recording.truth, recording.time, recording.rate_hz))

    singles = [errors(column) for column in rate.T]
    best = {name: min(one[name] for one in singles) for name in singles[0]}
    known = oracle(recording, trial.scenario)
    found = {"average": errors(rate.mean(axis=1)), "best_gyro": best, "oracle": errors(known.rate)}
    row = {f"{who}_{name}": value for who, values in found.items() for name, value in values.items()}
    return row | {"oracle_nees": honesty_of(known.rate, known.sd, recording.truth, recording.time).nees}


def _faults(trial: Trial, known: PartArrays) -> Row:
    """Faults found, missed, invented."""
    recording = known.recording
    found = fault_score(known.array.faults, recording.faults, recording.rate_hz, trial.scenario.excused)
    named = "; ".join(f"g{one.gyro + 1} {one.kind} {one.start}-{one.stop}" for one in known.array.faults[:10])
    return {f"faults_{name}": value for name, value in asdict(found).items()} | {
        "faults_right": found.right, "faults_named_as": named, "faults_note": known.search_note,
    }  # fmt: skip

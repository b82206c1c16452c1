"""From a twin to arrays of rates whose truth is known, without a dump; every method on them; ratios over seeds.

What the pipeline does to a recording is done with its own functions: noise from the rest, weights of CCC and DCC from
block means, faults from the rates. Left out are the board's counts and the errors of the calibration: scales are right,
and what is taken off each gyro is its true bias at the time of the calibration.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np

from vgyro.board import Board
from vgyro.config import FusionOptions, MetricsOptions, VolatilityOptions
from vgyro.dataset import AT_REST
from vgyro.fusion import METHODS, ArrayNoise, ArrayRates, FilterParameters, Fused, SampleWeights, block_of_sample
from vgyro.fusion.registry import run_methods, select
from vgyro.fusion.types import WeightKey
from vgyro.metrics import Sampling
from vgyro.simulate import Simulated, Twin, parse_twin, simulate_recording, truth_of
from vgyro.simulate.noise import correlation_matrix, pole_of_motion
from vgyro.simulate.twin import pole_of
from vgyro.storage.inputs import read_board
from vgyro.tasks.fusion.noise import noise_at_rest, record_of
from vgyro.tasks.fusion.noise_record import noise_of_record
from vgyro.volatility import block_means
from vgyro.volatility.fits import fit_windows, window_models
from vgyro.volatility.rolling import weights_of_windows
from vgyro.volatility.stretches import rolling_windows, stretches

ROOT = Path(__file__).resolve().parents[3]
OURS, OURS_UNSMOOTHED = "recommended", "recommended_unsmoothed"
NO_DCC = VolatilityOptions(definitions=("residual",), models=("dcc",), modes=("causal",))


def load(name: str, changes: Mapping[str, str] | None = None) -> Twin:
    """A shipped twin.  changes : text of its file → other text"""
    text = (ROOT / "config/twins" / f"{name}.yaml").read_text(encoding="utf-8")
    for old, new in (changes or {}).items():
        assert old in text, old
        text = text.replace(old, new)
    return parse_twin(text, name)


def board_of(twin: Twin) -> Board:
    """The board that a twin names."""
    return read_board(twin.board, boards=ROOT / "config/boards")


@dataclass(frozen=True)
class Case:
    """One recording of a twin: what the methods get, and the truth.

    truth    : [T], deg/s;  seen : the same behind the sensors' pole, which comes 4 ms later at 40 Hz
    bias     : [T, N], deg/s, what is left of it after the calibration
    variance : [T, N], (deg/s)², of the white noise of each sample before the pole, faults in
    correlation : [N, N] of it;  faulty : [T, N]
    """

    array: ArrayRates
    parameters: FilterParameters
    truth: np.ndarray
    seen: np.ndarray
    bias: np.ndarray
    variance: np.ndarray
    correlation: np.ndarray
    faulty: np.ndarray
    definitions: tuple[str, ...] = ()


@dataclass(frozen=True)
class Ran:
    """What came out: column → rate, and of what did not run, why."""

    fused: dict[str, Fused]
    reasons: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Columns(Sequence):
    """Rates in memory, as the noise stage takes them from a file."""

    values: np.ndarray
    cleaned: Callable[[np.ndarray], np.ndarray] | None = None

    def __len__(self) -> int:
        return self.values.shape[1]

    def __getitem__(self, index):
        values = np.array(self.values[:, index])
        return values if self.cleaned is None else self.cleaned(values)


def case(
    twin: Twin,
    recording: str,
    seed: int,
    rate: float = 0.0,
    rest: Sequence[tuple[float, float]] | None = None,
    volatility: VolatilityOptions | None = NO_DCC,
    faults: bool = True,
    **parameters: object,
) -> Case:
    """One recording of a twin.

    rate : constant rate that is added to every gyro and to the truth, deg/s: as the fuse stage adds one, a recording at
           rest stays one by name; with `rest` it is added between those stretches
    rest : stretches, s, of which it is known that the board stood still; None: as the kind of the recording says
    volatility : weights of CCC and DCC; None: none
    faults : found by the fault stage;  parameters : of the methods, over those of the twin's own analysis
    """
    simulated = simulate_recording(twin, board_of(twin), recording, seed)
    offset = calibrated_bias(twin)
    samples = len(simulated.time)
    at_rest = np.full(samples, twin.recording(recording).kind in AT_REST and rest is None)
    for start, stop in rest or ():
        at_rest[(simulated.time >= start) & (simulated.time < stop)] = True
    added = rate * ~at_rest if rest is not None else np.full(samples, rate)
    rates = np.asfortranarray(simulated.rates - offset + added[:, None])
    pole = pole_of(twin, twin.recording(recording))
    array = ArrayRates(
        rates, simulated.rate_hz, np.zeros(samples, dtype=np.int32), at_rest, noise_of(twin, seed),
        temperature=simulated.temperature, stretch_time=np.zeros(1),
        lowpass_hz=None if pole is None else np.full(rates.shape[1], pole),
    )  # fmt: skip
    options = twin.analysis.fusion.model_dump(exclude_unset=True) if twin.analysis else {}
    options = FusionOptions.model_validate({**options, "methods": "all"})
    known = replace(FilterParameters.of(options, not bool(at_rest.all())), **parameters)
    if volatility is not None:
        array = with_weights(array, simulated.time, volatility)
    if faults:
        array = with_faults(array)
    return Case(
        array,
        known,
        simulated.reference + added,
        seen_rate(twin, simulated) + added,
        simulated.bias - offset,
        simulated.white_sd**2,
        correlation_matrix(twin.correlation, rates.shape[1]),
        simulated.faulty,
        volatility.definitions if volatility is not None else (),
    )


def calibrated_bias(twin: Twin) -> np.ndarray:
    """Bias of each gyro during the calibration, deg/s."""
    (recording,) = [one for one in twin.recordings if one.kind == "calibration"][:1]
    return np.array([truth_of(twin, recording, gyro.name).bias_deg_s for gyro in board_of(twin).gyros])


def seen_rate(twin: Twin, simulated: Simulated) -> np.ndarray:
    """True rate behind the sensors' pole [T], deg/s."""
    pole = pole_of(twin, twin.recording(simulated.recording))
    if pole is None:
        return simulated.reference
    return pole_of_motion(pole, simulated.rate_hz).next(simulated.reference[:, None])[:, 0]


def noise_of(twin: Twin, seed: int) -> ArrayNoise:
    """Noise of the gyros, from the recording at rest, as the noise stage writes it."""
    return _noise(twin.model_dump_json(exclude_unset=True), seed)


@cache
def _noise(text: str, seed: int) -> ArrayNoise:
    twin = Twin.model_validate_json(text)
    still = next(one.name for one in twin.recordings if one.kind in AT_REST)
    simulated = simulate_recording(twin, board_of(twin), still, seed)
    gyros = list(simulated.gyros)
    sampling = Sampling.of(simulated.rate_hz, np.zeros(len(simulated.time), dtype=np.int32))
    options = MetricsOptions(bootstrap=50)
    found = noise_at_rest(Columns(simulated.rates - calibrated_bias(twin)), sampling, options, "native")
    return noise_of_record(record_of(found, gyros, "z", still), gyros)


def with_weights(array: ArrayRates, time: np.ndarray, options: VolatilityOptions) -> ArrayRates:
    """The array with the weights of every model, mode and definition of r_t, as the volatility stage makes them."""
    partly = array.at_rest.any() and not array.at_rest.all()
    series = block_means(array.rate, array.rate_hz, options.rate_hz, array.segment, array.at_rest if partly else None)
    plan = rolling_windows(stretches(series.stretch), options.window, options.step)
    weights: dict[WeightKey, SampleWeights] = {}
    deviations: dict[WeightKey, SampleWeights] = {}
    block = block_of_sample(time, series.time, 1.0 / series.rate_hz, array.rate_hz)
    names = [f"g{number + 1}" for number in range(array.rate.shape[1])]
    for definition in options.definitions if len(plan) else ():
        fits = fit_windows(
            series.values, plan.start, plan.length, definition, options.residual_span, plan.stretch_start
        )
        models = window_models(fits, plan.start, plan.length, names)
        for model in options.models:
            found = weights_of_windows(
                series.values, models, plan.runs, definition, options.modes, model, plan.step, options.residual_span
            )
            for mode, one in found.items():
                weights[model, mode, definition] = SampleWeights.of(one.weights, block)
                deviations[model, mode, definition] = SampleWeights.of(one.deviation, block)
    return replace(array, weights=weights, deviations=deviations)


def with_faults(array: ArrayRates) -> ArrayRates:
    """The array with the faults that the fault stage finds in it."""
    from vgyro.fusion.faults import find_faults

    return replace(array, faults=tuple(find_faults(array)))


def run(one: Case, names: Sequence[str] | None = None) -> Ran:
    """Every row of the registry, or those named."""
    fused: dict[str, Fused] = {}
    reasons: dict[str, str] = {}
    methods = select("all" if names is None else [name for name in names if name in METHODS])
    for outcome in run_methods(one.array, one.parameters, methods, one.definitions):
        if outcome.fused is None:
            reasons[outcome.method.name] = outcome.note
        else:
            fused[outcome.column] = outcome.fused
    return Ran(fused, reasons)


def error_sd(one: Case, rate: np.ndarray, settle_s: float = 2.0) -> float:
    """S.d. of the error, deg/s, without the first and last seconds."""
    cut = round(settle_s * one.array.rate_hz)
    return float(np.std((rate - one.truth)[cut:-cut]))


@dataclass(frozen=True)
class Interval:
    """A mean and its 95 % interval."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.mean:.3f} ({self.low:.3f}-{self.high:.3f})"


def mean_of(values: Sequence[float]) -> Interval:
    """Mean of one value a seed, t interval."""
    from scipy.stats import t

    seeds = len(values)
    mean = float(np.mean(values))
    half = float(t.ppf(0.975, seeds - 1) * np.std(values, ddof=1) / math.sqrt(seeds))
    return Interval(mean, mean - half, mean + half)


def ratio_of(ours: Sequence[float], other: Sequence[float]) -> Interval:
    """Geometric mean of ours over other, seed by seed, with the t interval of the log ratios."""
    found = mean_of(np.log(np.abs(ours)) - np.log(np.abs(other)))
    return Interval(*(math.exp(value) for value in (found.mean, found.low, found.high)))

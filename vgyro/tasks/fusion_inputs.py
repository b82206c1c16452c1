"""What the tasks that fuse share: the rates of one array with its noise and weights, and the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgyro.board import Board
from vgyro.config import FusionOptions, VolatilityOptions
from vgyro.dataset import AT_REST
from vgyro.fusion import ArrayNoise, ArrayRates, FilterParameters, SampleWeights, block_of_sample
from vgyro.fusion.array import WeightKey
from vgyro.storage.tables import read_columns, read_json
from vgyro.tasks.common import Task
from vgyro.tasks.rates_file import ArrayFile, read_array


@dataclass(frozen=True)
class OpenArray:
    """One recording of one array, and how it is to be fused. time [T], s, belongs to the samples of `rates`."""

    gyros: list[str]
    time: np.ndarray
    rates: ArrayRates
    parameters: FilterParameters
    fusion: FusionOptions
    volatility: VolatilityOptions


def open_array(task: Task) -> OpenArray:
    """Read rates, noise and, where they are an input, the weights of one array."""
    analysis = task.options["analysis"]
    fusion = FusionOptions.model_validate(analysis.get("fusion", {}))
    volatility = VolatilityOptions.model_validate(analysis.get("volatility", {}))
    gyros = [gyro.name for gyro in Board.model_validate(task.options["board"]).array(task.options["axis"])]
    file = read_array(task.input("rates"), gyros, task.options["axis"])
    block_hz = file.rate_hz if volatility.rate_hz == "full" else volatility.rate_hz
    weights, reasons = read_weights(task.inputs.get("weights", []), gyros, file, block_hz)
    noise = read_noise(task.input("noise"), gyros)
    rates = ArrayRates(file.rate, file.rate_hz, file.segment, file.at_rest, noise, weights, reasons)
    parameters = FilterParameters.of(fusion, in_motion(task.options["kind"], file.at_rest), block_hz)
    return OpenArray(gyros, file.time, rates, parameters, fusion, volatility)


def in_motion(kind: str, at_rest: np.ndarray) -> bool:
    """Does the board move in this recording, at least in part?"""
    return kind not in AT_REST and not (kind == "free" and bool(at_rest.all()))


def read_noise(path: Path, gyros: list[str]) -> ArrayNoise:
    """Noise of an array from noise/<axis>.json; a coefficient that was not found is NaN."""
    record = read_json(path)
    places = [record["gyros"].index(gyro) for gyro in gyros]
    arw, rrw = (np.array([record[name][gyro] for gyro in gyros], dtype=float) for name in ("arw", "rrw"))
    correlation = np.array(record["correlation"], dtype=float)[np.ix_(places, places)]
    limits = [gyro for gyro in gyros if str(record["rrw_source"][gyro]).startswith("upper limit")]
    note = f"no random walk was found for {', '.join(limits)}: its upper limit stands in" if limits else ""
    return ArrayNoise(arw, rrw, correlation, note)


def read_weights(
    paths: list[Path], gyros: list[str], file: ArrayFile, block_hz: float
) -> tuple[SampleWeights, dict[WeightKey, str]]:
    """Weights of every model, mode and definition, ready for the samples of the rates; and why there are none.

    paths : weights.parquet, each in the folder that its definition names
    file  : the samples;  block_hz : rate of the volatility series
    """
    blocks: dict[WeightKey, tuple[np.ndarray, np.ndarray]] = {}
    reasons: dict[WeightKey, str] = {}
    # As long as vgyro.volatility makes its blocks: a whole number of samples.
    block_s = max(1, round(file.rate_hz / block_hz)) / file.rate_hz
    for path in paths:
        rows = read_columns(path)
        for model, mode in sorted(set(zip(rows["model"], rows["mode"], strict=True))):
            chosen = (rows["model"] == model) & (rows["mode"] == mode)
            key = (str(model), str(mode), path.parent.name)
            if not np.isfinite(rows["sigma"][chosen]).any():
                reasons[key] = str(rows["status"][chosen][0])
                continue
            weights = np.column_stack([rows[f"w_{gyro}"][chosen] for gyro in gyros])
            blocks[key] = (weights, block_of_sample(file.time, rows["time"][chosen], block_s, file.rate_hz))
    return SampleWeights(blocks), reasons

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
from vgyro.tasks.volatility_series import sample_rate


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
    table = read_columns(task.input("rates"), ["time", "segment", "at_rest", *gyros])
    rate_hz = sample_rate(task.input("rates"), table["time"])
    at_rest = table["at_rest"].astype(bool)
    block_hz = rate_hz if volatility.rate_hz == "full" else volatility.rate_hz
    weights, reasons = read_weights(task.inputs.get("weights", []), gyros, table, block_hz, rate_hz)
    values = np.column_stack([table[gyro] for gyro in gyros]).astype(float)
    noise = read_noise(task.input("noise"), gyros)
    rates = ArrayRates(values, rate_hz, table["segment"], at_rest, noise, weights, reasons)
    parameters = FilterParameters.of(fusion, in_motion(task.options["kind"], at_rest), block_hz)
    return OpenArray(gyros, table["time"], rates, parameters, fusion, volatility)


def in_motion(kind: str, at_rest: np.ndarray) -> bool:
    """Does the board move in this recording, at least in part?"""
    return kind not in AT_REST and not (kind == "free" and bool(at_rest.all()))


def read_noise(path: Path, gyros: list[str]) -> ArrayNoise:
    """Noise of an array from noise/<axis>.json; a coefficient that was not found is NaN."""
    record = read_json(path)
    places = [record["gyros"].index(gyro) for gyro in gyros]
    arw, rrw = (_numbers(record[name])[places] for name in ("arw", "rrw"))
    return ArrayNoise(arw, rrw, _numbers(record["correlation"])[np.ix_(places, places)])


def _numbers(values: list) -> np.ndarray:
    return np.array(values, dtype=float)


def read_weights(
    paths: list[Path], gyros: list[str], table: dict[str, np.ndarray], block_hz: float, rate_hz: float
) -> tuple[SampleWeights, dict[WeightKey, str]]:
    """Weights of every model, mode and definition, ready for the samples of the rates; and why there are none.

    paths : weights.parquet, each in the folder that its definition names
    table : time and segment of the samples
    """
    blocks: dict[WeightKey, tuple[np.ndarray, np.ndarray]] = {}
    reasons: dict[WeightKey, str] = {}
    # As long as vgyro.volatility makes its blocks: a whole number of samples.
    block_s = max(1, round(rate_hz / block_hz)) / rate_hz
    for path in paths:
        rows = read_columns(path)
        for model, mode in sorted(set(zip(rows["model"], rows["mode"], strict=True))):
            chosen = (rows["model"] == model) & (rows["mode"] == mode)
            key = (str(model), str(mode), path.parent.name)
            if not np.isfinite(rows["sigma"][chosen]).any():
                reasons[key] = str(rows["status"][chosen][0])
                continue
            weights = np.column_stack([rows[f"w_{gyro}"][chosen] for gyro in gyros])
            time, segment = rows["time"][chosen], rows["segment"][chosen]
            block = block_of_sample(table["time"], table["segment"], time, segment, block_s, rate_hz)
            blocks[key] = (weights, block)
    return SampleWeights(blocks), reasons

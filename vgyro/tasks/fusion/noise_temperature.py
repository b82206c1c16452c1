"""Temperature coefficients of an array's gyros from its record at rest: part of the noise record."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from vgyro.board import Board
from vgyro.fusion.bias.rest_temperature import temperature_at_rest
from vgyro.fusion.samples.missing import fill_missing
from vgyro.fusion.types import ArrayNoise, ArrayRates, TemperatureAtRest
from vgyro.runs import run_starts
from vgyro.tasks.fusion.noise_record import scales_record
from vgyro.tasks.rates.block_means import between, block_means
from vgyro.tasks.rates.rates_file import thermometers

BLOCK_S = 1.0


def slopes_of_file(path: Path, board: Board, gyros: list[str], rate_hz: float, noise: ArrayNoise) -> dict[str, Any]:
    """The part `temperature` of the noise record, from rates.parquet; empty where nothing follows the temperature.

    noise : of these gyros
    """
    sensors = [name for name in thermometers(board, gyros) if name in pq.read_schema(path).names]
    if not sensors:
        return {}
    means = block_means(path, [*gyros, *sensors, "at_rest"], max(BLOCK_S, 1.0 / rate_hz))
    if len(means.time) < 2:
        return {}
    degrees = np.mean([between(means.time, means.values[name]) for name in sensors], axis=0)
    rate = np.column_stack([means.values[name] for name in gyros])
    missing = fill_missing(rate, 1.0 / means.seconds)
    array = ArrayRates(
        rate, 1.0 / means.seconds, means.segment, means.values["at_rest"] == 1.0, noise, temperature=degrees,
        stretch_time=means.time[run_starts(means.segment)], missing=missing,
    )  # fmt: skip
    found = temperature_at_rest(array) if np.isfinite(degrees).all() else None
    return {} if found is None else {"temperature": _record(found)}


def _record(found: TemperatureAtRest) -> dict[str, Any]:
    """slope [N] deg/s/K, covariance [N, N], nulled_c and nulled_sd_k, and Allan covariances as the record's own."""
    known = found.scales
    return {
        "slope": found.slope.tolist(),
        "covariance": found.covariance.tolist(),
        "nulled_c": found.nulled,
        "nulled_sd_k": found.nulled_sd,
        **({} if known is None else scales_record(known.tau, known.covariance, known.pairs)),
    }

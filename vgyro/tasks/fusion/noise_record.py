"""The noise record of an array, noise/<axis>.json, as the fusion methods take it; vgyro.tasks.fusion.noise wrote it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from vgyro.fusion.types import AllanScales, ArrayNoise, TemperatureAtRest
from vgyro.storage.tables import read_json

Source = Literal["fitted", "read at 1 s", "upper limit", "none", "not known"]
"""What a coefficient is: fitted; σ(1 s), where the fitted curve does not hold; the upper limit of one not found."""
UPPER_LIMIT: Source = "upper limit"


def read_noise(path: Path, gyros: list[str], recording: str = "") -> ArrayNoise:
    """Noise of an array from noise/<axis>.json; a coefficient that was not found is NaN.  recording : the fused one"""
    return noise_of_record(read_json(path), gyros, recording)


def noise_of_record(record: Mapping[str, Any], gyros: list[str], recording: str = "") -> ArrayNoise:
    """Noise of an array from what the stage `noise` wrote (vgyro.tasks.fusion.noise.record_of)."""
    places = [record["gyros"].index(gyro) for gyro in gyros]
    arw, rrw = (np.array([record[name][gyro] for gyro in gyros], dtype=float) for name in ("arw", "rrw"))
    correlation = np.array(record["correlation"], dtype=float)[np.ix_(places, places)]
    limits = [gyro for gyro in gyros if record["rrw_source"][gyro] == UPPER_LIMIT]
    note = f"no random walk was found for {', '.join(limits)}: its upper limit stands in" if limits else ""
    own = bool(recording) and record.get("recording") == recording
    scales = scales_of_record(record, own)
    return ArrayNoise(
        arw,
        rrw,
        correlation,
        note,
        None if scales is None else scales.of(places),
        None if own else slopes_of_record(record, places),
    )


def slopes_of_record(record: Mapping[str, Any], places: list[int]) -> TemperatureAtRest | None:
    """What `slopes_of_file` put into a noise record, of the gyros at these places in it."""
    known = record.get("temperature")
    if known is None:
        return None
    scales = scales_of_record(known)
    slope, covariance = np.array(known["slope"], dtype=float), np.array(known["covariance"], dtype=float)
    return TemperatureAtRest(slope, covariance, known["nulled_c"], known["nulled_sd_k"], scales).of(places)


def scales_record(tau: np.ndarray, covariance: np.ndarray, pairs: np.ndarray) -> dict[str, Any]:
    """allan_tau [J] s, allan_covariance [J, N, N] (deg/s)², null for a gyro with too few values, allan_pairs [J]."""
    known = [
        [[value if math.isfinite(value) else None for value in row] for row in matrix] for matrix in covariance.tolist()
    ]
    return {"allan_tau": tau.tolist(), "allan_covariance": known, "allan_pairs": pairs.tolist()}


def scales_of_record(record: Mapping[str, Any], own: bool = False) -> AllanScales | None:
    """Allan covariances of all gyros of a record; None: it has none."""
    if "allan_tau" not in record:
        return None
    tau, covariance, pairs = (np.array(record[f"allan_{name}"], dtype=float) for name in ("tau", "covariance", "pairs"))
    return AllanScales(tau, covariance, pairs, own)

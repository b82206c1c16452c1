"""Effects: what the ARCH effect of each gyro's level is, one row and one sentence a gyro."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.storage.tables import read_columns, read_metadata, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.volatility.layout import WHOLE, garch_rows
from vgyro.tasks.volatility.stored import open_series
from vgyro.volatility.effects.kinds import GarchEffect, RateTone, Sampled
from vgyro.volatility.effects.verdicts import Effect, explain_array

SECTIONS = ("board", "engine", "volatility", "metrics")


def main(task: Task) -> None:
    """inputs : series, tones; garch, of the definition `level` (none: it is not analysed);  outputs : effects

    options : as open_series, with definition `level`; analysis.metrics
    The longest stretch of the series, at most its first million samples, is tested, as in arch_lm.parquet.
    """
    array = open_series(task)
    metrics = task.section("metrics", MetricsOptions)
    values, time = array.table(*array.whole)
    rate_hz = float(read_metadata(task.input("tones"))["rate_hz"])
    sampled = Sampled(time, array.rate_hz, max(1, round(rate_hz / array.rate_hz)), 1.5 / metrics.welch_s)
    found = explain_array(
        values, array.gyros, sampled, array.options.detrend_span, array.options.arch_lags,
        read_tones(task), read_garch(task, len(array.gyros)),
    )  # fmt: skip
    for effect in found:
        logging.info("%s: %s", effect.gyro, effect.sentence)
    write_table(task.output("effects"), effect_columns(found), "effects", task.provenance())


def read_tones(task: Task) -> dict[str, list[RateTone]]:
    """Gyro → lines of its rate."""
    table = read_columns(task.input("tones"), ["gyro", "frequency", "amplitude"])
    found: dict[str, list[RateTone]] = {}
    for gyro, frequency, amplitude in zip(*table.values(), strict=True):
        found.setdefault(str(gyro), []).append(RateTone(float(frequency), float(amplitude)))
    return found


def read_garch(task: Task, gyros: int) -> dict[str, GarchEffect]:
    """Gyro → GARCH(1,1) of the longest stretch; none if the level is not analysed."""
    if not task.inputs.get("garch"):
        return {}
    rows = garch_rows(task.input("garch"), ["gyro", "omega", "alpha", "beta"], WHOLE, gyros)
    return {str(gyro): GarchEffect(*(float(rows[name][row]) for name in ("omega", "alpha", "beta")))
            for row, gyro in enumerate(rows["gyro"])}  # fmt: skip


def effect_columns(effects: Sequence[Effect]) -> dict[str, np.ndarray]:
    """effects.parquet."""
    kinds = {field.name: str if field.type == "str" else float for field in fields(Effect)}
    return {name: np.array([getattr(one, name) for one in effects], dtype=kind) for name, kind in kinds.items()}


if __name__ == "__main__":
    run_task(main)

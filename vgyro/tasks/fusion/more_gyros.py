"""More gyros: what a larger array of the same kind of gyro would bring, from the noise and correlation of this one."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from vgyro.board import Board
from vgyro.config import FusionOptions
from vgyro.fusion import FilterParameters
from vgyro.more_gyros import MeanCorrelation, analyse
from vgyro.storage.tables import read_column, read_columns, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.fusion.array_inputs import in_motion
from vgyro.tasks.fusion.noise_record import read_noise
from vgyro.tasks.rates.rates_file import has_moved

SECTIONS = ("board", "fusion")


def main(task: Task) -> None:
    """inputs : rates, noise, correlation;  outputs : more_gyros;  options : board, axis, kind, analysis.fusion"""
    gyros = [gyro.name for gyro in task.section("board", Board).array(task.option("axis"))]
    options = task.section("fusion", FusionOptions)
    at_rest = read_column(task.input("rates"), "at_rest")
    moving = in_motion(task.option("kind"), at_rest, has_moved(task.input("rates")))
    parameters = FilterParameters.of(options, moving)
    noise = read_noise(task.input("noise"), gyros).with_arw(parameters.arw)
    correlation = read_correlation(task.input("correlation"), gyros)
    logging.info("mean correlation %g, %g to %g", correlation.value, correlation.low, correlation.high)
    found = analyse(noise, correlation, parameters, options.most_gyros)
    write_table(task.output("more_gyros"), found.columns, "more_gyros", task.provenance(), {"summary": found.summary})


def read_correlation(path: Path, gyros: list[str]) -> MeanCorrelation:
    """Mean of the factors of correlation.parquet above the diagonal, with its limits."""
    table = read_columns(path)
    places = {name: place for place, name in enumerate(gyros)}
    rows = [places[str(name)] for name in table["gyro"]]
    columns = [places[str(name)] for name in table["other"]]
    matrices = []
    for name in ("correlation", "low", "high"):
        matrix = np.full((len(gyros), len(gyros)), np.nan)
        matrix[rows, columns] = table[name]
        matrices.append(matrix)
    return MeanCorrelation.of(*matrices)


if __name__ == "__main__":
    run_task(main)

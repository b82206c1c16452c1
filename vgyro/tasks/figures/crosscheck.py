"""Crosscheck: a random sample of the results, computed again by the other engine and by independent routes."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import numpy as np

from vgyro.arrays import Floats
from vgyro.board import Board
from vgyro.config import CrossCheckOptions, FusionOptions, MetricsOptions
from vgyro.engine.independent import printed_filter, textbook_allan_deviation
from vgyro.fusion import FilterParameters
from vgyro.fusion.design import information, q_for_bandwidth
from vgyro.metrics import Sampling, allan_deviation, own_samples, without_outliers
from vgyro.storage.tables import read_column, read_columns, read_metadata, read_rows, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.figures.crosscheck_rows import Check, CrosscheckRow, columns_of, compare
from vgyro.tasks.figures.crosscheck_windows import window_rows
from vgyro.tasks.fusion.array_inputs import in_motion
from vgyro.tasks.fusion.noise_record import read_noise
from vgyro.tasks.rates.rates_file import has_moved, incomplete, read_array, read_frame

SECTIONS = ("board", "engine", "volatility", "fusion", "metrics", "crosscheck")

FILTER_SAMPLES = 2000
FILTER_TOLERANCE = 1e-9  # of the largest rate
ALLAN_SERIES, ALLAN_TAUS = 3, 3
ALLAN_TOLERANCE = 1e-7  # of the deviation
DEFINITION, LOSSES = "definition: adjacent means", "the other engine, over short losses"


def main(task: Task) -> None:
    """inputs : rates, noise, fused, methods, allan, series, garch, dcc, weights;  outputs : crosscheck

    options : board, axis, recording, kind, analysis (engine, volatility, fusion, crosscheck)
    """
    options = task.section("crosscheck", CrossCheckOptions)
    gyros = [gyro.name for gyro in task.section("board", Board).array(task.option("axis"))]
    windows, curves = np.random.default_rng(options.seed).spawn(2)
    # Whole series are read before the libraries are loaded: the two need not be in memory together.
    allan = list(allan_rows(task, gyros, curves))
    rows = [*window_rows(task, options.windows, windows), *filter_rows(task, gyros), *allan]
    failed = sum(not row.passed for row in rows)
    logging.info("%d comparisons, %d of them outside the tolerance", len(rows), failed)
    write_table(task.output("crosscheck"), columns_of(rows), "crosscheck", task.provenance())


def filter_rows(task: Task, gyros: list[str]) -> Iterator[CrosscheckRow]:
    """The filters of Jiang et al. over the first samples, by filterpy: the sample that differs most."""
    columns = read_metadata(task.input("fused"))["units"]
    fusion = task.section("fusion", FusionOptions)
    for name, tau in (("jiang_markov", fusion.tau_s), ("jiang_random_walk", np.inf)):
        if name not in columns:
            continue
        rate = _first_samples(task, gyros)
        ours = read_rows(task.input("fused"), [name], 0, len(rate))[name]
        at_rest = read_columns(task.input("rates"), ["at_rest"])["at_rest"].astype(bool)
        moving = in_motion(task.option("kind"), at_rest, has_moved(task.input("rates")))
        parameters = FilterParameters.of(fusion, moving)
        R = read_noise(task.input("noise"), gyros).with_arw(parameters.arw).R
        q = parameters.q or q_for_bandwidth(information(R), parameters.bandwidth_hz, tau)
        theirs = printed_filter(rate, float(read_metadata(task.input("rates"))["rate_hz"]), R, q, tau)
        tolerance = FILTER_TOLERANCE * float(np.abs(rate).max())
        check = f"filter, worst of the first {len(rate)} samples"
        yield compare(Check(check, "filterpy, sample by sample", -1, name), ours, theirs, tolerance, "deg/s")


def _first_samples(task: Task, gyros: list[str]) -> Floats:
    """Rates [T, N] of the beginning of the first stretch, deg/s."""
    if incomplete(task.input("rates"), gyros):
        file = read_array(task.input("rates"), gyros, task.option("axis"))
        here = file.segment[:FILTER_SAMPLES] == file.segment[0]
        first: Floats = file.rate[:FILTER_SAMPLES][here].astype(float)
        return first
    found = read_rows(task.input("rates"), ["segment", *gyros], 0, FILTER_SAMPLES)
    here = found["segment"] == found["segment"][0]
    return np.column_stack([found[gyro][here] for gyro in gyros]).astype(float)


def allan_rows(task: Task, gyros: list[str], rng: np.random.Generator) -> Iterator[CrosscheckRow]:
    """Some points of the overlapping Allan curves of a few series, by the definition.

    The definition knows of no lost sample: series with losses or outliers are computed again by the other engine.
    """
    curves = read_columns(task.input("allan"), ["series", "kind", "tau", "deviation"])
    names = sorted(set(curves["series"]))
    file = read_frame(task.input("rates"), gyros, task.option("axis"))
    # A recording in motion at a constant rate has a curve of rate - reference, which is not looked at here.
    if not names or not file.at_rest.any():
        return
    options = task.section("metrics", MetricsOptions)
    sampling = file.rest_sampling(options.most_lost_s)
    rest, whole_segment = file.at_rest, sampling.segment
    for name in rng.permutation(names)[:ALLAN_SERIES]:
        rate = read_column(task.input("rates" if name in gyros else "fused"), str(name), float)
        rate = rate if rest.all() else rate[rest]
        # A gyro that lacks values is measured at its own samples.
        rate, when = own_samples(rate, sampling)
        segment = whole_segment if when is sampling else when.segment
        outliers = without_outliers(rate, when.rate_hz, segment, options.outlier_threshold)[1]
        whole = when.missing == 0 and not outliers.any()
        places = np.flatnonzero((curves["series"] == name) & (curves["kind"] == "overlapping"))
        for place in np.sort(rng.permutation(places)[:ALLAN_TAUS]):
            tau, ours = float(curves["tau"][place]), float(curves["deviation"][place])
            if whole:
                theirs = textbook_allan_deviation(rate, when.rate_hz, tau, segment)
            else:
                theirs = _by_other_engine(task, rate[~outliers], when.without(outliers), tau)
            yield compare(
                Check(f"Allan deviation, τ = {tau:.4g} s", DEFINITION if whole else LOSSES, -1, str(name)),
                ours,
                theirs,
                ALLAN_TOLERANCE * abs(ours),
                "deg/s",
            )


def _by_other_engine(task: Task, rate: np.ndarray, sampling: Sampling, tau: float) -> float:
    other = "reference" if task.engine == "native" else "native"
    curve = allan_deviation(rate, sampling.rate_hz, np.array([tau]), engine=other, sampling=sampling)
    return float(curve.deviation[0])


if __name__ == "__main__":
    run_task(main)

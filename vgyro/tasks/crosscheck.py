"""Crosscheck: a random sample of the results, computed again by an independent route."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import numpy as np

from vgyro.config import CrossCheckOptions
from vgyro.engine.independent import printed_filter, textbook_allan_deviation
from vgyro.fusion.design import information, q_for_bandwidth
from vgyro.storage.tables import read_columns, read_metadata, write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.crosscheck_rows import Row, columns_of, compare
from vgyro.tasks.crosscheck_windows import window_rows
from vgyro.tasks.fusion_inputs import OpenArray, open_array
from vgyro.tasks.rates_file import read_array

FILTER_SAMPLES = 2000
FILTER_TOLERANCE = 1e-9  # of the largest rate
ALLAN_SERIES, ALLAN_TAUS = 3, 3
ALLAN_TOLERANCE = 1e-7  # of the deviation


def main(task: Task) -> None:
    """inputs : rates, noise, fused, methods, allan, garch, dcc, weights;  outputs : crosscheck

    options : board, axis, recording, kind, analysis (volatility, fusion, crosscheck)
    """
    options = CrossCheckOptions.model_validate(task.options["analysis"].get("crosscheck", {}))
    rng = np.random.default_rng(options.seed)
    opened = open_array(task)
    rows = [
        *window_rows(task, opened.gyros, options.windows, rng),
        *filter_rows(task, opened),
        *allan_rows(task, opened, rng),
    ]
    failed = sum(not row.passed for row in rows)
    logging.info("%d comparisons, %d of them outside the tolerance", len(rows), failed)
    write_table(task.output("crosscheck"), columns_of(rows), "crosscheck", task.provenance())


def filter_rows(task: Task, opened: OpenArray) -> Iterator[Row]:
    """The filters of Jiang et al. over the first samples, by filterpy: the sample that differs most."""
    columns = read_metadata(task.input("fused"))["units"]
    first = opened.rates.stretches()[0]
    part = slice(first.start, min(first.stop, FILTER_SAMPLES))
    rate = opened.rates.rate[part]
    for name, tau in (("jiang_markov", opened.parameters.tau_s), ("jiang_random_walk", np.inf)):
        if name not in columns:
            continue
        ours = read_columns(task.input("fused"), [name])[name][part]
        R = opened.rates.noise.with_arw(opened.parameters.arw).R
        q = opened.parameters.q or q_for_bandwidth(information(R), opened.parameters.bandwidth_hz, tau)
        theirs = printed_filter(rate, opened.rates.rate_hz, R, q, tau)
        tolerance = FILTER_TOLERANCE * float(np.abs(rate).max())
        check = f"filter, worst of the first {len(rate)} samples"
        yield compare(check, "filterpy, sample by sample", -1, name, ours, theirs, tolerance, "deg/s")


def allan_rows(task: Task, opened: OpenArray, rng: np.random.Generator) -> Iterator[Row]:
    """Some points of the Allan curves of a few series, by the definition."""
    curves = read_columns(task.input("allan"), ["series", "tau", "deviation"])
    names = sorted(set(curves["series"]))
    if not names:
        return
    file = read_array(task.input("rates"), opened.gyros, task.options["axis"])
    rest, segment = file.at_rest, file.rest_segment()
    for name in rng.permutation(names)[:ALLAN_SERIES]:
        rate = (
            file.rate[:, opened.gyros.index(name)]
            if name in opened.gyros
            else read_columns(task.input("fused"), [name])[name]
        )
        places = np.flatnonzero(curves["series"] == name)
        for place in np.sort(rng.permutation(places)[:ALLAN_TAUS]):
            tau, ours = float(curves["tau"][place]), float(curves["deviation"][place])
            theirs = textbook_allan_deviation(rate[rest], file.rate_hz, tau, segment)
            check = f"Allan deviation, τ = {tau:.4g} s"
            yield compare(
                check, "definition: adjacent means", -1, str(name), ours, theirs, ALLAN_TOLERANCE * abs(ours), "deg/s"
            )


if __name__ == "__main__":
    run_task(main)

"""Fuse: one virtual gyroscope a method, from the rates, the noise and the weights of one array."""

from __future__ import annotations

import logging

import pyarrow as pa

from vgyro.fusion import Outcome, run_methods, select
from vgyro.storage.tables import write_table
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.fusion_inputs import open_array

TEXTS = ("method", "definition", "column", "title", "source")
FIGURES = ("dc_gain", "bandwidth_hz", "noise_bandwidth_hz", "delay_s")
ONE_GYRO = "one gyro: there is nothing to fuse"


def main(task: Task) -> None:
    """Read one array's rates, run every chosen method, write fused.parquet and methods.parquet.

    An array of one gyro gives tables without a method, and a note in their metadata.
    """
    opened = open_array(task)
    fused = {"time": opened.time, "segment": opened.rates.segment}
    rows, extra = [], {}
    if len(opened.gyros) == 1:
        extra = {"note": ONE_GYRO}
        logging.info(ONE_GYRO)
    else:
        methods = select(opened.fusion.methods)
        for outcome in run_methods(opened.rates, opened.parameters, methods, opened.volatility.definitions):
            rows.append(describe(outcome))
            logging.info("%s: %s", outcome.column or outcome.method.name, outcome.note or "ok")
            if outcome.fused is not None:
                fused[outcome.column] = outcome.fused.rate
    rate = {"rate_hz": opened.rates.rate_hz}
    write_table(task.output("fused"), fused, "fused", task.provenance(), {**rate, **extra})
    write_table(task.output("methods"), table_of(rows), "methods", task.provenance(), extra)


def describe(outcome: Outcome) -> dict[str, object]:
    """A row of methods.parquet; figures are NaN where the method could not run."""
    method, fused = outcome.method, outcome.fused
    texts = (method.name, outcome.definition, outcome.column, method.title, method.source)
    figures = {name: getattr(fused, name) if fused is not None else float("nan") for name in FIGURES}
    return {**dict(zip(TEXTS, texts, strict=True)), "causal": method.causal, **figures, "note": outcome.note}


def table_of(rows: list[dict[str, object]]) -> pa.Table:
    """Rows → table; without rows, too, the columns have their types."""
    fields = [(name, pa.string()) for name in TEXTS] + [("causal", pa.bool_())]
    fields += [(name, pa.float64()) for name in FIGURES] + [("note", pa.string())]
    return pa.Table.from_pylist(rows, schema=pa.schema(fields))


if __name__ == "__main__":
    run_task(main)

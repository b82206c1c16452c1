"""The whole volatility stage of one array and one definition of r_t, in one process: GARCH, DCC, ARCH-LM, weights."""

from __future__ import annotations

import logging

from vgyro.tasks import arch_lm, dcc, garch, weights
from vgyro.tasks.common import Task, run_task


def main(task: Task) -> None:
    """inputs : rates;  outputs : garch, dcc, arch_lm, weights;  options : board, kind, axis, definition, analysis"""
    made = dict(task.inputs)
    for name, step in (("garch", garch), ("dcc", dcc), ("arch_lm", arch_lm), ("weights", weights)):
        logging.info("%s", name)
        step.main(Task(made, {name: task.output(name)}, task.options, task.code))
        made = {**made, name: [task.output(name)]}


if __name__ == "__main__":
    run_task(main)

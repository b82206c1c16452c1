"""The last word of a run: it fails if a manifest is wrong or a recording was refused, and says each reason again."""

from __future__ import annotations

from vgyro.errors import DataError
from vgyro.storage.tables import read_json, write_json
from vgyro.tasks.common import Task, run_task


def main(task: Task) -> None:
    """inputs : screens, page;  outputs : verdict;  options : problems (mistakes in config and manifests)"""
    screens = [read_json(path) for path in task.inputs["screens"]]
    refused = [
        f"{screen['dataset']}/{name}: {reason}"
        for screen in screens
        for name, recording in screen["recordings"].items()
        if not recording["usable"]
        for reason in recording["reasons"]
    ]
    complaints = [*task.option("problems"), *refused]
    if complaints:
        listed = "\n  ".join(complaints)
        remedy = f"All the rest is done: {task.input('page')}"
        raise DataError(f"{len(complaints)} of the inputs could not be used:\n  {listed}\n", remedy=remedy)
    write_json(task.output("verdict"), {"datasets": [screen["dataset"] for screen in screens], "refused": []})


if __name__ == "__main__":
    run_task(main)

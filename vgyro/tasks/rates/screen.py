"""Which recordings of a data set can be used, and how long each one is."""

from __future__ import annotations

from vgyro.dataset import Manifest
from vgyro.storage.tables import read_json, write_json
from vgyro.tasks.common import Task, run_task

SECTIONS = ("manifest",)


def main(task: Task) -> None:
    """inputs : integrity, one a recording in the manifest's order;  outputs : screen (JSON);  options : manifest"""
    manifest = task.section("manifest", Manifest)
    recordings = {}
    for recording, path in zip(manifest.recordings, task.inputs["integrity"], strict=True):
        record = read_json(path)
        recordings[recording.name] = {
            "usable": record["status"] != "refused",
            "status": record["status"],
            "reasons": record["reasons"],
            "duration_s": record["duration_s"],
            "rate_hz": record["rate_hz"],
        }
    write_json(task.output("screen"), {"dataset": task.option("dataset"), "recordings": recordings})


if __name__ == "__main__":
    run_task(main)

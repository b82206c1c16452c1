"""Index: the overview of all data sets."""

from __future__ import annotations

from pathlib import Path

from vgyro.report.index_page import render_index
from vgyro.storage.tables import read_json, write_text
from vgyro.tasks.common import Task, run_task


def main(task: Task) -> None:
    """inputs : headlines (JSON), papers (pages, optional);  outputs : page;  options : problems, a list of texts"""
    page = task.output("page")
    headlines = [read_json(path) for path in task.inputs.get("headlines", [])]
    papers = [(path.stem, _relative(path, page.parent)) for path in task.inputs.get("papers", [])]
    write_text(page, render_index(headlines, task.option("problems"), papers))


def _relative(path: Path, folder: Path) -> str:
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else path.as_posix()


if __name__ == "__main__":
    run_task(main)

"""Papers: the tables and claims of one paper again, from its twin, as a page and as CSV."""

from __future__ import annotations

import logging

from vgyro.board import Board
from vgyro.config import MetricsOptions, VolatilityOptions
from vgyro.dataset import Manifest
from vgyro.papers import compare, csv_of, judge, load_paper
from vgyro.papers.beside import set_beside
from vgyro.papers.implied_cells import implied_cells, implied_figures
from vgyro.papers.published import Heading
from vgyro.storage.tables import write_text
from vgyro.tasks.common import Task, run_task
from vgyro.tasks.papers.evidence import Wanted, gather
from vgyro.tasks.papers.page import paper_page
from vgyro.tasks.papers.plots import figures

SECTIONS = ("manifest", "board", "volatility", "metrics")


def main(task: Task) -> None:
    """Read one twin's artefacts, compare, judge, write the page and the CSV files.

    inputs  : artefacts;  outputs : page, table1, table2, table3
    options : dataset (the paper's name), manifest, board, analysis (volatility, metrics)
    """
    manifest = task.section("manifest", Manifest)
    board = task.section("board", Board)
    paper = load_paper(task.option("dataset"))
    evidence = gather(
        task.inputs["artefacts"],
        manifest,
        board,
        task.section("volatility", VolatilityOptions),
        task.section("metrics", MetricsOptions),
        Wanted(
            any(table.select.get("artefact") == "metrics_1hz" for table in paper.tables),
            [name_of(rival) for table in paper.tables for rival in table.rivals()],
        ),
    )
    implied = implied_cells(paper)
    comparisons = [compare(paper, table, evidence, implied) for table in paper.tables]
    beside = {table.number: set_beside(table, evidence) for table in paper.tables}
    for comparison in comparisons:
        name = f"table{comparison.table.number}"
        if name in task.outputs:
            write_text(task.output(name), csv_of([comparison], beside[comparison.table.number]))
        missing = [cell for cell in comparison.cells if cell.published is not None and cell.reason]
        logging.info("%s: %d readings, %d without a figure of ours", name, len(comparison.cells), len(missing))
    verdicts = [(claim, judge(claim, evidence, implied_figures(paper))) for claim in paper.claims]
    plots = figures(paper.name, evidence.gyros, task.inputs["artefacts"])
    write_text(task.output("page"), paper_page(paper, manifest, comparisons, verdicts, plots, beside))


def name_of(heading: Heading) -> tuple[str, str]:
    """Method and definition that a heading selects."""
    return str(heading.select["method"]), str(heading.select.get("definition", ""))


if __name__ == "__main__":
    run_task(main)

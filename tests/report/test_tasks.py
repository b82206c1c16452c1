"""The tasks report and index over a small set of artefacts: what a page must hold, and that it repeats itself."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

from vgyro.report.index_page import render_index
from vgyro.storage.tables import read_json
from vgyro.tasks.common import Task
from vgyro.tasks.pages import index, report
from vgyro.tasks.pages.report import ArtefactPlace, place_of


@pytest.fixture(scope="module")
def page(report_task: Task) -> str:
    report.main(report_task)
    return report_task.output("page").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def builder() -> ModuleType:
    path = Path(__file__).with_name("conftest.py")
    spec = importlib.util.spec_from_file_location("bench_artefacts", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_places_of_artefacts() -> None:
    root = Path("results/demo")
    assert place_of(root / "static/rates.parquet", "demo") == ArtefactPlace("static", "", "", "rates")
    assert place_of(root / "static/x/allan.parquet", "demo") == ArtefactPlace("static", "x", "", "allan")
    assert place_of(root / "demo/x/level/dcc.parquet", "demo") == ArtefactPlace("demo", "x", "level", "dcc")
    with pytest.raises(ValueError, match="not in results/other"):
        place_of(root / "static/rates.parquet", "other")


def test_the_page_has_every_part_in_order(page: str) -> None:
    titles = re.findall(r"<h2>([^<]+)", page)
    assert [title.strip() for title in titles] == [
        "What to conclude", "What was measured, and how complete it is", "Calibration", "Axis x", "Axis z",
        "Conventions", "Provenance",
    ]  # fmt: skip
    plots = set(re.findall(r'<figure class="plot" id="([^"]+)"', page))
    assert {
        "scale-factor-x",
        "scale-residuals-x",
        "bias-temperature-x",
        "scale-temperature-x",
        "cross-allan-rest-x",
        "more-rest-x",
        "rates-rest-x",
        "allan-rest-x",
        "spectrum-rest-x",
        "rest-sine-x",
    } <= plots
    assert {"weights-rest-x-level-dcc-causal", "dcc-rest-x-level", "temperature-rest"} <= plots


def test_every_plot_has_its_own_id_and_every_link_a_target(page: str) -> None:
    ids = re.findall(r'\sid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(ids)


def test_text_from_files_is_escaped(page: str) -> None:
    assert "Bench board &lt;A&amp;B&gt;" in page
    assert "checksum &lt;&amp;&gt;" in page
    assert "paper &lt;eq. 1&gt;" in page


def test_a_method_that_could_not_run_says_why(page: str) -> None:
    row = re.search(r"Inverse variance, RRW</th>.*?</tr>", page, re.S)
    assert row is not None
    assert 'class="muted" colspan="' in row.group(0)
    assert "not run: no RRW was found for g1" in row.group(0)


def test_nominal_scale_and_simulation_are_marked(page: str) -> None:
    assert "Nominal scale" in page
    assert '<td class="warn">nominal</td>' in page
    assert "SIMULATED" in page


def test_a_passed_cross_check_is_closed_and_a_failed_one_open(page: str, builder: ModuleType, tmp_path: Path) -> None:
    assert "<details>\n<summary>Cross-check: all 3 comparisons passed" in page
    task = builder.build(tmp_path, failed_check=True)
    report.main(task)
    failed = task.output("page").read_text(encoding="utf-8")
    assert "<details open>\n<summary>Cross-check: 1 of 3 comparisons FAILED" in failed
    assert "The cross-check failed in 4 comparisons (rest, axis x; rest, axis z; sine, axis x; sine, axis z)" in failed


def test_the_same_artefacts_give_the_same_bytes(page: str, builder: ModuleType, tmp_path: Path) -> None:
    task = builder.build(tmp_path)
    report.main(task)
    assert task.output("page").read_text(encoding="utf-8") == page


def test_the_headline_and_the_overview(page: str, report_task: Task, tmp_path: Path) -> None:
    assert page
    headline = read_json(report_task.output("headline"))
    assert headline["status"] == "suspect"
    assert headline["refused"] == ["broken"]
    assert headline["scale"] == "partly nominal"
    assert [one["gyro"] for one in headline["bad_gyros"]] == ["g4"]
    problem = "raw/x/dataset.yaml:3: boards: unknown key; did you mean 'board'?"
    task = Task(
        {"headlines": [report_task.output("headline")]}, {"page": tmp_path / "index.html"}, {"problems": [problem]}, ""
    )
    index.main(task)
    overview = task.output("page").read_text(encoding="utf-8")
    assert 'href="bench.html"' in overview
    assert "g4 (3.1×)" in overview
    assert "1 refused" in overview
    assert "unknown key; did you mean" in overview


def test_an_overview_without_data_sets_says_what_to_do() -> None:
    assert "put a dataset.yaml" in render_index([])


def test_links_to_the_papers_pages(tmp_path: Path) -> None:
    task = Task(
        {"papers": [tmp_path / "papers" / "liu2015.html"]}, {"page": tmp_path / "index.html"}, {"problems": []}, ""
    )
    index.main(task)
    assert 'href="papers/liu2015.html"' in task.output("page").read_text(encoding="utf-8")

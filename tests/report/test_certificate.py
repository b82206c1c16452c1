"""The calibration certificate: every figure says what it is, or why it is not known."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import pytest

from vgyro.calibration.figures import FIGURES
from vgyro.log import Log
from vgyro.report.calibration.certificate import applied, figure_cell
from vgyro.report.calibration.certificate_plots import certificate_plots
from vgyro.report.calibration.section import calibration_part
from vgyro.report.model import DatasetPart
from vgyro.report.tables import Notes
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part


@pytest.fixture(scope="module")
def dataset(report_task: Task) -> DatasetPart:
    return read_dataset_part(report_task)


@pytest.fixture(scope="module")
def html(dataset: DatasetPart) -> str:
    return str(calibration_part(dataset))


def cells(html: str, title: str) -> list[str]:
    """Unit and texts of the cells of one figure's row, markup taken out."""
    row = re.search(rf'>{re.escape(title)}<span class="below">([^<]*)</span></th>(.*?)</tr>', html, re.S)
    assert row is not None, title
    return [row.group(1)] + [
        re.sub(r"<[^>]+>", " ", cell).strip() for cell in re.findall(r"<td[^>]*>(.*?)</td>", row.group(2), re.S)
    ]


def test_a_certificate_says_what_was_calibrated_and_how(html: str) -> None:
    head = dict(re.findall(r"<dt>([^<]+)</dt><dd>([^<]+)</dd>", html))
    assert head["object"] == "Bench board &lt;A&amp;B&gt;, axis x: g1, g2, g3, g4"
    assert head["data"] == "SIMULATED (twin demo): a model was calibrated, not a device"
    assert head["standard"] == "IEEE Std 1431-2004"
    assert head["rates"] == "26 rates, full scale ±300 deg/s, 20.0 s a point, whole turns of the table"
    assert head["temperature"] == "15.0 … 45.0 °C"
    assert head["Earth rate"].startswith("0.002900 deg/s")
    assert head["intervals"].startswith("95")
    assert html.count('<article class="sheet"') == 1, "solo, the only gyro of axis z, is nominal"


def test_a_device_is_not_called_simulated(dataset: DatasetPart) -> None:
    real = replace(dataset, manifest=dataset.manifest.model_copy(update={"simulated": False, "twin": ""}))
    head = dict(re.findall(r"<dt>([^<]+)</dt><dd>([^<]+)</dd>", calibration_part(real)))
    assert head["data"] == "measured"


def test_one_line_a_figure(html: str) -> None:
    assert cells(html, "Nonlinearity over full scale")[:2] == ["ppm", "210 180 … 240"]
    assert cells(html, "Nonlinearity over full scale")[-1] == "160"
    # Below the floor: the upper limit, or both limits of a figure with a sign.
    assert cells(html, "Nonlinearity over reading")[1] == "&lt; 720 below the floor of 640"
    assert cells(html, "Asymmetry")[1] == "\u221215.0 … 95.0 below the floor of 80.0"
    # One reason for all gyros is said once; a reason of one gyro is a footnote.
    assert cells(html, "Self-heating") == ["deg/h", "not measured: no recording begins at switch-on"]
    assert cells(html, "Scale factor against temperature")[4].startswith("not measured")
    assert "<li>one temperature only</li>" in html


def test_figures_of_the_artefact_without_a_value_have_no_number() -> None:
    missing: dict[str, Any] = {"value": None, "low": None, "high": None, "floor": None, "unit": "ppm", "note": "why"}
    cell = figure_cell(missing | {"state": "not measured"}, Notes())
    assert (cell.text, cell.hint) == ("not measured", "why")


def test_what_the_conversion_applies_is_said_for_every_gyro(dataset: DatasetPart) -> None:
    gyros = {name: record for name, record in dataset.calibration["gyros"].items() if name != "solo"}
    sentences = applied(gyros)
    assert any("for g1, g2, g3" in one and "15.0 … 45.0 °C" in one for one in sentences)
    assert "Not compensated for temperature: g4 (no temperature test)." in sentences
    off = {"g1": gyros["g1"] | {"temperature": gyros["g1"]["temperature"] | {"applied": False, "note": "too flat"}}}
    assert applied(off)[1:] == ["Not compensated for temperature: g1 (too flat)."]


def test_the_residuals_of_both_directions_are_apart(dataset: DatasetPart) -> None:
    html = certificate_plots("x", {"g1": dataset.calibration["gyros"]["g1"]})
    assert re.findall(r'data-series="(g1 \w+)"', html) == ["g1 up", "g1 down", "g1 polynomial"]
    first = json.loads(re.search(r'<script type="application/json">(.*?)</script>', html, re.S).group(1))
    markers = re.findall(r'"marker": \{"type": "value", "value": "(\w+)"\}', json.dumps(first))
    assert markers == ["triangle", "inverted_triangle"]


def test_many_gyros_are_cut_into_tables_that_fit_a_sheet(dataset: DatasetPart) -> None:
    gyros = dataset.calibration["gyros"]
    board = dataset.board.model_copy(
        update={"gyros": tuple(dataset.board.gyros[0].model_copy(update={"name": f"n{k}"}) for k in range(14))}
    )
    many = replace(
        dataset, board=board, calibration={**dataset.calibration, "gyros": {f"n{k}": gyros["g1"] for k in range(14)}}
    )
    html = calibration_part(many)
    widths = [len(re.findall(r">n\d+<", table)) for table in re.findall(r"<thead>.*?</thead>", html, re.S)]
    assert widths == [6, 6, 2]


def test_every_figure_of_a_calibration_is_explained(dataset: DatasetPart) -> None:
    assert list(dataset.calibration_figures) == list(FIGURES)


def test_rates_as_logged_are_not_called_nominal_counts(dataset: DatasetPart) -> None:
    nominal = {**dataset.calibration, "gyros": {
        name: {**record, "source": "nominal"} for name, record in dataset.calibration["gyros"].items()
    }}  # fmt: skip
    counts = replace(dataset, calibration=nominal)
    assert "Nominal scale" in str(calibration_part(counts))
    log = Log(values="rates")
    recordings = tuple(one.model_copy(update={"log": log}) for one in dataset.manifest.recordings)
    logged = replace(counts, manifest=dataset.manifest.model_copy(update={"recordings": recordings}))
    html = str(calibration_part(logged))
    assert "Rates as logged" in html
    assert "Nominal scale" not in html
    assert "deg/s a count" not in html

"""The frame of a page, tables and plots."""

import json
import re

import numpy as np
import pytest
from markupsafe import Markup

from vgyro.report.page import Section, render_page
from vgyro.report.plots import Axis, Curve, PlotFrame, PlotMarks, curve_plot
from vgyro.report.tables import Cell, Notes, TableColumn, TableRow, number_cell, render_table


def plot(name: str = "p") -> Markup:
    x = np.arange(10.0)
    curves = [Curve("a<b", "a<b", x, x, x - 1, x + 1), Curve("hidden", "hidden", x, 2 * x, visible=False)]
    return curve_plot(
        PlotFrame(name, "title & more", Axis("time, s"), Axis("rate, deg/s")), curves, PlotMarks(spans=[(1.0, 2.0)])
    )


def test_a_page_asks_the_network_for_nothing_and_escapes_what_it_is_given() -> None:
    html = render_page("A <b> & c", [Section("one", "One", plot())], subtitle="<script>")
    assert "<title>A &lt;b&gt; &amp; c" in html
    assert "&lt;script&gt;" in html
    assert not re.findall(r'<(?:script|img|iframe)[^>]*\ssrc=|<link[^>]*href="(?!data:)', html)
    assert "@import" not in html
    assert "url(http" not in html


def test_the_plots_script_is_there_once_and_only_for_plots() -> None:
    with_plots = render_page("p", [Section("one", "One", plot("p1")), Section("two", "Two", plot("p2"))])
    without = render_page("p", [Section("one", "One", Markup("<p>nothing</p>"))])
    assert len(without) < 50_000 < 1_000_000 < len(with_plots) < 2_000_000


def test_every_script_element_ends_where_it_should() -> None:
    html = render_page("p", [Section("one", "One", plot())])
    assert html.count("<script") == html.count("</script>")


def test_two_renderings_are_the_same_bytes_even_in_one_process() -> None:
    assert plot() == plot()


def test_ids_of_two_plots_differ() -> None:
    ids = [set(re.findall(r'"id":"([^"]+)"', plot(name))) for name in ("p1", "p2")]
    assert ids[0]
    assert not ids[0] & ids[1]


def test_plot_data_is_json_with_all_its_references() -> None:
    text = re.search(r'<script type="application/json">(.*?)</script>', plot(), re.S).group(1)
    record = json.loads(text)
    assert record["root_id"] == record["doc"]["roots"][0]["id"]
    assert "<" not in text


def test_two_sections_of_one_id_are_refused() -> None:
    with pytest.raises(ValueError, match=r"one id.*same"):
        render_page("p", [Section("same", "A"), Section("b", "B", children=(Section("same", "C"),))])


def test_a_simulated_page_says_so() -> None:
    assert "SIMULATED" in render_page("p", [], simulated="twin demo")
    assert "SIMULATED" not in render_page("p", [])


def test_a_table_escapes_text_and_gives_units() -> None:
    html = render_table(
        [TableColumn("gyro", numeric=False), TableColumn("σ", "deg/s")], [["<g>", number_cell(1.5, 1.4, 1.6)]]
    )
    assert "&lt;g&gt;" in html
    assert '<span class="unit">deg/s</span>' in html
    assert re.search(r'class="number">1\.500?<span class="below">1\.400? … 1\.600?</span>', html)


def test_a_row_of_the_wrong_width_is_refused() -> None:
    with pytest.raises(ValueError, match="1 cells, the table has 2 columns"):
        render_table([TableColumn("a"), TableColumn("b")], [["only one"]])


def test_headings_span_the_table_and_notes_are_numbered_once() -> None:
    notes = Notes()
    rows = [
        TableRow(heading="Methods"),
        [Cell("a", notes=notes.number("same"))],
        [Cell("b", notes=notes.number("same"))],
    ]
    html = render_table([TableColumn("name")], rows, notes=notes.texts)
    assert notes.texts == ["same"]
    assert html.count("<sup>1</sup>") == 2
    assert html.count("<li>same</li>") == 1
    assert 'colspan="1"' in html

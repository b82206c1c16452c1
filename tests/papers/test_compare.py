"""Every published cell meets a figure or a reason; look-ups, agreement and CSV."""

import csv
import io
import math

import pytest

from vgyro.errors import DataError
from vgyro.papers import PAPERS, Ours, PaperEvidence, compare, csv_of, load_paper, look_up, with_single
from vgyro.papers.compare import CSV_COLUMNS, agreement
from vgyro.papers.implied_cells import implied_cells

GYROS = tuple(f"g{number}" for number in range(1, 7))


def everything(paper):
    """One row for each look-up that the tables of a paper make, all with the value 1 ± 0.1."""
    rows = {}
    for table in paper.tables:
        for row in table.rows:
            for column in table.columns:
                for variant in table.variants:
                    if variant.rows is not None and row.name not in variant.rows:
                        continue
                    if variant.columns is not None and column.name not in variant.columns:
                        continue
                    select = {**table.select, **row.select, **column.select, **variant.select}
                    name = select.pop("artefact")
                    reads = {key: select.pop(key, key) for key in ("value", "low", "high")}
                    select.pop("absolute", None)
                    unit = select.pop("unit", None)
                    key = {k: GYROS[int(v[-1]) - 1] if str(v).startswith("$") else v for k, v in select.items()}
                    known = rows.setdefault(name, {}).setdefault(tuple(sorted(key.items())), dict(key))
                    known.update({reads["value"]: 1.0, reads["low"]: 0.9, reads["high"]: 1.1})
                    if unit is None and name.startswith(("metrics", "factors")):
                        known["unit"] = table.unit_of(row, column)
    return PaperEvidence({name: list(found.values()) for name, found in rows.items()}, GYROS)


@pytest.mark.parametrize("name", PAPERS)
def test_every_numeric_cell_has_a_counterpart_or_a_reason(name):
    paper = load_paper(name)
    for evidence, filled in ((everything(paper), True), (PaperEvidence({}, GYROS), False)):
        for table in paper.tables:
            comparison = compare(paper, table, evidence, implied_cells(paper))
            for row in table.rows:
                for column in table.columns:
                    readings = comparison.at(row.name, column.name)
                    assert len(readings) == 1 or table.text(row.name, column.name) is None or len(readings) > 1
                    assert readings or table.text(row.name, column.name) is None
                    for cell in readings:
                        assert cell.ours.known == filled, (cell.row, cell.column, cell.reason)
                        assert bool(cell.reason) != filled
                        assert cell.implied is not None
                        assert cell.implied.how


def test_csv_has_one_line_a_reading_and_names_what_is_ours():
    paper = load_paper("jiang2012")
    comparison = compare(paper, paper.table(2), everything(paper), implied_cells(paper))
    lines = list(csv.DictReader(io.StringIO(csv_of([comparison]))))
    assert tuple(lines[0]) == CSV_COLUMNS
    assert len(lines) == len(comparison.cells)
    # 16 printed cells, 4 + 4 second readings of ARW and RRW, and two columns of ours.
    assert len([line for line in lines if line["published"]]) == 24
    printed = next(line for line in lines if (line["row"], line["column"]) == ("ARW", "1st order Markov"))
    assert (printed["published"], printed["unit"], printed["ours"]) == ("1.83", "deg/√h", "1")
    assert printed["ours_is"] == "simulated"
    assert float(printed["implied"]) == pytest.approx(2.31, abs=0.005)


def test_a_reading_of_another_quantity_is_shown_and_not_compared():
    paper = load_paper("liu2015")
    comparison = compare(paper, paper.table(1), everything(paper), implied_cells(paper))
    level, detrended, standardised = comparison.at("Gyro 1", "LM-Statistic")
    assert level.agreement == "differs"
    assert detrended.ours.known
    assert {detrended.agreement, standardised.agreement} == {"none"}


def test_csv_of_an_absent_figure_is_empty_with_a_reason():
    paper = load_paper("liu2015")
    lines = list(
        csv.DictReader(
            io.StringIO(csv_of([compare(paper, paper.table(3), PaperEvidence({}, GYROS), implied_cells(paper))]))
        )
    )
    assert all(line["ours"] == "" and line["reason"] and line["agreement"] == "none" for line in lines)


@pytest.mark.parametrize(
    ("published", "ours", "expected"),
    [
        ("1.83", Ours(1.9, 1.8, 2.0), "within interval"),
        # 1.80 is 0.005 below the limit, which the rounding of the print covers.
        ("1.80", Ours(1.9, 1.804, 2.0), "within interval"),
        ("1.80", Ours(1.9, 1.85, 2.0), "within 10 %"),
        ("1.80", Ours(1.804), "within interval"),
        ("1.80", Ours(3.0, 2.9, 3.1), "differs"),
        ("1.80", Ours(math.nan, reason="none"), "none"),
        (None, Ours(1.0), "none"),
    ],
)
def test_agreement(published, ours, expected):
    assert agreement(published, ours) == expected


def test_look_up_by_columns():
    rows = [
        {"method": "g4", "metric": "mean", "value": -0.1, "low": -0.2, "high": -0.05, "unit": "deg/s", "note": "n"},
        {"method": "g4", "metric": "sigma", "value": math.nan, "low": math.nan, "high": math.nan, "note": "too short"},
    ]
    evidence = PaperEvidence({"metrics": rows}, GYROS)
    select = {"artefact": "metrics", "method": "$gyro4", "metric": "mean"}
    assert look_up(evidence, select).value == -0.1
    found = look_up(evidence, {**select, "absolute": True})
    assert (found.value, found.low, found.high) == (0.1, 0.05, 0.2)
    assert (found.unit, found.notes) == ("deg/s", ("n",))
    assert look_up(evidence, {**select, "metric": "sigma"}).reason == "value is not defined: too short"
    assert "no such row" in look_up(evidence, {**select, "metric": "arw"}).reason
    assert "no gyro9" in look_up(evidence, {**select, "method": "$gyro9"}).reason


def test_the_magnitude_of_a_figure_whose_limits_hold_0():
    rows = [{"value": 0.1, "low": -0.3, "high": 0.2}]
    found = look_up(PaperEvidence({"m": rows}), {"artefact": "m", "absolute": True})
    assert (found.low, found.high) == (0.0, 0.3)


def test_two_fitting_rows_are_an_error():
    evidence = PaperEvidence({"m": [{"value": 1.0}, {"value": 2.0}]})
    with pytest.raises(DataError, match="2 rows fit"):
        look_up(evidence, {"artefact": "m"})


def test_single_is_the_mean_over_the_gyros():
    def row(method, metric, value, half):
        return {
            "recording": "static", "axis": "z", "method": method, "metric": metric,
            "value": value, "low": value - half, "high": value + half, "unit": "deg/s",
        }  # fmt: skip

    rows = [row("g1", "mean", -0.2, 0.03), row("g2", "mean", 0.1, 0.04), row("g1", "sigma", 1.0, 0.1)]
    evidence = PaperEvidence({"metrics": with_single(rows, ("g1", "g2"))}, ("g1", "g2"))
    single = look_up(evidence, {"artefact": "metrics", "method": "single", "metric": "mean"})
    # Magnitudes are averaged; the half-widths 0.03 and 0.04 give 0.05 / 2.
    assert (single.value, single.low, single.high) == pytest.approx((0.15, 0.125, 0.175))
    assert not look_up(evidence, {"artefact": "metrics", "method": "single", "metric": "sigma"}).known


def test_a_figure_in_another_unit_is_not_compared():
    paper = load_paper("jiang2012")
    rows = [
        {
            "recording": "static",
            "definition": "",
            "method": "average",
            "metric": "arw_1s",
            "value": 0.04,
            "unit": "deg/s",
        }
    ]
    comparison = compare(paper, paper.table(2), PaperEvidence({"metrics": rows}, GYROS), implied_cells(paper))
    (cell, _) = comparison.at("ARW", "Simple average")
    assert not cell.ours.known
    assert cell.reason == "ours is in deg/s, the table in deg/√h"

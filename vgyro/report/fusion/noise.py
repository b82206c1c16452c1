"""Allan curves and spectra of every gyro and method, tones, and what the noise of two gyros has in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from markupsafe import Markup

from vgyro.report.envelope import logarithmic
from vgyro.report.html import details, join, paragraph
from vgyro.report.model import ArrayPart, Record, Table, rows_of
from vgyro.report.numbers import probability, significant
from vgyro.report.plots import Axis, Curve, PlotFrame, PlotMarks, curve_plot
from vgyro.report.tables import Cell, TableColumn, number_cell, render_table

# What a first look needs; the rest is one click away.
SHOWN = ("average", "inverse_variance_arw", "dcc_causal", "recommended_unsmoothed", "recommended")
SPECTRUM_POINTS = 700
OVERLAPPING = "overlapping"
MOST_MARKED, FEW_TONES, MOST_LISTED = 12, 12, 60
PAIRS_SHOWN, MOST_PAIRS = 3, 30
TONE_COLUMNS = (
    TableColumn("frequency", "Hz"),
    TableColumn("gyro", numeric=False),
    TableColumn("amplitude", "deg/s"),
    TableColumn("by chance", hint="chance that noise makes one such line anywhere in the spectrum"),
    TableColumn("also in", numeric=False),
)
TONE_WORDS = (
    "A line may be an alias of a faster vibration. One that several gyros share comes from outside them (mounting, "
    "supply, clock). In a series of block means a tone is folded to a low frequency and can look like an ARCH effect."
)
GYROS, METHODS = "single gyros", "methods (faded ones are hidden: click to show them)"


def allan_plot(array: ArrayPart) -> Markup:
    """Overlapping Allan deviation of every series with its limits; other estimators, where there are any, hidden."""
    table = array.tables.get("allan")
    if table is None or not len(table["tau"]):
        return paragraph("No Allan deviation: the recording holds too little data at rest.", "note")
    curves = []
    for kind in dict.fromkeys((OVERLAPPING, *table["kind"].tolist())):
        one = {name: column[table["kind"] == kind] for name, column in table.items()}
        drawn = _curves(array, one, partial(_of_kind, one), points=True)
        if kind != OVERLAPPING:
            group = f"{kind} (hidden: click to show them)"
            drawn = [replace(curve, name=f"{curve.name} {kind}", group=group, visible=False) for curve in drawn]
        curves += drawn
    return curve_plot(
        PlotFrame(
            f"allan-{array.anchor}",
            "Overlapping Allan deviation",
            Axis("averaging time τ, s", "log"),
            Axis("Allan deviation σ, deg/s", "log"),
            summary="bars: limits by chi²; 3600·σ is in deg/h, 60·σ(1 s) is the ARW read at 1 s in deg/√h",
            height=460,
        ),
        curves,
    )


def _of_kind(table: Table, mask: np.ndarray) -> Curve:
    tau, deviation, low, high = (table[name][mask] for name in ("tau", "deviation", "low", "high"))
    return Curve("", "", tau, deviation, low, high)


def spectrum_plot(array: ArrayPart) -> Markup:
    """One-sided Welch density of every series, the strongest tones marked."""
    table = array.tables.get("spectrum")
    if table is None or not len(table["frequency"]):
        return paragraph("No spectrum: the recording holds too little data at rest.", "note")

    def pick(mask: np.ndarray) -> Curve:
        frequency, density = logarithmic(table["frequency"][mask], table["density"][mask], SPECTRUM_POINTS)
        return Curve("", "", frequency, np.where(density > 0, density, np.nan))

    tones = strongest_tones(array, MOST_MARKED)
    marked = f"; dashed: the {'strongest ' if len(tones) == MOST_MARKED else ''}tones" if tones else ""
    return curve_plot(
        PlotFrame(
            f"spectrum-{array.anchor}",
            "Noise spectrum, ONE-sided",
            Axis("frequency, Hz", "log"),
            Axis("amplitude density, one-sided, deg/s/√Hz", "log"),
            summary=f"the two-sided density, which N and the papers use, is smaller by √2{marked}",
            height=400,
        ),
        _curves(array, table, pick, points=False),
        PlotMarks(lines=[float(tone["frequency"]) for tone in tones]),
    )


def strongest_tones(array: ArrayPart, most: int) -> list[Record]:
    """Rows of tones.parquet, at most so many, by falling amplitude."""
    rows: list[Record] = sorted(rows_of(array.tables.get("tones", {})), key=lambda row: -float(row["amplitude"]))
    return rows[:most]


def tones_table(array: ArrayPart) -> Markup:
    """Tones by frequency: how strong, how sure, and which gyros share them."""
    if "tones" not in array.tables:
        return Markup("")
    every = strongest_tones(array, len(array.tables["tones"]["gyro"]))
    if not every:
        return paragraph("No tones: no line of any gyro's spectrum stands out of its noise.", "note")
    listed = sorted(every[:MOST_LISTED], key=lambda row: (float(row["frequency"]), str(row["gyro"])))
    more = f", the {MOST_LISTED} strongest of {len(every)}" if len(every) > MOST_LISTED else ""
    table = render_table(
        TONE_COLUMNS, [_tone_row(row) for row in listed], f"Tones{more}", row_header=False, compact=True
    )
    words = paragraph(TONE_WORDS, "note")
    if len(listed) <= FEW_TONES:
        return join(table, words)
    return details(f"{len(every)} tones in {len({str(row['gyro']) for row in every})} gyros", join(table, words))


def _tone_row(row: Record) -> list[Cell]:
    gyro, shared = str(row["gyro"]), row["shared"]
    names = shared.split(", ") if isinstance(shared, str) else list(shared)
    others = [name for name in names if name and name != gyro]
    return [
        Cell(significant(float(row["frequency"]), 4)),
        Cell(gyro),
        number_cell(*(float(row[name]) for name in ("amplitude", "low", "high"))),
        Cell(probability(float(row["probability"]))),
        Cell(", ".join(others) if others else "none", tone="" if others else "muted"),
    ]


def cross_allan_plot(array: ArrayPart) -> Markup:
    """Correlation of the gyros' noise against averaging time; the pairs whose limits are farthest from 0 are shown."""
    table = array.tables.get("cross_allan")
    if table is None:
        return Markup("")
    pairs = {
        (first, second): (table["gyro"] == first) & (table["other"] == second) & np.isfinite(table["correlation"])
        for place, first in enumerate(array.gyros)
        for second in array.gyros[place + 1 :]
    }
    pairs = {pair: mask for pair, mask in pairs.items() if mask.any()}
    if not pairs:
        return Markup("")
    order = sorted(pairs, key=lambda pair: -_apart(table, pairs[pair]))[:MOST_PAIRS]
    some = f"; the {MOST_PAIRS} of {len(pairs)} pairs that stand out most" if len(pairs) > MOST_PAIRS else ""
    curves = []
    for index, pair in enumerate(order):
        tau, value, low, high = (table[name][pairs[pair]] for name in ("tau", "correlation", "low", "high"))
        name = " · ".join(pair)
        shown = index < PAIRS_SHOWN
        curves.append(Curve(name, name, tau, value, low, high, colour=index, points=True, visible=shown))
    return curve_plot(
        PlotFrame(
            f"cross-allan-{array.anchor}",
            "Allan covariance of pairs of gyros over their deviations",
            Axis("averaging time τ, s", "log"),
            Axis("Allan correlation"),
            summary=f"bars: limits; what two gyros share no average of them takes away{some}",
            height=300,
        ),
        curves,
        PlotMarks(levels=(0.0,)),
    )


def _apart(table: Table, mask: np.ndarray) -> float:
    """Greatest distance from 0 that the limits of a pair leave; negative where all of them hold 0."""
    distances = np.maximum(table["low"][mask], -table["high"][mask])
    return float(np.nanmax(np.append(distances, -1.0)))


def _curves(array: ArrayPart, table: Table, pick: Callable[[np.ndarray], Curve], points: bool) -> list[Curve]:
    series = table["series"]
    present = set(series.tolist())
    curves = []
    for index, name in enumerate(array.gyros):
        if name in present:
            picked = pick(series == name)
            look = replace(picked, name=name, label=name, colour=index, width=1, points=points, group=GYROS)
            curves.append(look)
    shown = _shown(array)
    for index, (column, label) in enumerate(method_labels(array).items()):
        if column in present:
            picked = replace(pick(series == column), name=column, label=label, group=METHODS, visible=column in shown)
            ink = column == "average"
            curves.append(replace(picked, ink=ink, colour=0 if ink else index, width=2.4))
    # Of some forty names those that are drawn come first.
    return sorted(curves, key=lambda curve: (curve.group != GYROS, not curve.visible))


def method_labels(array: ArrayPart) -> dict[str, str]:
    """Column of fused.parquet → name for people, of the methods that ran."""
    labels = {}
    for row in array.methods():
        if row["column"]:
            labels[row["column"]] = f"{row['title']} ({row['definition']})" if row["definition"] else row["title"]
    return labels


def _shown(array: ArrayPart) -> set[str]:
    """Columns of the main methods; of one with several definitions the last, which is the one for motion too."""
    found = {}
    for row in array.methods():
        if row["method"] in SHOWN and row["column"]:
            found[row["method"]] = row["column"]
    return set(found.values())

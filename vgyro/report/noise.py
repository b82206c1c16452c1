"""Allan curves and spectra of every gyro and method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from markupsafe import Markup

from vgyro.report.envelope import logarithmic
from vgyro.report.html import paragraph
from vgyro.report.model import ArrayPart, Table
from vgyro.report.plots import Axis, Curve, curve_plot

# What a first look needs; the rest is one click away.
SHOWN = ("average", "inverse_variance_arw", "jiang_random_walk", "dcc_causal")
SPECTRUM_POINTS = 700
GYROS, METHODS = "single gyros", "methods (faded ones are hidden: click to show them)"


def allan_plot(array: ArrayPart) -> Markup:
    """Overlapping Allan deviation with 95 % limits of every series."""
    table = array.tables.get("allan")
    if table is None or not len(table["tau"]):
        return paragraph("No Allan deviation: the recording holds too little data at rest.", "note")

    def pick(mask: np.ndarray) -> Curve:
        tau, deviation, low, high = (table[name][mask] for name in ("tau", "deviation", "low", "high"))
        return Curve("", "", tau, deviation, low, high)

    return curve_plot(
        f"allan-{array.anchor}",
        "Overlapping Allan deviation",
        _curves(array, table, pick, points=True),
        Axis("averaging time τ, s", "log"),
        Axis("Allan deviation σ, deg/s", "log"),
        summary="bars: 95 % limits by chi²; 3600·σ is in deg/h, 60·σ(1 s) is the ARW read at 1 s in deg/√h",
        height=460,
    )


def spectrum_plot(array: ArrayPart) -> Markup:
    """One-sided Welch density of every series."""
    table = array.tables.get("spectrum")
    if table is None or not len(table["frequency"]):
        return paragraph("No spectrum: the recording holds too little data at rest.", "note")

    def pick(mask: np.ndarray) -> Curve:
        frequency, density = logarithmic(table["frequency"][mask], table["density"][mask], SPECTRUM_POINTS)
        return Curve("", "", frequency, np.where(density > 0, density, np.nan))

    return curve_plot(
        f"spectrum-{array.anchor}",
        "Noise spectrum, ONE-sided",
        _curves(array, table, pick, points=False),
        Axis("frequency, Hz", "log"),
        Axis("amplitude density, one-sided, deg/s/√Hz", "log"),
        summary="the two-sided density, which N and the papers use, is smaller by √2",
        height=400,
    )


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
    return curves


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

"""Plots of a calibration: residuals of the straight line, and what the temperature does to bias and scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, get_args

import numpy as np
from markupsafe import Markup

from vgyro.report.html import details, join
from vgyro.report.model import Record
from vgyro.report.plots import Axis, Curve, Marker, PlotFrame, PlotMarks, curve_plot

NAN = float("nan")
MOST_SHOWN = 2  # six loops over each other show nothing
TABLE_RATE = Axis("rate of the table, deg/s")
# direction of the point → words, mark
DIRECTIONS: dict[str, tuple[str, Marker]] = {
    "up": ("▲ rates rising", "triangle"),
    "down": ("▼ rates falling", "inverted_triangle"),
    "none": ("direction unknown", get_args(Marker)[0]),
}
CURVE_POINTS = 60


def certificate_plots(axis: str, gyros: Mapping[str, Record]) -> Markup:
    """Residuals, temperature, and the fit itself one click away."""
    fit = details("Output over the rate of the table (Liu et al. 2015, fig. 2)", _fit(axis, gyros))
    return join(_residuals(axis, gyros), _bias_plot(axis, gyros), _scale_plot(axis, gyros), fit)


def _column(points: Sequence[Record], key: str) -> np.ndarray:
    return np.array([NAN if point.get(key) is None else float(point[key]) for point in points])


def _residuals(axis: str, gyros: Mapping[str, Record]) -> Markup:
    curves = []
    for index, (name, record) in enumerate(gyros.items()):
        for direction, (words, marker) in DIRECTIONS.items():
            points = [point for point in record["points"] if (point.get("direction") or "none") == direction]
            if not points:
                continue
            points.sort(key=lambda point: float(point["rate"]))
            rate, residual, error = (_column(points, key) for key in ("rate", "residual_deg_s", "standard_error_deg_s"))
            curves.append(
                Curve(
                    f"{name} {direction}", name, rate, residual, residual - error, residual + error, colour=index,
                    width=0.7, points=True, line=direction != "none", marker=marker, group=words,
                    visible=index < MOST_SHOWN,
                )
            )  # fmt: skip
    curves.sort(key=lambda curve: list(DIRECTIONS).index(curve.name.rsplit(" ", 1)[1]))
    title, summary = (
        "Residuals of the straight line",
        "bars: one standard error of the mean; faded gyros are hidden: click to show them",
    )
    y = Axis("output − line, deg/s")
    return curve_plot(
        PlotFrame(f"scale-residuals-{axis}", title, TABLE_RATE, y, summary=summary, height=300),
        curves,
        PlotMarks(levels=(0.0,)),
    )


def _fit(axis: str, gyros: Mapping[str, Record]) -> Markup:
    curves = []
    for index, (name, record) in enumerate(gyros.items()):
        points = sorted(record["points"], key=lambda point: float(point["rate"]))
        rate, mean = (_column(points, key) for key in ("rate", "mean_count"))
        curves.append(Curve(name, name, rate, mean, colour=index, points=True))
    y = Axis("mean output, counts")
    return curve_plot(PlotFrame(f"scale-factor-{axis}", "Mean output at each rate", TABLE_RATE, y, height=300), curves)


class _WarmGyro(NamedTuple):
    """Place, name, record and temperature record of a gyro."""

    place: int
    name: str
    record: Record
    temperature: Record


def _with_temperature(gyros: Mapping[str, Record]) -> list[_WarmGyro]:
    """The gyros that have a temperature record."""
    return [
        _WarmGyro(index, name, record, record["temperature"])
        for index, (name, record) in enumerate(gyros.items())
        if record.get("temperature")
    ]


def _bias_plot(axis: str, gyros: Mapping[str, Record]) -> Markup:
    """Bias against temperature, in deg/s from that at the reference temperature, and its polynomial."""
    curves = []
    for index, name, record, about in _with_temperature(gyros):
        reference, scale = float(about["reference_c"]), float(record["scale"])
        polynomial = np.polynomial.Polynomial(np.array([0.0, *about["bias"][1:]]) * scale)
        at = np.linspace(float(about["low_c"]), float(about["high_c"]), CURVE_POINTS)
        curves.append(
            Curve(f"{name} polynomial", name, at, polynomial(at - reference), colour=index, group="polynomial")
        )
        points = sorted(about["points"], key=lambda point: float(point["temperature_c"]))
        if points:
            temperature, bias = (_column(points, key) for key in ("temperature_c", "bias"))
            moved = (bias - float(about["bias"][0])) * scale
            curves.append(
                Curve(name, name, temperature, moved, colour=index, points=True, line=False, group="measured")
            )
    if not curves:
        return Markup("")
    title, y = "Bias against temperature", Axis("less that at the reference, deg/s")
    summary = "the curve is laid through the line's bias; points beside it: bend of the line, other power cycles"
    return curve_plot(
        PlotFrame(f"bias-temperature-{axis}", title, Axis("temperature, °C"), y, summary=summary, height=260),
        curves,
        PlotMarks(levels=(0.0,)),
    )


def _scale_plot(axis: str, gyros: Mapping[str, Record]) -> Markup:
    """Scale factor against temperature: the slope with its limits."""
    curves = []
    for index, name, record, about in _with_temperature(gyros):
        slope = (record.get("figures") or {}).get("scale_temperature") or {}
        if slope.get("state") != "value":
            continue
        at = np.linspace(float(about["low_c"]), float(about["high_c"]), 9)
        change = at - float(about["reference_c"])
        value, low, high = (NAN if slope.get(key) is None else float(slope[key]) for key in ("value", "low", "high"))
        ends = np.sort(np.stack([low * change, high * change]), axis=0)
        curves.append(Curve(name, name, at, value * change, ends[0], ends[1], colour=index))
    if not curves:
        return Markup("")
    title, summary = "Scale factor against temperature", "bars: limits of the slope"
    y = Axis("change, ppm")
    return curve_plot(
        PlotFrame(f"scale-temperature-{axis}", title, Axis("temperature, °C"), y, summary=summary, height=260),
        curves,
        PlotMarks(levels=(0.0,)),
    )

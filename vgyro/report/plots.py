"""Interactive plots: curves with intervals, marked stretches, on linear or logarithmic axes.

A plot is Bokeh's JSON inside the page; it is drawn when it comes into sight. Model ids are numbered by the plot's own
name, so that a page is the same from run to run.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from markupsafe import Markup

from vgyro.report.colours import ACCENT, GRID, INK, MUTED, PAPER, marks, series_dash, series_mark
from vgyro.report.html import macro

if TYPE_CHECKING:
    from bokeh.plotting import figure

Scale = Literal["linear", "log"]
Marker = Literal["circle", "triangle", "inverted_triangle"]
SVG_DASHES = {"solid": "", "dashed": "6 3", "dotted": "2 3", "dotdash": "2 3 6 3"}


@dataclass(frozen=True)
class Curve:
    """One series of a plot.

    name  : unique in the plot;  label : what the legend says;  x, y : arrays [T]; NaN breaks the line
    low, high : interval at each point, drawn as a thin bar;  colour : number in the palette, dashes follow from it
    width : px;  line, points : whether the points are joined, whether each is marked, and how
    visible : shown from the start
    group : heading in the legend;  ink : the colour of text, for the curve that the others are held against
    behind : a curve with more of it is drawn first, so that a wide one does not hide the others
    """

    name: str
    label: str
    x: np.ndarray
    y: np.ndarray
    low: np.ndarray | None = None
    high: np.ndarray | None = None
    colour: int = 0
    ink: bool = False
    width: float = 1.5
    points: bool = False
    line: bool = True
    visible: bool = True
    group: str = ""
    behind: float = 0.0
    marker: Marker = "circle"


@dataclass(frozen=True)
class Bars:
    """Rectangles of one kind. name : unique in the plot, also in the legend;  colour : a mark of vgyro.report.colours

    left, right, bottom, top : arrays [R];  hover : title → values [R] that the pointer shows
    """

    name: str
    colour: str
    left: np.ndarray
    right: np.ndarray
    bottom: np.ndarray
    top: np.ndarray
    hover: Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Axis:
    """An axis: what it shows with its unit, and its scale."""

    label: str
    scale: Scale = "linear"


@dataclass(frozen=True)
class PlotFrame:
    """What stands about the curves of a plot.

    identifier : anchor, unique in the page;  summary : small print beside the title
    height     : px; the width is that of the page
    """

    identifier: str
    title: str
    x: Axis
    y: Axis
    summary: str = ""
    height: int = 300


@dataclass(frozen=True)
class PlotMarks:
    """What is drawn behind the curves.

    spans : stretches [start, stop] of x with a tinted ground;  levels, lines : horizontal and vertical lines
    """

    spans: Sequence[tuple[float, float]] = ()
    levels: Sequence[float] = ()
    lines: Sequence[float] = ()


def curve_plot(frame: PlotFrame, curves: Sequence[Curve], marks: PlotMarks | None = None) -> Markup:
    """A plot of curves, with a legend whose entries show and hide them."""
    marks, x, y = marks or PlotMarks(), frame.x, frame.y
    plot = _empty(x, y, frame.height)
    _mark_spans(plot, marks.spans)
    _mark_lines(plot, marks.levels, "width")
    _mark_lines(plot, marks.lines, "height")
    sources = _sources(curves)
    order = sorted(range(len(curves)), key=lambda index: -curves[index].behind)
    drawn = [_draw(plot, curves[index], sources[index]) for index in order]
    _add_hover(plot, [one for one in drawn if one is not None], x, y)
    item = {"json": _escaped(_as_json(plot, frame.identifier)), "height": frame.height}
    legend = _legend(curves) if len(curves) > 1 else ()
    return macro(
        "plot", identifier=frame.identifier, title=frame.title, summary=frame.summary, item=item, legend=legend
    )


def bar_plot(
    identifier: str, title: str, bars: Sequence[Bars], x: Axis, ticks: Sequence[tuple[float, str]], *, height: int = 300
) -> Markup:
    """A plot of rectangles in rows, with a legend whose entries show and hide a kind.

    ticks : (height, name) of each row; the rest as for curve_plot
    """
    from bokeh.models import FixedTicker

    plot = _empty(x, Axis(""), height)
    plot.ygrid.grid_line_color = None
    plot.yaxis.ticker = FixedTicker(ticks=[place for place, _ in ticks])
    plot.yaxis.major_label_overrides = dict(ticks)
    drawn = [_draw_bars(plot, kind) for kind in bars]
    for kind, renderer in zip(bars, drawn, strict=True):
        _hover_over_bars(plot, kind, renderer)
    item = {"json": _escaped(_as_json(plot, identifier)), "height": height}
    entries = tuple(
        {
            "name": kind.name,
            "label": kind.name,
            "visible": True,
            "variable": marks()[kind.colour],
            "width": 8,
            "dashes": "",
        }
        for kind in bars
    )
    return macro("plot", identifier=identifier, title=title, summary="", item=item, legend=(("", entries),))


def _draw_bars(plot: figure, bars: Bars) -> Any:
    from bokeh.models import ColumnDataSource, Quad

    sides = {side: _single(getattr(bars, side)) for side in ("left", "right", "bottom", "top")}
    source = ColumnDataSource({**sides, **{title: _told(values) for title, values in bars.hover.items()}})
    return plot.add_glyph(
        source, Quad(**{side: side for side in sides}, fill_color=bars.colour, line_color=None), name=bars.name
    )


def _told(values: np.ndarray) -> Any:
    return values.tolist() if values.dtype == object else _single(values)


def _hover_over_bars(plot: figure, bars: Bars, renderer: Any) -> None:
    from bokeh.models import HoverTool

    tooltips = [("", bars.name), *((title, f"@{{{title}}}") for title in bars.hover)]
    plot.add_tools(HoverTool(renderers=[renderer], tooltips=tooltips, visible=False))


def _empty(x: Axis, y: Axis, height: int) -> figure:
    from bokeh.models import BasicTickFormatter
    from bokeh.plotting import figure

    plot = figure(
        height=height,
        sizing_mode="stretch_width",
        x_axis_type=x.scale,
        y_axis_type=y.scale,
        x_axis_label=x.label,
        y_axis_label=y.label,
        tools="pan,box_zoom,wheel_zoom,reset,save",
        active_drag="box_zoom",
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=GRID,
        min_border_right=12,
    )
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    for ranged in (plot.x_range, plot.y_range):
        ranged.only_visible = True
    for axis in plot.axis:
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size = "12px"
        axis.major_label_text_font_size = "11px"
        axis.axis_label_text_color = axis.major_label_text_color = MUTED
        axis.axis_line_color = axis.major_tick_line_color = MUTED
        axis.minor_tick_line_color = None
        if isinstance(axis.formatter, BasicTickFormatter):
            axis.formatter.power_limit_low, axis.formatter.power_limit_high = -5, 6
    for grid in plot.grid:
        grid.grid_line_color = GRID
    return plot


def _mark_spans(plot: figure, spans: Sequence[tuple[float, float]]) -> None:
    from bokeh.models import BoxAnnotation

    for start, stop in spans:
        plot.add_layout(
            BoxAnnotation(left=start, right=stop, fill_color=ACCENT, fill_alpha=0.08, line_color=None, level="underlay")
        )


def _mark_lines(plot: figure, places: Sequence[float], dimension: Literal["width", "height"]) -> None:
    from bokeh.models import Span

    for place in places:
        plot.add_layout(
            Span(location=place, dimension=dimension, line_color=MUTED, line_dash="dashed", level="underlay")
        )


def _sources(curves: Sequence[Curve]) -> list[Any]:
    """Data sources; curves over the same x array share one, so that x is stored once."""
    from bokeh.models import ColumnDataSource

    groups: dict[int, dict[str, np.ndarray]] = {}
    for curve in curves:
        data = groups.setdefault(id(curve.x), {"x": _single(curve.x)})
        data[curve.name] = _single(curve.y)
        if curve.low is not None and curve.high is not None:
            data[f"{curve.name} low"], data[f"{curve.name} high"] = _single(curve.low), _single(curve.high)
    made = {key: ColumnDataSource(data) for key, data in groups.items()}
    return [made[id(curve.x)] for curve in curves]


def _single(values: np.ndarray) -> np.ndarray:
    """Seven digits are more than a screen shows, at half the bytes."""
    return np.ascontiguousarray(values, dtype=np.float32)


def _draw(plot: figure, curve: Curve, source: Any) -> Any:
    """Bars, line and marks of a curve. returns : what answers to the pointer, None if there is neither line nor mark

    Bare glyphs: plot.line() and its like make three more of each, for selections that no plot here has.
    """
    from bokeh.models import Line, Scatter, Segment

    colour = INK if curve.ink else series_mark(curve.colour)
    common = {"name": curve.name, "visible": curve.visible}
    if curve.low is not None and curve.high is not None:
        ends = {"y0": f"{curve.name} low", "y1": f"{curve.name} high"}
        plot.add_glyph(source, Segment(x0="x", x1="x", **ends, line_color=colour, line_alpha=0.6), **common)
    drawn = []
    if curve.line:
        dash = series_dash(curve.colour)
        line = Line(x="x", y=curve.name, line_color=colour, line_width=curve.width, line_dash=dash)
        drawn.append(plot.add_glyph(source, line, **common))
    if curve.points:
        size = 4 if curve.marker == "circle" else 7
        mark = Scatter(x="x", y=curve.name, size=size, marker=curve.marker, line_color=colour, fill_color=PAPER)
        drawn.append(plot.add_glyph(source, mark, **common))
    return drawn[0] if drawn else None


def _add_hover(plot: figure, renderers: list[Any], x: Axis, y: Axis) -> None:
    from bokeh.models import HoverTool

    tooltips = [("", "$name"), (x.label, "@x{%.5g}"), (y.label, "@$name{%.4g}")]
    plot.add_tools(
        HoverTool(renderers=renderers, tooltips=tooltips, formatters={"@x": "printf", "@$name": "printf"}, mode="mouse")
    )


def _as_json(plot: figure, identifier: str) -> str:
    """Bokeh's JSON of a plot, with ids that depend on the plot's name alone.

    What bokeh.embed.json_item returns, without its checks of the plot, which take as long as the rest.
    """
    import bokeh
    from bokeh.core.serialization import Serializer
    from bokeh.document import Document

    found = Document(title=identifier).to_json(deferred=False)
    found["roots"] = Serializer(deferred=False).encode([plot])
    root = found["roots"][0]["id"]
    record = {"target_id": f"{identifier}-canvas", "root_id": root, "doc": found, "version": bokeh.__version__}
    names: dict[str, str] = {}
    _collect_ids(found, names, identifier)
    return json.dumps(_renamed(record, names), separators=(",", ":"), ensure_ascii=False)


def _collect_ids(node: Any, names: dict[str, str], prefix: str) -> None:
    if isinstance(node, dict):
        if isinstance(node.get("id"), str):
            names.setdefault(node["id"], f"{prefix}.{len(names)}")
        for value in node.values():
            _collect_ids(value, names, prefix)
    elif isinstance(node, list):
        for value in node:
            _collect_ids(value, names, prefix)


def _renamed(node: Any, names: dict[str, str]) -> Any:
    if isinstance(node, dict):
        return {
            key: names[value] if key in {"id", "root_id"} and value in names else _renamed(value, names)
            for key, value in node.items()
        }
    if isinstance(node, list):
        return [_renamed(value, names) for value in node]
    return node


def _escaped(text: str) -> Markup:
    """JSON that cannot end its script element."""
    return Markup(text.replace("<", "\\u003c"))


def _legend(curves: Sequence[Curve]) -> tuple[tuple[str, tuple[dict[str, Any], ...]], ...]:
    """Entries of the legend, group by group."""
    variables = marks()
    groups: dict[str, list[dict[str, Any]]] = {}
    for curve in curves:
        entry = {
            "name": curve.name,
            "label": curve.label,
            "visible": curve.visible,
            "variable": "ink" if curve.ink else variables[series_mark(curve.colour)],
            "width": curve.width,
            "dashes": SVG_DASHES[series_dash(curve.colour)],
        }
        groups.setdefault(curve.group, []).append(entry)
    return tuple((group, tuple(entries)) for group, entries in groups.items())

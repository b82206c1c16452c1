"""The figures of the papers again: Allan deviations of the static test, and L's weights over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from vgyro.report import html
from vgyro.report.plots import Axis, Curve, PlotFrame, PlotMarks, curve_plot
from vgyro.storage.tables import read_columns

OWN = {"recommended": "recommended (vgyro)", "recommended_unsmoothed": "recommended, not smoothed (vgyro)"}
# Column of the Allan table → label; the papers' own figures show these, but for ours.
SERIES: dict[str, dict[str, str]] = {
    "jiang2012": {
        "average": "simple average",
        "jiang_random_walk": "random walk",
        "jiang_markov": "first-order Markov",
        **OWN,
    },
    "liu2015": {
        "average": "simple average",
        "jiang_markov": "Kalman filter [11]",
        "dcc_in_sample[level]": "DCC",
        **OWN,
    },
}
WEIGHTS_OF = ("level", "dcc", "in_sample")
STATIC = "static"


def figures(paper: str, gyros: Sequence[str], artefacts: Sequence[Path]) -> Markup:
    """Plots from the artefacts that are there; empty if there are none."""
    plots = [
        _allan(path, gyros, SERIES[paper]) for path in artefacts if path.stem == "allan" and path.parts[-3] == STATIC
    ]
    if paper == "liu2015":
        plots += [
            _weights(path)
            for path in artefacts
            if path.stem == "weights" and path.parts[-2] == WEIGHTS_OF[0] and path.parts[-4] == STATIC
        ]
    return html.join(*plots)


def _allan(path: Path, gyros: Sequence[str], labels: dict[str, str]) -> Markup:
    table = read_columns(path)
    methods = [name for name in labels if name in table["series"]]
    curves = []
    # The virtual gyroscopes are drawn last, over the single ones.
    for index, name in enumerate([*gyros, *methods]):
        rows = (table["series"] == name) & (table["kind"] == "overlapping")
        tau, y, low, high = (table[column][rows] for column in ("tau", "deviation", "low", "high"))
        virtual = name in labels
        curves.append(
            Curve(
                str(name), labels.get(name, str(name)), tau, y, low if virtual else None, high if virtual else None,
                colour=index, width=2.0 if virtual else 1.0, group="virtual" if virtual else "single",
            )
        )  # fmt: skip
    return curve_plot(
        PlotFrame(
            "allan",
            "Allan deviation at rest",
            Axis("averaging time, s", "log"),
            Axis("deviation, deg/s", "log"),
            summary="at the full rate; overlapping, bars are 95 % limits",
            height=380,
        ),
        curves,
    )


def _weights(path: Path) -> Markup:
    table = read_columns(path)
    chosen = (table["model"] == WEIGHTS_OF[1]) & (table["mode"] == WEIGHTS_OF[2])
    time = table["time"][chosen]
    names = [name for name in table if name.startswith("w_")]
    curves = [
        Curve(
            name, name.removeprefix("w_"), time, np.asarray(table[name][chosen], dtype=float), colour=index, width=1.0
        )
        for index, name in enumerate(names)
    ]
    return curve_plot(
        PlotFrame(
            "weights",
            "Weights of the gyroscopes",
            Axis("time, s"),
            Axis("weight"),
            summary="DCC, in sample, on the level, as the paper's figure 7",
        ),
        curves,
        PlotMarks(levels=(1.0 / max(len(names), 1),)),
    )

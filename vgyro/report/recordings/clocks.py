"""The clocks of logs: what their stamps are, how even, and how several were brought to one time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from vgyro.report.html import details
from vgyro.report.model import RecordingPart
from vgyro.report.numbers import MISSING, plain, significant, with_interval
from vgyro.report.tables import Cell, Notes, TableColumn, render_table

COLUMNS = (
    TableColumn("stream", numeric=False),
    TableColumn("stamps", numeric=False, hint="sampled: the sensor's time; arrival: the receiver's; none: by the rate"),
    TableColumn("rate", "Hz", hint="± one standard deviation"),
    TableColumn("drift", "ppm", hint="largest less smallest rate of eight parts of the recording"),
    TableColumn("jitter", "ms", hint="r.m.s. distance of the stamps from even ones"),
    TableColumn(
        "unevenness", "%", hint="standard deviation of the steps over their mean, where the samples are not even"
    ),
    TableColumn("wraps"),
    TableColumn("restarts"),
    TableColumn("repeated", hint="rows dropped, for stamp and values are those of the row before"),
    TableColumn("rows a reading", hint="above 1: the logger was faster than the sensor; each reading is kept once"),
)
ALIGNED = (
    TableColumn("offset", "s", group="against the first", hint="of its first sample; 95 % interval below"),
    TableColumn("drift", "ppm", group="against the first", hint="95 % interval below"),
    TableColumn("by", numeric=False, group="against the first"),
    TableColumn(
        "noise left", group="against the first", hint="share of the variance of white noise after interpolation"
    ),
)


def clocks_part(recording: RecordingPart) -> Markup:
    """Table of the clocks of a recording's logs; empty for dumps."""
    clocks: Sequence[Mapping[str, Any]] = recording.integrity["clocks"]
    if not clocks:
        return Markup("")
    aligned = any(clock["alignment"] for clock in clocks)
    notes = Notes()
    rows = [[*_row(clock, notes), *(_alignment(clock["alignment"]) if aligned else ())] for clock in clocks]
    table = render_table((*COLUMNS, *(ALIGNED if aligned else ())), rows, notes=notes.texts)
    return details(f"Clock{'s' * (len(clocks) != 1)} of {recording.name}", table)


def _row(clock: Mapping[str, Any], notes: Notes) -> list[Cell]:
    rate, spread = float(clock["rate_hz"]), clock["rate_sd_hz"]
    return [
        Cell(str(clock["stream"]), ", ".join(clock["channels"])),
        Cell(str(clock["meaning"]), notes=notes.number(str(clock["why"]))),
        Cell(plain(rate), "" if spread is None else f"± {significant(float(spread), 2)}"),
        Cell(_number(clock["drift_ppm"], 1.0)),
        Cell(_number(clock["jitter_s"], 1e3)),
        Cell(_number(clock["uneven"] or None, 100.0)),
        Cell(str(clock["wraps"] + clock["midnights"])),
        Cell(str(clock["restarts"])),
        Cell(str(clock["repeated"])),
        Cell(plain(float(clock["held"]), 3)),
    ]


def _alignment(found: Mapping[str, Any]) -> list[Cell]:
    if not found:
        return [Cell(MISSING), Cell(MISSING), Cell("the first"), Cell(MISSING)]
    nothing = math.nan
    offset = with_interval(found["offset_s"], found.get("offset_low_s", nothing), found.get("offset_high_s", nothing))
    drift = with_interval(
        found.get("drift_ppm", nothing), found.get("drift_low_ppm", nothing), found.get("drift_high_ppm", nothing)
    )
    return [Cell(*offset), Cell(*drift), Cell(str(found["by"])), Cell(plain(float(found["noise_gain"]), 3))]


def _number(value: float | None, factor: float) -> str:
    return MISSING if value is None else significant(factor * float(value))

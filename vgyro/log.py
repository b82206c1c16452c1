"""How a log is to be read: the part `log:` of a recording, and gyros that a manifest names without a board file."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, model_validator

from vgyro.board import Board, Gyro, Temperature
from vgyro.units import deg_from_rad, deg_s, deg_s_from_mdps
from vgyro.validation import StrictModel

Family = Literal["text", "parquet", "ulog", "bag", "numpy", "matlab"]
RateUnit = Literal["deg/s", "rad/s", "mdps", "deg/h"]
TimeUnit = Literal["auto", "s", "ms", "us", "ns", "min"]
Meaning = Literal["auto", "sampled", "arrival"]
Values = Literal["counts", "rates"]

NAME = r"^[A-Za-z_][A-Za-z0-9_]*$"


class TextForm(StrictModel):
    """Form of a text log. What is null is found from its lines."""

    encoding: Literal["utf-8", "utf-16", "latin-1"] | None = Field(None, description="null: found")
    delimiter: str | None = Field(None, min_length=1, description='between columns; " ": any blanks; null: found')
    decimal: Literal[".", ","] | None = Field(None, description="sign before the decimals; null: found")
    header: bool | None = Field(None, description="is the first line one of names? null: found")
    names: tuple[str, ...] = Field((), description="names of the columns of a log without header; empty: c1, c2, …")
    skip: int = Field(0, ge=0, description="lines before the header or the first row that are not read")


class Place(StrictModel):
    """A column of a log, where its name alone does not tell it."""

    column: str = Field(description="name of the column")
    table: str | None = Field(None, description="topic, variable or kind of line; null: that of `log`")
    file: str | None = Field(None, description="the one of `files` that holds it, by name or pattern; null: every file")
    where: dict[str, int | float | str] = Field(
        default={}, description="rows that belong to it: the value of an id column, such as {id: 2}"
    )


class LogTime(StrictModel):
    """The column of time stamps, and what they are."""

    column: str = Field(description="name of the column")
    unit: TimeUnit = Field("auto", description="of a column of numbers; auto: from its name and values")
    meaning: Meaning = Field(
        "auto", description="sampled: the sensor's time; arrival: the receiver's, never earlier than the sample"
    )
    wrap: float | None = Field(None, gt=0, description="stamps wrap at so many of their units; null: found")


class Log(StrictModel):
    """A log instead of dumps: any table with columns. `columns` maps channels or gyros to the log's columns."""

    family: Family | None = Field(None, description="kind of file; null: by its content")
    table: str | None = Field(None, description="topic, variable or kind of line; null: the only one with the columns")
    text: TextForm = Field(TextForm(), description="form of a text; what is left out is found")
    columns: dict[str, str | Place] = Field(default={}, description="channel or gyro: column of the log")
    values: Values = Field("counts", description="of a board's columns; rates: deg/s already, not calibrated again")
    time: str | LogTime | None = Field(None, description="column of the time stamps; null: row number / rate_hz")
    clocks: Literal["auto", "one", "own"] = Field(
        "auto", description="of several files, tables or ids: one clock for all, or one each; auto: by the stamps"
    )

    @property
    def stamp(self) -> LogTime | None:
        """The column of time stamps; None where there is none."""
        return LogTime(column=self.time) if isinstance(self.time, str) else self.time

    def place(self, channel: str) -> Place | None:
        """Where a channel stands; None where the manifest does not say."""
        given = self.columns.get(channel)
        return Place(column=given) if isinstance(given, str) else given


class LogGyro(StrictModel):
    """A gyro of a log, without a board file: rate = sign · value in `unit`, or sign · (count - bias) · scale."""

    name: str = Field(pattern=NAME, description="the gyro's name")
    column: str | None = Field(None, description="column of the log; null: that of its name, or as `log.columns` says")
    axis: str = Field(pattern=r"^[A-Za-z0-9_]+$", description="axis of the board; gyros that share it are an array")
    sign: Literal[1, -1] = Field(1, description="-1: mounted the other way round")
    unit: RateUnit | None = Field(None, description="of the column; null: counts, with `scale`")
    scale: float | None = Field(None, gt=0, description="nominal scale, deg/s a count; null: the column has a `unit`")
    bias: float = Field(0.0, description="nominal zero-rate output, counts")
    range_deg_s: float | None = Field(None, gt=0, description="measuring range, deg/s")
    lowpass_hz: float | None = Field(None, gt=0, description="its own first-order low-pass, -3 dB, Hz; null: unknown")

    @model_validator(mode="after")
    def _unit_or_scale(self) -> LogGyro:
        if (self.unit is None) == (self.scale is None):
            raise ValueError(
                f"gyro {self.name!r} needs `unit` (deg/s, rad/s, mdps, deg/h) or, for counts, `scale` (deg/s a count)"
            )
        if self.unit is not None and self.bias:
            raise ValueError(f"gyro {self.name!r}: `bias` is in counts; a column with a `unit` takes none")
        return self


class LogTemperature(StrictModel):
    """A thermometer of a log: °C = value · scale + offset."""

    name: str = Field(pattern=NAME, description="the sensor's name")
    column: str | None = Field(None, description="column of the log; null: that of its name, or as `log.columns` says")
    gyro: str | None = Field(None, description="the gyro it sits in; null: the board")
    scale: float = Field(1.0, description="°C a unit of the column")
    offset: float = Field(0.0, description="°C at zero")


TO_DEG_S: dict[RateUnit, float] = {
    "deg/s": 1.0,
    "rad/s": deg_from_rad(1.0),
    "mdps": deg_s_from_mdps(1.0),
    "deg/h": deg_s(1.0),
}
"""deg/s a unit."""


class LogArray(StrictModel):
    """The gyros and thermometers of a log that no board file describes."""

    gyros: tuple[LogGyro, ...] = Field(min_length=1, description="the gyros to analyse")
    temperatures: tuple[LogTemperature, ...] = Field((), description="the thermometers")

    @property
    def columns(self) -> dict[str, str]:
        """Channel → column, as far as the array itself says."""
        named = {gyro.name: gyro.column or gyro.name for gyro in self.gyros}
        return named | {thermometer(one.name): one.column or one.name for one in self.temperatures}

    @property
    def rates(self) -> bool:
        """Do all gyros give a rate in a unit, and none counts?"""
        return all(gyro.unit is not None for gyro in self.gyros)


def thermometer(name: str) -> str:
    """Channel of a thermometer of a log."""
    return f"temp_{name}"


def board_of_log(array: LogArray, name: str, title: str) -> Board:
    """The board that the gyros of a manifest make: no frame, a channel a gyro or thermometer, by its name.

    A gyro with a unit has the scale 1: its column is converted to deg/s when it is read.
    """
    made: dict[str, Any] = {
        "name": name,
        "title": title,
        "gyros": tuple(
            Gyro(
                name=one.name, field=one.name, axis=one.axis, sign=one.sign, bias=one.bias, range_deg_s=one.range_deg_s,
                lowpass_hz=one.lowpass_hz,
                scale=one.scale or 1.0,
            )
            for one in array.gyros
        ),
        "temperatures": tuple(
            Temperature(name=one.name, field=thermometer(one.name), gyro=one.gyro, scale=one.scale, offset=one.offset)
            for one in array.temperatures
        ),
    }  # fmt: skip
    return Board(**made)

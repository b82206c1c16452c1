"""raw/<dataset>/dataset.yaml as a validated model: recordings of a board, and what is known of the true rate."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from vgyro.board import Board
from vgyro.config import PARTIAL, Analysis
from vgyro.log import Log, LogArray, Values, board_of_log
from vgyro.validation import Problem, StrictModel, did_you_mean, parse_model

Kind = Literal["calibration", "static", "constant", "random", "sinusoid", "thermal", "free"]
# results/<dataset>/noise/ holds the noise of each array.
RESERVED = ("noise",)
AT_REST: tuple[Kind, ...] = ("static", "thermal")


class Plateau(StrictModel):
    """The table turned at `rate` deg/s from `start` to `stop`, s after the first frame; settling already left out."""

    start: float = Field(ge=0, description="begin, s")
    stop: float = Field(description="end, s")
    rate: float = Field(description="true rate, deg/s; positive about the axis")

    @model_validator(mode="after")
    def _forward(self) -> Plateau:
        if self.stop <= self.start:
            raise ValueError(f"stop = {self.stop} s is not after start = {self.start} s")
        return self


class PlateauReference(StrictModel):
    """Stretches of constant, known rate, as a rate table makes them."""

    kind: Literal["plateaus"] = Field(description="plateaus")
    plateaus: tuple[Plateau, ...] = Field(min_length=2, description="at least two, of different rates")


class ConstantReference(StrictModel):
    """One rate throughout."""

    kind: Literal["constant"] = Field(description="constant")
    rate: float = Field(description="deg/s")


class SinusoidReference(StrictModel):
    """rate = amplitude · sin(2π·frequency·t + phase); a null phase is fitted to the mean of the array."""

    kind: Literal["sinusoid"] = Field(description="sinusoid")
    amplitude: float = Field(gt=0, description="deg/s")
    frequency_hz: float = Field(gt=0, description="Hz")
    phase_rad: float | None = Field(None, description="at the first frame, rad; null: fitted")


class FileReference(StrictModel):
    """A logged rate: Parquet or CSV with a time column (s, the recording's clock) and a rate column (deg/s)."""

    kind: Literal["file"] = Field(description="file")
    file: str = Field(description="Parquet or CSV, in `folder`")
    time: str = Field("time", description="column with the time, s after the first frame")
    rate: str = Field("rate", description="column with the true rate, deg/s")


Reference = Annotated[
    PlateauReference | ConstantReference | SinusoidReference | FileReference, Field(discriminator="kind")
]


class Recording(StrictModel):
    """One run of the board."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", description="letters, digits, - and _")
    kind: Kind = Field(description="what the board did")
    files: tuple[str, ...] = Field(min_length=1, description="dumps or logs in order; globs and folders of logs too")
    log: Log | None = Field(None, description="set: the files are logs, tables with columns; null: dumps of the board")
    rate_hz: float | None = Field(None, gt=0, description="null: by the stamps, or the board's")
    rest: tuple[tuple[float, float], ...] | Literal["auto"] = Field(
        "auto", description="known standstill, [start, stop] in s; auto: all of a static recording, found in a free one"
    )
    reference: Reference | None = Field(None, description="the true rate, where it is known")
    axis: str | None = Field(None, description="the axis that the reference turns about; null: the board's only one")

    @model_validator(mode="before")
    @classmethod
    def _parquet_is_log(cls, data: object) -> object:
        if isinstance(data, dict) and "parquet" in data:
            raise ValueError("`parquet:` is now `log:`, with the same keys; rename it")
        return data

    @field_validator("files", mode="before")
    @classmethod
    def _one_or_many(cls, value: object) -> object:
        return (value,) if isinstance(value, str) else value

    @model_validator(mode="after")
    def _reference_fits(self) -> Recording:
        if self.kind == "calibration" and not isinstance(self.reference, PlateauReference | FileReference):
            raise ValueError("a calibration recording needs a reference of kind plateaus or file")
        if self.kind in AT_REST and self.reference is not None:
            raise ValueError(f"a {self.kind} recording stands still: it takes no reference")
        return self


class Manifest(StrictModel):
    """raw/<dataset>/dataset.yaml"""

    array: LogArray | None = Field(None, description="the gyros of logs, in place of `board`")
    board: str | None = Field(
        None, description="name of a file in config/boards, or a path to one, from the manifest's folder"
    )
    title: str = Field("", description="heading of the report")
    simulated: bool = Field(False, description="true: every page says so")
    twin: str | None = Field(None, description="the twin that made the data, where it is simulated")
    folder: str = Field(".", description="where the files are, from the manifest's folder")
    gyros: Annotated[tuple[str, ...], Field(min_length=1)] | Literal["all"] = Field("all", description="gyros to use")
    latitude_deg: float | None = Field(None, ge=-90, le=90, description="for the Earth rate on a vertical axis")
    notes: str = Field("", description="free text, shown in the report")
    recordings: tuple[Recording, ...] = Field(min_length=1, description="the runs of the board")
    analysis: Analysis | None = Field(None, description="keys of config.yaml's `analysis` to override")

    @field_validator("board")
    @classmethod
    def _board_or_array(cls, value: str | None, info: ValidationInfo) -> str | None:
        # A default is validated, too; an `array` with a mistake of its own is not there.
        if value is None and "array" in info.data and info.data["array"] is None:
            raise ValueError("missing; name a board file, or the gyros of a log under `array`")
        if value is not None and info.data.get("array") is not None:
            raise ValueError("there is `array`, too: keep one of them")
        return value

    @model_validator(mode="after")
    def _array_of_logs(self) -> Manifest:
        for recording in self.recordings if self.array else ():
            if recording.log is None:
                raise ValueError(f"recording {recording.name!r} needs `log:`, for `array` names gyros of logs")
        return self

    @model_validator(mode="after")
    def _names_are_unique(self) -> Manifest:
        names = [recording.name for recording in self.recordings]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two recordings are named {name!r}")
            if name in RESERVED:
                raise ValueError(f"a recording cannot be named {name!r}: results/<dataset>/{name}/ is taken")
        return self

    def recording(self, name: str) -> Recording:
        """The recording of that name."""
        return next(recording for recording in self.recordings if recording.name == name)


def values_of(manifest: Manifest, recording: Recording) -> Values:
    """Does a recording hold counts, or rates in deg/s, which are not calibrated again?"""
    if recording.log is None:
        return "counts"
    if manifest.array is not None:
        return "rates" if manifest.array.rates else "counts"
    return recording.log.values


def array_board(manifest: Manifest, name: str) -> Board | None:
    """The board that a manifest's `array` makes; None where it names a board file."""
    return None if manifest.array is None else board_of_log(manifest.array, name, manifest.title or name)


def parse_manifest(text: str, source: str) -> Manifest:
    """Validate the text of a dataset.yaml.  raises : InvalidFile"""
    return parse_model(text, Manifest, source, {PARTIAL: True})


def used_board(manifest: Manifest, board: Board) -> Board:
    """The board with only the gyros that the manifest uses."""
    if manifest.gyros == "all":
        return board
    kept = tuple(gyro for gyro in board.gyros if gyro.name in manifest.gyros)
    names = {gyro.name for gyro in kept}
    temperatures = tuple(t for t in board.temperatures if t.gyro is None or t.gyro in names)
    return board.model_copy(update={"gyros": kept, "temperatures": temperatures})


def check_against_board(manifest: Manifest, board: Board, source: str) -> list[Problem]:
    """Mistakes that only show when manifest and board are read together; vgyro.validation.locate gives their lines."""
    names = [gyro.name for gyro in board.gyros]
    problems = []
    for index, name in enumerate(manifest.gyros if manifest.gyros != "all" else ()):
        if name not in names:
            message = f"board {board.name!r} has no gyro {name!r}{did_you_mean(name, names)}"
            problems.append(Problem(source, 1, f"gyros.{index}", message))
    axes = used_board(manifest, board).axes
    for index, recording in enumerate(manifest.recordings):
        key = f"recordings.{index}"
        problems += [Problem(source, 1, f"{key}.{place}", text) for place, text in _axis_problems(recording, axes)]
        if recording.log is not None:
            known = list(dict.fromkeys([*board.channels, *names]))
            for channel in recording.log.columns:
                if channel not in known:
                    message = f"board {board.name!r} has no channel {channel!r}{did_you_mean(channel, known)}"
                    problems.append(Problem(source, 1, f"{key}.log.columns.{channel}", message))
    return problems


def _axis_problems(recording: Recording, axes: list[str]) -> list[tuple[str, str]]:
    if recording.axis is not None and recording.axis not in axes:
        return [("axis", f"expected one of {', '.join(axes)}; found {recording.axis!r}")]
    if recording.reference is not None and recording.axis is None and len(axes) > 1:
        return [("axis", f"missing; the reference turns about one of {', '.join(axes)}")]
    return []

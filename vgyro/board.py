"""A board as data: frame layout, channels, nominal scale (config/boards/*.yaml). See docs/file-formats.md."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from vgyro.errors import ConfigError
from vgyro.validation import StrictModel, parse_model

FieldType = Literal["u8", "i8", "u16", "i16", "u24", "i24", "u32", "i32", "u64", "i64", "f32", "f64"]
TYPE_BYTES: dict[str, int] = {
    "u8": 1, "i8": 1, "u16": 2, "i16": 2, "u24": 3, "i24": 3, "u32": 4, "i32": 4, "u64": 8, "i64": 8,
    "f32": 4, "f64": 8,
}  # fmt: skip
ByteOrder = Literal["big", "little"]


def hexadecimal(text: str) -> bytes:
    """The bytes of a text such as EB 90.  raises : ValueError in words for people"""
    if re.fullmatch(r"\s*(?:[0-9A-Fa-f]{2}\s*)*", text) is None:
        raise ValueError(f"expected bytes of two hexadecimal digits each, such as EB 90; found {text!r}")
    return bytes.fromhex(text)


class ChannelField(StrictModel):
    """One field of a frame; `count` > 1 makes channels name1..nameN, side by side."""

    name: str = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", description="the channel's name")
    type: FieldType = Field(description="u, i, f: unsigned, signed, floating point; bits")
    at: int | None = Field(None, ge=0, description="byte offset from the first sync byte (binary); text: column order")
    count: int = Field(1, ge=1, description="channels of this type")
    stride: int | None = Field(None, ge=1, description="bytes between two of `count`; null: packed")
    byte_order: ByteOrder | None = Field(None, description="null: that of the frame")
    decimals: int | None = Field(None, ge=0, description="text: digits after the point, where they are always as many")

    def channels(self) -> list[str]:
        """Names of the channels that this field makes."""
        return [self.name] if self.count == 1 else [f"{self.name}{index + 1}" for index in range(self.count)]


class Checksum(StrictModel):
    """family `crc` takes width, polynomial, init, reflected, xor_out; `sum` adds bytes modulo 2^width; `xor` for text.

    span : bytes [first, last) that are covered;  at : offset of the stored value (null: the total must be `equals`)
    pad_to : zero bytes are added to a multiple of this before the CRC is taken
    """

    family: Literal["crc", "sum", "xor", "none"] = Field(description="how it is computed")
    width: Literal[8, 16, 32] = Field(16, description="bits")
    polynomial: int = Field(0x1021, description="crc: generator, without the leading one")
    init: int = Field(0, description="crc: register before the first byte")
    reflected: bool = Field(False, description="crc: least significant bit first, in and out")
    xor_out: int = Field(0, description="crc: added to the result by exclusive or")
    span: tuple[int, int] | None = Field(None, description="bytes covered: [first, one past the last]")
    at: int | None = Field(None, description="byte offset of the stored value")
    equals: int | None = Field(None, description="what the total must be, where no value is stored")
    pad_to: int = Field(1, ge=1, description="zero bytes are added to a multiple of this first")
    byte_order: ByteOrder | None = Field(None, description="null: that of the frame")

    @model_validator(mode="after")
    def _has_a_place(self) -> Checksum:
        if self.family in {"crc", "sum"} and (self.span is None or (self.at is None) == (self.equals is None)):
            raise ValueError(f"a {self.family} checksum needs span, and one of at and equals")
        if self.span is not None and not 0 <= self.span[0] < self.span[1]:
            raise ValueError(f"span = {list(self.span)} covers no byte; it is [first, one past the last]")
        return self


class BinaryFrame(StrictModel):
    """Frames of fixed length that begin with sync bytes."""

    kind: Literal["binary"] = Field(description="binary")
    sync: str = Field(description="hexadecimal bytes, such as EB 90")
    length: int = Field(ge=2, description="bytes of a whole frame, checksum included")
    byte_order: ByteOrder = Field("big", description="of all fields, unless a field says otherwise")
    constants: dict[int, str] = Field(default={}, description="offset: hexadecimal bytes that never change")
    fields: tuple[ChannelField, ...] = Field(description="what the frame carries")
    checksum: Checksum = Field(description="how a whole frame is told from a damaged one")

    @field_validator("sync")
    @classmethod
    def _hexadecimal(cls, value: str) -> str:
        if not hexadecimal(value):
            raise ValueError("sync needs at least one byte, such as EB 90")
        return value

    @field_validator("constants")
    @classmethod
    def _all_hexadecimal(cls, value: dict[int, str]) -> dict[int, str]:
        for text in value.values():
            hexadecimal(text)
        return value

    @model_validator(mode="after")
    def _fields_fit(self) -> BinaryFrame:
        for field in self.fields:
            if field.at is None:
                raise ValueError(f"field {field.name!r} of a binary frame needs at: (its byte offset)")
            size = TYPE_BYTES[field.type]
            end = field.at + (field.count - 1) * (field.stride or size) + size
            if end > self.length:
                raise ValueError(f"field {field.name!r} ends at byte {end}, after the frame's {self.length} bytes")
        check = self.checksum
        if check.family == "xor":
            raise ValueError("an xor checksum is for text; a binary frame takes crc, sum or none")
        ends = [check.span[1]] if check.span else []
        ends += [check.at + check.width // 8] if check.at is not None else []
        ends += [offset + len(bytes.fromhex(value)) for offset, value in self.constants.items()]
        if ends and max(ends) > self.length:
            raise ValueError(f"checksum or constants end at byte {max(ends)}, after the frame's {self.length} bytes")
        return self


class TextFrame(StrictModel):
    """Lines of text: prefix, fields between separators, checksum; fields are read in the order of the list."""

    kind: Literal["text"] = Field(description="text")
    prefix: str = Field("", description="how each line begins")
    separator: str = Field(",", description="a space means any run of white space")
    fields: tuple[ChannelField, ...] = Field(description="what the line carries, in order")
    checksum: Checksum = Field(Checksum(family="none"), description="how a whole line is told from a damaged one")
    require: dict[str, int] = Field(default={}, description="field: value that marks a valid line")
    max_length: int = Field(256, ge=8, description="a longer line is damage")

    @model_validator(mode="after")
    def _can_be_read(self) -> TextFrame:
        if self.checksum.family not in {"xor", "none"}:
            raise ValueError(f"a {self.checksum.family} checksum is for binary frames; a text frame takes xor or none")
        if self.checksum.family == "xor" and not self.prefix.startswith("$"):
            raise ValueError("an xor checksum needs a prefix that begins with $")
        known = [channel for field in self.fields for channel in field.channels()]
        for name in self.require:
            if name not in known:
                raise ValueError(f"require names the field {name!r}, which the line does not have")
        return self


class Counter(StrictModel):
    """The frame counter, and where it wraps."""

    field: str = Field(description="channel that holds it")
    modulus: int = Field(ge=2, description="it counts from 0 to modulus - 1")
    step: int = Field(1, ge=1, description="increment from one frame to the next")


class TimeStamp(StrictModel):
    """The device's clock, and where it wraps."""

    field: str = Field(description="channel that holds it")
    tick_s: float = Field(gt=0, description="length of a tick, s")
    wrap: int | None = Field(None, ge=2, description="ticks; null: never")


class Adc(StrictModel):
    """Counts at the two rails; a sample there is clipped. coding as in the frame, before `offset_binary` is removed."""

    low: int = Field(description="count at the lower rail")
    high: int = Field(description="count at the upper rail")
    coding: Literal["twos_complement", "straight_binary"] = Field("twos_complement", description="of the counts")


class Gyro(StrictModel):
    """One gyro: rate [deg/s] = sign · (count - bias) · scale, along `axis` of the board."""

    name: str = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", description="the gyro's name")
    field: str = Field(description="channel that holds it")
    axis: str = Field(pattern=r"^[A-Za-z0-9_]+$", description="axis of the board; gyros that share it are an array")
    sign: Literal[1, -1] = Field(1, description="-1: mounted the other way round")
    scale: float = Field(gt=0, description="nominal scale, deg/s a count")
    bias: float = Field(0.0, description="nominal zero-rate output, counts")
    range_deg_s: float | None = Field(None, gt=0, description="measuring range, deg/s")
    lowpass_hz: float | None = Field(None, gt=0, description="its own first-order low-pass, -3 dB, Hz; null: unknown")


class Temperature(StrictModel):
    """One temperature channel: °C = count · scale + offset."""

    name: str = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", description="the sensor's name")
    field: str = Field(description="channel that holds it")
    gyro: str | None = Field(None, description="the gyro it sits in; null: the board")
    scale: float = Field(description="°C a count")
    offset: float = Field(description="°C at count 0")


class Board(StrictModel):
    """A board file. Channels that no gyro or temperature names are decoded and kept all the same."""

    name: str = Field(description="the file's name without .yaml")
    title: str = Field(description="heading in reports")
    source: str = Field("", description="document that gives the layout and the scaling")
    rate_hz: float | None = Field(
        None, gt=0, description="frames a second, unless a recording says otherwise; null: a log's stamps tell"
    )
    baud: int | None = Field(None, gt=0, description="of the serial line, for information")
    frame: Annotated[BinaryFrame | TextFrame, Field(discriminator="kind")] | None = Field(
        None, description="layout of a frame; null: the board exists only as logs"
    )
    log_channels: tuple[str, ...] = Field(
        (), description="channels of a board without frame; empty: those of its gyros and temperatures"
    )
    counter: Counter | None = Field(None, description="null: the board sends none")
    timestamp: TimeStamp | None = Field(None, description="null: the board sends none")
    adc: Adc | None = Field(None, description="null: clipping is not looked for")
    gyros: tuple[Gyro, ...] = Field(min_length=1, description="the gyros to analyse")
    temperatures: tuple[Temperature, ...] = Field((), description="the temperature channels")

    @property
    def frame_rate_hz(self) -> float:
        """Frames a second of a board with frames.  raises : ConfigError if it has none"""
        if self.rate_hz is None:
            raise ConfigError("has no rate_hz", f"board {self.name!r}", "say how many frames it sends a second")
        return self.rate_hz

    @property
    def channels(self) -> list[str]:
        """Names of all channels: of a frame, in its order, or of the log."""
        if self.frame is not None:
            return [channel for field in self.frame.fields for channel in field.channels()]
        named = [gyro.field for gyro in self.gyros] + [temperature.field for temperature in self.temperatures]
        return list(self.log_channels or dict.fromkeys(named))

    @property
    def layout(self) -> BinaryFrame | TextFrame:
        """The frame.  raises : ConfigError if the board exists only as logs"""
        if self.frame is None:
            remedy = "set `log:` for the recording, or add `frame:` to the board file"
            raise ConfigError("has no frame: it exists only as logs", f"board {self.name!r}", remedy)
        return self.frame

    @property
    def axes(self) -> list[str]:
        """Axes that carry at least one gyro, in the order of the gyros."""
        return list(dict.fromkeys(gyro.axis for gyro in self.gyros))

    def array(self, axis: str) -> list[Gyro]:
        """The gyros along one axis: the array that a virtual gyroscope is made of."""
        return [gyro for gyro in self.gyros if gyro.axis == axis]

    @model_validator(mode="after")
    def _names_exist(self) -> Board:
        if self.frame is not None and self.rate_hz is None:
            raise ValueError("rate_hz is missing: a board with frames sends so many a second")
        if self.frame is None and (self.counter or self.timestamp):
            raise ValueError("counter and timestamp need a frame; a log's time is named by the manifest")
        if self.frame is not None and self.log_channels:
            raise ValueError("log_channels is for a board without frame; a frame's fields name its channels")
        known = set(self.channels)
        for name in self.channels:
            if self.channels.count(name) > 1:
                raise ValueError(f"two channels are named {name!r}")
        users = [(f"gyro {g.name!r}", g.field) for g in self.gyros]
        users += [(f"temperature {t.name!r}", t.field) for t in self.temperatures]
        users += [("counter", self.counter.field)] if self.counter else []
        users += [("timestamp", self.timestamp.field)] if self.timestamp else []
        for user, field in users:
            if field not in known:
                raise ValueError(f"{user} names the channel {field!r}, which the frame does not have")
        names = [gyro.name for gyro in self.gyros]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two gyros are named {name!r}")
        for temperature in self.temperatures:
            if temperature.gyro is not None and temperature.gyro not in names:
                raise ValueError(
                    f"temperature {temperature.name!r} names the gyro {temperature.gyro!r}, which is not there"
                )
        return self


def parse_board(text: str, source: str) -> Board:
    """Validate the text of a board file.  raises : InvalidFile"""
    return parse_model(text, Board, source)

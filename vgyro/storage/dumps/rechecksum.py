"""Which checksum do frames carry? Every usual one is tried on frames whose places are known."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import Any, Literal, NamedTuple

import numpy as np

from vgyro.arrays import Ints
from vgyro.board import BinaryFrame, ByteOrder, Checksum
from vgyro.engine.checksums import crc_tables, mask

SAMPLE = 64  # frames that are tried
FEWEST = 16
VARIED = 8  # values of the checksum among them: one that hardly changes proves nothing
SURE = 0.9
Width = Literal[8, 16, 32]
WIDTHS: tuple[Width, ...] = (8, 16, 32)
# Generator polynomials in use, by width.
POLYNOMIALS: dict[int, tuple[int, ...]] = {
    8: (0x07, 0x31, 0x1D, 0x2F, 0xD5),
    16: (0x1021, 0x8005, 0x3D65, 0x8BB7, 0xC867, 0x0589),
    32: (0x04C11DB7, 0x1EDC6F41, 0xF4ACFB13),
}
UNUSUAL_INIT = (0x1D0F,)


class Shape(NamedTuple):
    """A checksum without initial value and final XOR."""

    family: Literal["crc", "sum"]
    width: Width
    polynomial: int
    reflected: bool
    span: tuple[int, int]
    at: int
    order: ByteOrder
    pad_to: int


def right_checksum(buffer: np.ndarray, places: np.ndarray, frame: BinaryFrame) -> tuple[Checksum, int] | None:
    """The checksum that frames carry, the nearest to the frame's own, and for how many of them it is right.

    buffer : uint8 [m];  places : where the frames begin
    returns : None where no usual checksum is right for nearly all of them
    Initial value and final XOR only change a constant in frames of one length: it is found, then explained by usual
    ones, else by the final XOR alone.
    """
    if len(places) < FEWEST or frame.checksum.span is None:
        return None
    window = np.lib.stride_tricks.sliding_window_view(buffer, frame.length)
    sample = np.unique(window[places[: 4 * SAMPLE]], axis=0)
    rng = np.random.default_rng(0)
    rows = sample[rng.permutation(len(sample))[:SAMPLE]]
    unexplained = None
    for shape in _shapes(frame):
        rest = _constant(rows, shape)
        if rest is None:
            continue
        rule = _explained(shape, rest, frame)
        if rule is not None:
            return rule, _count(window[places], shape, rest)
        if unexplained is None and shape.family == "crc":
            init = frame.checksum.init & mask(shape.width)
            update = {"init": init, "xor_out": rest ^ _of_zeros(shape, init)}
            unexplained = _rule(shape, frame, update), shape, rest
    if unexplained is None:
        return None
    rule, shape, rest = unexplained
    return rule, _count(window[places], shape, rest)


def same_order(rule: Checksum, frame: BinaryFrame, order: ByteOrder) -> bool:
    """True if the rule is the frame's own, but stored in that byte order."""
    own = frame.checksum
    plain = rule.model_copy(update={"byte_order": own.byte_order})
    return own.byte_order is None and plain == own and rule.byte_order == order


def shown_key(name: str, value: Any, width: int) -> str:
    """A value as it is written in a board file."""
    if name in {"polynomial", "init", "xor_out"}:
        return f"0x{value:0{width // 4}X}"
    if isinstance(value, tuple):
        return f"[{', '.join(map(str, value))}]"
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _shapes(frame: BinaryFrame) -> Iterator[Shape]:
    """All shapes, those that differ least from the frame's own first."""
    own = frame.checksum
    order = own.byte_order or frame.byte_order
    assert own.span is not None
    found: dict[Shape, int] = {}
    for width in WIDTHS:
        size = width // 8
        ends = {frame.length - size, *((own.at + k for k in (-1, 0, 1)) if own.at is not None else ())}
        polynomials = {*POLYNOMIALS[width], *([own.polynomial] if width == own.width else [])}
        families = [("crc", polynomial, turned) for polynomial in polynomials for turned in (False, True)]
        for at in (at for at in ends if 0 < at <= frame.length - size):
            firsts = {own.span[0] + k for k in (-1, 0, 1)} | {0, len(bytes.fromhex(frame.sync))}
            lasts = {own.span[1] + k for k in (-1, 0, 1)} | {at}
            for first, last, by in product(firsts, lasts, ("big", "little") if size > 1 else (order,)):
                if not 0 <= first < last <= at:
                    continue
                for family, polynomial, turned in [*families, ("sum", own.polynomial, own.reflected)]:
                    shape = Shape(family, width, polynomial, turned, (first, last), at, by, own.pad_to)  # type: ignore[arg-type]
                    found[shape] = _distance(shape, own, order)
    yield from sorted(found, key=lambda shape: (found[shape], shape))


def _distance(shape: Shape, own: Checksum, order: ByteOrder) -> int:
    """How many keys of the board file differ; polynomial and reflection of a sum mean nothing."""
    differs = [shape.family != own.family, shape.width != own.width, shape.span != own.span, shape.at != own.at]
    differs += [shape.order != order and shape.width > 8]
    if shape.family == "crc":
        differs += [shape.polynomial != own.polynomial, shape.reflected != own.reflected]
    return sum(differs)


def _constant(rows: np.ndarray, shape: Shape) -> int | None:
    """What stored and computed value differ by in nearly all frames; None if by no constant."""
    stored = _stored(rows, shape)
    if len(np.unique(stored)) < min(VARIED, len(rows)) or len(rows) < VARIED:
        return None
    values, counts = np.unique(_difference(rows, shape), return_counts=True)
    best = int(np.argmax(counts))
    rest = int(values[best])
    if counts[best] < SURE * len(rows) or (shape.family == "sum" and rest != 0):
        return None
    return rest


def _difference(rows: Ints, shape: Shape) -> Ints:
    stored = _stored(rows, shape)
    covered = rows[:, shape.span[0] : shape.span[1]]
    if shape.family == "sum":
        difference: Ints = (stored - covered.sum(axis=1, dtype=np.uint64)) & np.uint64(mask(shape.width))
        return difference
    tables = _tables(shape.width, shape.polynomial, shape.reflected, covered.shape[1], shape.pad_to)
    result = np.zeros(len(rows), tables.dtype)
    for place, table in enumerate(tables):
        result ^= table[covered[:, place]]
    difference = result.astype(np.uint64) ^ stored
    return difference


def _count(rows: np.ndarray, shape: Shape, rest: int) -> int:
    return int(np.count_nonzero(_difference(rows, shape) == rest))


def _stored(rows: np.ndarray, shape: Shape) -> np.ndarray:
    value = np.zeros(len(rows), dtype=np.uint64)
    size = shape.width // 8
    for offset in range(size) if shape.order == "big" else range(size - 1, -1, -1):
        value = (value << np.uint64(8)) | rows[:, shape.at + offset]
    return value


@lru_cache(maxsize=512)
def _tables(width: Width, polynomial: int, reflected: bool, length: int, pad_to: int) -> np.ndarray:
    rule = Checksum(
        family="crc", width=width, polynomial=polynomial, reflected=reflected, span=(0, length), at=length,
        pad_to=pad_to,
    )  # fmt: skip
    return crc_tables(rule, length)[1]


def _of_zeros(shape: Shape, init: int) -> int:
    """CRC of as many zeros as are covered, with that initial value and no final XOR."""
    length = shape.span[1] - shape.span[0]
    rule = Checksum(
        family="crc", width=shape.width, polynomial=shape.polynomial, reflected=shape.reflected, init=init,
        span=(0, length), at=length, pad_to=shape.pad_to,
    )  # fmt: skip
    return crc_tables(rule, length)[0]


def _explained(shape: Shape, rest: int, frame: BinaryFrame) -> Checksum | None:
    """The rule with a usual initial value and final XOR that leave nothing over; the frame's own come first."""
    if shape.family == "sum":
        return _rule(shape, frame, {})
    ones, own = mask(shape.width), frame.checksum
    inits = [own.init & ones, 0, ones, *(value for value in UNUSUAL_INIT if shape.width == 16)]
    for xor_out, init in product(dict.fromkeys([own.xor_out & ones, 0, ones]), dict.fromkeys(inits)):
        if _of_zeros(shape, init) ^ xor_out == rest:
            return _rule(shape, frame, {"init": init, "xor_out": xor_out})
    return None


def _rule(shape: Shape, frame: BinaryFrame, update: dict[str, int]) -> Checksum:
    own = frame.checksum
    order = own.byte_order or frame.byte_order
    byte_order = own.byte_order if shape.order == order or shape.width == 8 else shape.order
    common = {"family": shape.family, "width": shape.width, "span": shape.span, "at": shape.at, "equals": None}
    crc = {"polynomial": shape.polynomial, "reflected": shape.reflected} if shape.family == "crc" else {}
    return own.model_copy(update={**common, **crc, **update, "byte_order": byte_order})

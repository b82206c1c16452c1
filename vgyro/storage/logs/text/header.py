"""Names and units of the columns of a text."""

from __future__ import annotations

import re
from collections.abc import Sequence

from vgyro.storage.logs.binary.opened import Unique
from vgyro.storage.logs.text.cells import is_value, missing, split
from vgyro.storage.logs.text.delimiter import DELIMITERS

COMMENTS = ("#", "%", "//")
BRACKETS = re.compile(r".*?[(\[{]\s*([^()\[\]{}]+?)\s*[)\]}]\s*")
ENDINGS = {
    "dps": "dps", "mdps": "mdps", "rad_s": "rad/s", "rads": "rad/s", "radps": "rad/s", "rps": "rad/s",
    "deg_s": "deg/s", "degs": "deg/s", "degps": "deg/s", "mdeg_s": "mdeg/s", "deg_h": "deg/h", "dph": "deg/h", "s": "s",
    "sec": "s", "ms": "ms",
    "us": "us", "ns": "ns", "degc": "degC", "m_s2": "m/s2", "mps2": "m/s2", "mg": "mg", "ut": "uT", "hpa": "hPa",
}  # fmt: skip
"""Units at a name's end, behind a blank, "_", "." or "-"; and as they are written elsewhere."""
ENDING = re.compile(rf".*?[a-z0-9)][\s_.\-]+({'|'.join(sorted(ENDINGS, key=len, reverse=True))})", re.IGNORECASE)
UNITS = {
    "s", "sec", "ms", "us", "µs", "μs", "ns", "min", "h", "deg/s", "°/s", "º/s", "dps", "rad/s", "rps", "mdps", "deg/h",
    "°/h", "g", "mg", "m/s2", "m/s^2", "m/s²", "c", "°c", "degc", "k", "hz", "v", "mv", "lsb", "counts", "count", "raw",
    "ut", "µt",
    "gauss", "%", "deg", "rad", "°", "deg/sec", "rad/sec", "hpa", "pa", "seconds", "text",
}  # fmt: skip
TOKEN = re.compile(r"\S+(?:\s*[(\[{][^()\[\]{}]*[)\]}])?")


def is_comment(line: str) -> bool:
    """Is a line a comment?"""
    return line.lstrip().startswith(COMMENTS)


def unit_of(name: str) -> str:
    """The unit beside a name: "gx (deg/s)", "g1 [rad/s]", "gx_dps"; empty where there is none."""
    if found := BRACKETS.fullmatch(name):
        return found[1]
    if found := ENDING.fullmatch(name.strip()):
        return ENDINGS[found[1].lower()]
    return ""


def names_in(line: str, delimiter: str, count: int, decimal: str = ".") -> list[str] | None:
    """`count` names in a line, which may be a comment and have another delimiter; None if it holds no names.

    Empty cells behind the last one do not count; most of the names must be none of numbers.
    """
    text = line.strip()
    if is_comment(text):
        text = text.lstrip("".join(COMMENTS)).strip()
    if not text:
        return None
    ways = [split(text, sign) for sign in (delimiter, *DELIMITERS)]
    ways.append([found.group() for found in TOKEN.finditer(text)])
    ways.append(re.split(r"\s{2,}|\t", text))
    for cells in ways:
        while len(cells) > count and not cells[-1]:
            cells.pop()
        words = sum(not missing(cell) and not is_value(cell, decimal) for cell in cells)
        if len(cells) == count and words * 2 > sum(cell != "" for cell in cells):
            return cells
    return None


def are_units(cells: Sequence[str]) -> bool:
    """Is a line of cells one of units?"""
    bare = [cell.strip("()[]{} ").lower() for cell in cells]
    known = sum(one in UNITS for one in bare)
    return known > 0 and all(one in UNITS or one in ("", "-", "1") for one in bare)


def header_of(before: Sequence[str], delimiter: str, count: int, decimal: str) -> tuple[list[str], list[str]] | None:
    """Names and units from the lines before the first row, nearest last; None if none of them has `count` names."""
    found = [names for line in before[-8:] if (names := names_in(line, delimiter, count, decimal)) is not None]
    if not found:
        return None
    names, units = found[-1], [""] * count
    if are_units(names):
        units = [cell.strip("()[]{} ") for cell in names]
        if len(found) < 2:
            return None
        names = found[-2]
    elif len(set(names)) < count and len(found) > 1 and len(set(zip(found[-2], names, strict=True))) == count:
        # "gyro,gyro,gyro" above "x,y,z".
        names = [" ".join(filter(None, pair)) for pair in zip(found[-2], names, strict=True)]
    return names, units


def named(names: Sequence[str], units: Sequence[str]) -> list[tuple[str, str]]:
    """(name, unit) of each column: names are unique and not empty; a unit that stands alone wins."""
    unique = Unique()
    return [
        (unique(name or f"c{place}"), unit or unit_of(name))
        for place, (name, unit) in enumerate(zip(names, units, strict=True), start=1)
    ]

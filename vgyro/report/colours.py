"""Colours of pages and plots: one accent, and a palette that colour-blind readers can tell apart, for light and dark.

A plot holds colour marks (`#000100` is series 0) in place of colours; the page puts the colour of its scheme there when
it draws, so that one file reads well in both. The palette is Okabe & Ito's, its black and yellow shifted to be legible.
"""

from __future__ import annotations

INK, MUTED, GRID, PAPER, ACCENT = "#000001", "#000002", "#000003", "#000004", "#000005"
GOOD, BAD = "#000006", "#000007"

MARKS = {INK: "ink", MUTED: "muted", GRID: "grid", PAPER: "paper", ACCENT: "accent", GOOD: "good", BAD: "bad"}

LIGHT = {
    "ink": "#1b1f24", "muted": "#57606a", "grid": "#dfe3e8", "paper": "#ffffff", "panel": "#f5f7f9",
    "line": "#d0d7de", "accent": "#0b62a8", "good": "#1a7f37", "bad": "#b3261e", "warn": "#8a5a00",
    "good-soft": "#dff3e4", "bad-soft": "#fbe4e2", "warn-soft": "#fcf0d4", "accent-soft": "#e3eef8",
}  # fmt: skip
DARK = {
    "ink": "#e6e9ec", "muted": "#a0a8b0", "grid": "#30363c", "paper": "#15181b", "panel": "#1d2125",
    "line": "#3a4148", "accent": "#6cb4ee", "good": "#63c57a", "bad": "#ff8b80", "warn": "#e3b341",
    "good-soft": "#173321", "bad-soft": "#42201d", "warn-soft": "#3a2f10", "accent-soft": "#1a2f42",
}  # fmt: skip
SERIES_LIGHT = ("#0072b2", "#e08a00", "#009e73", "#d1481e", "#b65c93", "#3fa0d8", "#8f8200", "#3b3f44")
SERIES_DARK = ("#3d97dc", "#f0a92e", "#22bd8f", "#f0743c", "#dc93b9", "#8accf2", "#e5da52", "#c4c9ce")

DASHES = ("solid", "dashed", "dotdash", "dotted")


def series_mark(index: int) -> str:
    """Colour mark of series `index`; the palette repeats after eight."""
    return f"#0001{index % len(SERIES_LIGHT):02x}"


def series_dash(index: int) -> str:
    """Dash of series `index`: the next one each time that the palette repeats."""
    return DASHES[index // len(SERIES_LIGHT) % len(DASHES)]


def marks() -> dict[str, str]:
    """Colour mark → name of the CSS variable that holds the colour of the scheme in use."""
    series = {series_mark(index): f"s{index}" for index in range(len(SERIES_LIGHT))}
    return {**MARKS, **series}


def variables(dark: bool) -> dict[str, str]:
    """Names and values of all CSS variables of one scheme."""
    names = {f"s{index}": colour for index, colour in enumerate(SERIES_DARK if dark else SERIES_LIGHT)}
    return {**(DARK if dark else LIGHT), **names}

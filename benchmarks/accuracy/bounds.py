"""Bounds on every line of a quick run, kept as data in bounds.yaml: a loss of accuracy cannot land.

All is seeded: the bounds are the figures of a run with a margin for other platforms' rounding, and are written by
`python -m benchmarks.accuracy --quick --set-bounds`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

from benchmarks.accuracy.demands import CALLED, figure
from benchmarks.accuracy.summary import JUDGED, RECOMMENDED, Line

PATH = Path(__file__).parent / "bounds.yaml"
MARGIN, NEES_MARGIN = 1.01, 1.03
LUCK = (0.6, 1.6)
"""NEES of an honest s.d. in one short recording: the common bias is one number in it."""
FAULTS = {"found": "least", "named": "most", "stray": "most", "invented": "most", "excused": "most"}
HEAD = """\
# Bounds of `python -m benchmarks.accuracy --quick`, line by line; written by --set-bounds, compared by a test.
# recommended, recommended_unsmoothed: largest error over the plain average's, [at full rate, of 1 s means], s.d.
# in motion, r.m.s. at rest;
# nees: least and largest; faults: least that are found, most events of other sorts (benchmarks/accuracy/scores.py).
# null: it did not run, or was not stated.
"""
Bounds = dict[str, dict[str, Any]]


def of_lines(lines: Sequence[Line]) -> Bounds:
    """Bounds from a run."""
    return {line.label: _of_line(line) for line in lines}


def _of_line(line: Line) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in RECOMMENDED:
        ratios = [line.ratio(name, kind) for kind in JUDGED]
        found[name] = [_up(ratio * MARGIN) for ratio in ratios] if math.isfinite(ratios[0]) else None
    nees = line.cells["recommended"].nees.value
    found["nees"] = None
    if math.isfinite(nees):
        found["nees"] = [min(LUCK[0], _down(nees / NEES_MARGIN)), max(LUCK[1], _up(nees * NEES_MARGIN))]
    found["faults"] = {name: line.faults[name] for name in FAULTS}
    return found


def _up(value: float) -> float:
    return _digits(value, math.ceil)


def _down(value: float) -> float:
    return _digits(value, math.floor)


def _digits(value: float, towards: Any) -> float:
    """Three digits, rounded up or down."""
    if value == 0.0:
        return 0.0
    step = 10.0 ** (math.floor(math.log10(abs(value))) - 2)
    return float(f"{towards(value / step) * step:.3g}")


def broken(lines: Sequence[Line], bounds: Bounds) -> list[str]:
    """One sentence for everything that is worse than its bound; a line without bounds is one, too."""
    return [sentence for line in lines for sentence in _broken(line, bounds.get(line.label))]


def _broken(line: Line, bound: dict[str, Any] | None) -> Iterator[str]:
    if bound is None:
        yield f"{line.label}: bounds.yaml has no bounds for it"
        return
    for name in RECOMMENDED:
        limits = bound[name]
        for place, kind in enumerate(JUDGED):
            ratio = line.ratio(name, kind)
            if limits is not None and not ratio <= limits[place]:
                found = f"{figure(ratio)} × the average, at most {limits[place]:g}"
                yield f"{line.label}: {name}, {CALLED[kind]}: {found}"
    nees = line.cells["recommended"].nees.value
    if bound["nees"] is not None and not bound["nees"][0] <= nees <= bound["nees"][1]:
        yield f"{line.label}: NEES {figure(nees)}, between {bound['nees'][0]:g} and {bound['nees'][1]:g}"
    for name, count in bound["faults"].items():
        side, seen = FAULTS[name], line.faults[name]
        if seen < count if side == "least" else seen > count:
            yield f"{line.label}: faults {name} {seen}, at {side} {count}"


def read(path: Path = PATH) -> Bounds:
    """The bounds that are kept."""
    return dict(yaml.safe_load(path.read_text(encoding="utf-8")))


def write(bounds: Bounds, path: Path = PATH) -> None:
    """Keep bounds, a line each."""
    rows = [
        f"{label}: {yaml.safe_dump(bound, default_flow_style=True, sort_keys=False, width=1000).strip()}"
        for label, bound in bounds.items()
    ]
    path.write_text("\n".join([HEAD.rstrip(), *rows, ""]), encoding="utf-8")

"""Results as a Markdown table and as JSON."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.contest import Accuracy, Against, Result

HEAD = ("task", "against", "ours", "theirs", "ratio (least … greatest)", "target", "", "limit", "ours / limit")


def as_markdown(results: Sequence[Result]) -> str:
    """The table of times, then the table of figures."""
    lines = [_line(HEAD), _line(["---"] * len(HEAD))]
    lines += [_line(_row(result, against)) for result in results for against in result.against]
    lines += ["", _line(("task", "figure", "value", "limit", "")), _line(["---"] * 5)]
    lines += [_line([result.title, *_figure(figure)]) for result in results for figure in result.accuracy]
    notes = [f"- {result.title}: {result.note}." for result in results if result.note]
    return "\n".join([*lines, *([""] if notes else []), *notes]) + "\n"


def write_json(path: Path, results: Sequence[Result], quick: bool) -> None:
    """Everything, and what kind of machine it was."""
    record = {
        "machine": {"architecture": platform.machine(), "avx2": _avx2(), "python": platform.python_version()},
        "threads": os.environ.get("VGYRO_THREADS"),
        "quick": quick,
        "results": [{**asdict(result), "accurate": result.accurate} for result in results],
    }
    path.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _row(result: Result, against: Against) -> list[str]:
    sign, unit = ("≤", " s") if result.difference else ("≥", "×")
    figure = f"{_short(against.figure)}{unit} ({_short(against.low)} … {_short(against.high)})"
    target = "" if against.target is None else f"{sign} {_short(against.target)}{unit}"
    verdict = "" if against.target is None else "pass" if against.passed else "**miss**"
    times = [f"{duration(seconds)}/{result.unit}" for seconds in (result.seconds, against.seconds)]
    limit, share = ("", "")
    if result.limit_s > 0:
        limit, share = duration(result.limit_s), f"{result.seconds / result.limit_s:.1f}"
    return [result.title, against.name, *times, figure, target, verdict, limit, share]


def _figure(figure: Accuracy) -> list[str]:
    limit = "" if figure.limit is None else f"≤ {figure.limit:.2g}"
    return [
        figure.name,
        f"{figure.value:.3g}",
        limit,
        "" if figure.limit is None else "ok" if figure.passed else "**bad**",
    ]


def _short(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def duration(seconds: float) -> str:
    """Three digits and the unit that suits them."""
    for factor, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= factor:
            return f"{seconds / factor:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _avx2() -> bool:
    try:
        return " avx2 " in Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False

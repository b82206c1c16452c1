"""docs/accuracy.md: the summary, the matrices, the ranks, what must hold, the ablation, before and after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from benchmarks.accuracy.ablation import Change, PartSummary
from benchmarks.accuracy.compare import Difference
from benchmarks.accuracy.demands import CALLED, Demand, demands, figure
from benchmarks.accuracy.scenario import load
from benchmarks.accuracy.summary import JUDGED, RECOMMENDED, Cell, Interval, Line, ranked_on, ranks

HEAD = Path(__file__).parent / "head.md"
SHOWN = 6


def document(
    lines: Sequence[Line], parts: Sequence[PartSummary] = (), compared: Sequence[Difference] = ()
) -> str:  # fmt: skip
    """The whole page."""
    seeds = max(line.seeds for line in lines)
    head = HEAD.read_text(encoding="utf-8").format(
        seeds=f"{seeds} seed{'s' * (seeds != 1)}", lines=len(lines), scenarios=len({line.scenario for line in lines})
    )
    sections = [
        head.rstrip(),
        must_hold(demands(lines)),
        summary(lines),
        *(ranking(lines, one) for one in reversed(JUDGED)),
    ]
    sections += [matrix(lines, one) for one in reversed(JUDGED)]
    sections += [not_run(lines)]
    sections += [ablation(parts)] if parts else []
    sections += [comparison(compared)] if compared else []
    return "\n\n".join(sections) + "\n"


def must_hold(found: Sequence[Demand]) -> str:
    """What must hold, with the misses."""
    rows = ["## What must hold", "", "| demand | | misses |", "|---|---|---|"]
    for one in found:
        share = "" if one.needed == 1.0 else f" on {one.needed:.0%}"
        verdict = "holds" if one.holds else "**misses**"
        misses = "; ".join(one.misses)
        rows.append(f"| {one.text}{share} ({one.lines} figures) | {verdict}, {len(one.misses)} | {misses} |")
    return "\n".join(rows)


def summary(lines: Sequence[Line]) -> str:
    """A line a recording."""
    head = (
        "line", "differs from the base", "recommended", "unsmoothed", "best other row", "oracle", "best gyro", "NEES",
        "within 95 %", "faults: found, invented",
    )  # fmt: skip
    rows = [
        "## Summary", "",
        "Error over that of the plain average: of 1 s means, with its 95 % interval over the seeds; in brackets at the"
        " full rate.", "", _row(head), _row(["---"] * len(head)),
    ]  # fmt: skip
    for line in lines:
        ours, bare = (line.cells.get(name) for name in RECOMMENDED)
        other = line.other("means")
        oracle, single = (line.yardstick(one, "means") for one in (line.oracle, line.best_gyro))
        rows.append(
            _row([
                line.label, load(line.scenario).title, _cell(line, ours), _cell(line, bare),
                f"{other} {_cell(line, line.cells[other])}" if other else "-",
                f"{figure(oracle)} ({figure(line.yardstick(line.oracle, 'full'))}){'' if line.exact else ' bound'}",
                figure(single), _interval(ours.nees) if ours and ours.ran else "-",
                f"{ours.coverage:.0%}" if ours and math.isfinite(ours.coverage) else "-", _faults(line),
            ])
        )  # fmt: skip
    return "\n".join(rows)


def _faults(line: Line) -> str:
    found = line.faults
    text = f"{found['found']} of {found['true']}" if found["true"] else "none there"
    if found["invented"]:
        text += f", **{found['invented']} invented**"
    extra = found["events"] - found["named"]
    return text + (f", {extra} other events" if extra and not found["invented"] else "")


def ranking(lines: Sequence[Line], kind: str) -> str:
    """Methods by mean rank."""
    head = ("method", "mean rank", "best or within 3 %", "typical", "worst", "on", "ran on", "CPU s a trial")
    rows = [f"## Ranks: {CALLED[kind]}", "", _row(head), _row(["---"] * len(head))]
    count = len(ranked_on(lines))
    for one in ranks(lines, kind):
        rows.append(
            _row([
                one.method, f"{one.mean:.1f}", f"{one.first} of {count}", figure(one.typical), figure(one.worst),
                one.worst_on, str(one.ran), figure(one.cpu_s),
            ])
        )  # fmt: skip
    return "\n".join(rows)


def matrix(lines: Sequence[Line], kind: str) -> str:
    """Every method on every line."""
    names = list(dict.fromkeys(name for line in lines for name in line.cells))
    legend = ", ".join(f"{place} {name}" for place, name in enumerate(names, start=1))
    rows = [
        f"## All methods: error over that of the average, {CALLED[kind]}", "", f"Columns: {legend}; O the oracle. The"
        " best is bold.", "", _row(["line", *(str(place) for place in range(1, len(names) + 1)), "O"]),
        _row(["---"] * (len(names) + 2)),
    ]  # fmt: skip
    for line in lines:
        ratio = [line.ratio(name, kind) for name in names]
        least = min(ratio)
        texts = [_matrix_cell(line, name, value, least) for name, value in zip(names, ratio, strict=True)]
        rows.append(_row([line.label, *texts, figure(line.yardstick(line.oracle, kind))]))
    return "\n".join(rows)


def _matrix_cell(line: Line, name: str, value: float, least: float) -> str:
    if math.isinf(value):
        return "failed" if name in line.cells and line.cells[name].state == "failed" else "-"
    return f"**{figure(value)}**" if value == least else figure(value)


def not_run(lines: Sequence[Line]) -> str:
    """Methods that failed, with the reason; those that say that they cannot run, counted."""
    rows = ["## Did not run", ""]
    for name in dict.fromkeys(name for line in lines for name in line.cells):
        cells = [(line.label, line.cells[name]) for line in lines if name in line.cells and not line.cells[name].whole]
        failed = [f"{label}: {cell.note}" for label, cell in cells if cell.state == "failed"]
        reasons = list(dict.fromkeys(cell.note for _, cell in cells if cell.state == "cannot run"))
        if failed:
            rows.append(f"- {name} **failed**: {'; '.join(failed[:SHOWN])}{_more(failed)}")
        if reasons:
            rows.append(
                f"- {name} could not on {len(cells) - len(failed)} lines: {'; '.join(reasons[:2])}{_more(reasons, 2)}"
            )
    return "\n".join(rows if len(rows) > 2 else [*rows, "Every method ran everywhere."])


def ablation(parts: Sequence[PartSummary]) -> str:
    """What each part brings and costs."""
    head = ("part", "brings ≥ 2 %", "costs ≥ 2 %", "makes the s.d. honest", "makes it less so", "CPU without / with")
    rows = [
        "## Parts of recommended", "",
        "Error without the part over that with it: of full rate and 1 s means the one that changes more. Honest: NEES"
        " with → without the part, where it is a factor of 1.25 farther from 1, or nearer.", "", _row(head),
        _row(["---"] * len(head)),
    ]  # fmt: skip
    for one in parts:
        errors = (_listed([_error(change) for change in found]) for found in (one.brings, one.costs))
        honesty = (_listed([_honesty(change) for change in found]) for found in (one.honest, one.not_honest))
        rows.append(_row([one.part, *errors, *honesty, figure(one.cpu)]))
    return "\n".join(rows)


def _error(one: Change) -> str:
    return f"{one.line}{' unsmoothed' * (one.method != 'recommended')} {figure(one.most)}"


def _honesty(one: Change) -> str:
    return f"{one.line} {figure(one.nees[0])} → {figure(one.nees[1])}"


def _listed(texts: Sequence[str]) -> str:
    return "; ".join(texts[:SHOWN]) + _more(texts) if texts else "nothing"


def comparison(found: Sequence[Difference]) -> str:
    """Before and after."""
    head = ("line", "method", "1 s means", "full rate", "NEES", "CPU", "accused healthy gyros", "runs")
    rows = [
        "## Before and after", "", "Error after over before, on the same seeds; NEES, accusations: before → after.", "",
        _row(head), _row(["---"] * len(head)),
    ]  # fmt: skip
    for one in found:
        runs = f"{one.gained} gained" * bool(one.gained) + f" **{one.lost} lost**" * bool(one.lost)
        rows.append(
            _row([
                one.line, one.method, _interval(one.ratio["means"]), _interval(one.ratio["full"]),
                f"{figure(one.nees[0])} → {figure(one.nees[1])}", figure(one.cpu),
                f"{one.invented[0]} → {one.invented[1]}", runs,
            ])
        )  # fmt: skip
    return "\n".join(rows)


def _cell(line: Line, cell: Cell | None) -> str:
    if cell is None or not cell.ran:
        return "-"
    text = f"{_interval(line.interval(cell, 'means'))} ({figure(line.interval(cell, 'full').value)})"
    return text if cell.whole else f"{text}, {cell.seeds - cell.ran} of {cell.seeds} did not run"


def _interval(one: Interval) -> str:
    if math.isnan(one.low):
        return figure(one.value)
    return f"{figure(one.value)} [{figure(one.low)}, {figure(one.high)}]"


def _more(found: Sequence[object], shown: int = SHOWN) -> str:
    return f" and {len(found) - shown} more" if len(found) > shown else ""


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(one.replace('|', '/') for one in cells)} |"

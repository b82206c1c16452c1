"""The page of a data set, part by part, and its line in the overview."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from vgyro.report.calibration.section import calibration_part, nominal
from vgyro.report.conclusions.best import BEST_RULES, BestMethod, best_of_all
from vgyro.report.conclusions.conventions import conventions_part, provenance_part
from vgyro.report.conclusions.crosscheck import crosscheck_part
from vgyro.report.conclusions.section import BAD_RULE, bad_gyros, conclude, main_arrays
from vgyro.report.fusion.failed import recommended_failed
from vgyro.report.fusion.methods import dynamic_table, response_table, rest_tables
from vgyro.report.fusion.more_gyros import more_gyros_part
from vgyro.report.fusion.moved import MOVED_RULE, moved_table
from vgyro.report.fusion.noise import allan_plot, cross_allan_plot, spectrum_plot, tones_table
from vgyro.report.html import bullets, details, heading, join, macro, paragraph
from vgyro.report.model import ArrayPart, DatasetPart
from vgyro.report.page import Section, render_page
from vgyro.report.recordings.delays import delays_part
from vgyro.report.recordings.faults import FAULT_RULE, faults_part
from vgyro.report.recordings.section import recordings_part
from vgyro.report.recordings.series import correlation_table, rates_plots, temperature_plot
from vgyro.report.sentences import Conclusion
from vgyro.report.volatility.arch import ARCH_RULE
from vgyro.report.volatility.section import volatility_part


def render_dataset(dataset: DatasetPart) -> str:
    """reports/<dataset>.html as text."""
    sections = [
        Section("conclusions", "What to conclude", _conclusions(conclude(dataset))),
        Section("recordings", "What was measured, and how complete it is", recordings_part(dataset)),
        Section("calibration", "Calibration", calibration_part(dataset)),
        *_array_sections(dataset),
        Section("conventions", "Conventions", conventions_part(dataset)),
        Section("provenance", "Provenance", provenance_part(dataset)),
    ]
    manifest = dataset.manifest
    simulated: bool | str = manifest.simulated
    if manifest.simulated and manifest.twin:
        simulated = f"twin {manifest.twin}"
    board = dataset.board
    axes = ", ".join(f"{axis} ({len(board.array(axis))})" for axis in board.axes)
    subtitle = f"{dataset.name} · board {board.title or board.name} · gyros by axis: {axes}"
    return render_page(dataset.title, sections, simulated=simulated, subtitle=subtitle)


def _conclusions(found: list[Conclusion]) -> Markup:
    if not found:
        return paragraph("Nothing can be concluded: no recording could be analysed.", "bad")
    rules = details("Rules behind these sentences", bullets([BAD_RULE, FAULT_RULE, *BEST_RULES, MOVED_RULE, ARCH_RULE]))
    return join(macro("conclusions", found=tuple(found)), rules)


def _array_sections(dataset: DatasetPart) -> list[Section]:
    """One section an axis, one part a recording; the first part of each axis is open."""
    sections = []
    for axis in dataset.board.axes:
        arrays = [array for array in dataset.arrays if array.axis == axis]
        children = tuple(_child(dataset, array, number == 0) for number, array in enumerate(arrays))
        gyros = ", ".join(gyro.name for gyro in dataset.board.array(axis))
        empty = Markup("") if children else paragraph("No recording of this axis could be analysed.", "note")
        sections.append(Section(f"axis-{axis}", f"Axis {axis}", empty, children, aside=gyros))
    return sections


def _child(dataset: DatasetPart, array: ArrayPart, opened: bool) -> Section:
    recording = dataset.recording(array.recording)
    first = next(part for part in recording.arrays) is array
    html = join(
        rates_plots(recording, array),
        temperature_plot(recording) if first else "",
        delays_part(recording, array),
        faults_part(dataset, array),
        heading("Correlation", 4),
        correlation_table(recording, array),
        cross_allan_plot(array),
        volatility_part(array),
        heading("Noise", 4),
        allan_plot(array),
        spectrum_plot(array),
        tones_table(array),
        heading("Methods", 4),
        rest_tables(dataset, array),
        moved_table(dataset, array),
        dynamic_table(dataset, array),
        response_table(dataset, array),
        crosscheck_part(array),
        more_gyros_part(dataset, array),
    )
    return Section(array.anchor, recording.name, html, aside=recording.kind, opened=opened)


def headline(dataset: DatasetPart) -> dict[str, Any]:
    """The line of a data set in the overview, as a JSON record."""
    bad = bad_gyros(dataset)
    best = _best_of_all(dataset)
    usable = [part for part in dataset.recordings if part.usable]
    suspect = any(part.status == "suspect" for part in usable)
    failed = recommended_failed(dataset)
    return {
        "dataset": dataset.name,
        "title": dataset.title,
        "board": dataset.board.name,
        "simulated": dataset.manifest.simulated,
        "gyros": len(dataset.board.gyros),
        "axes": list(dataset.board.axes),
        "recordings": len(dataset.recordings),
        "refused": [part.name for part in dataset.recordings if not part.usable],
        "duration_s": sum(float(part.integrity.get("duration_s") or 0) for part in usable),
        "scale": _scale(dataset),
        "bad_gyros": [{"gyro": one.gyro, "axis": one.axis, "figure": one.figure, "factor": one.factor} for one in bad],
        "best": best and _record(best),
        "status": "refused"
        if not usable
        else "suspect"
        if suspect or failed or len(usable) < len(dataset.recordings)
        else "good",
        "recommended_failed": failed,
    }


def _scale(dataset: DatasetPart) -> str:
    unmeasured = nominal(dataset)
    if not unmeasured:
        return "measured"
    return "nominal" if len(unmeasured) == len(dataset.board.gyros) else "partly nominal"


def _best_of_all(dataset: DatasetPart) -> BestMethod | None:
    found = [best for array in main_arrays(dataset) if (best := best_of_all(array)) is not None]
    return max(found, key=lambda best: best.factor.value, default=None)


def _record(best: BestMethod) -> dict[str, Any]:
    limits = {name: _finite(getattr(best.factor, name)) for name in ("value", "low", "high")}
    return {"label": best.label, "axis": best.axis, "recording": best.recording, "figure": best.figure, **limits}


def _finite(value: float) -> float | None:
    return value if value == value and abs(value) != float("inf") else None

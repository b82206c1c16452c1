"""The conventions behind every figure, and where the page comes from."""

from __future__ import annotations

from collections.abc import Mapping

from markupsafe import Markup

from vgyro.figure import Figure
from vgyro.report.html import definitions, details, join, paragraph
from vgyro.report.model import DatasetPart, Record
from vgyro.report.numbers import percent, plain
from vgyro.report.tables import Cell, TableColumn, render_table

CONVENTIONS = (
    ("Allan model", "σ² = 3Q²/τ² + N²/τ + (2 ln2/π)B² + K²τ/3 + R²τ²/2, τ in s, rate in deg/s; overlapping estimator"),
    ("spectrum", "two-sided: N², B²/(2πf), K²/(2πf)²; a one-sided Welch density is √2 larger, and plots show that one"),
    ("ARW, N", "N [deg/√h] = 60·N [deg/s/√Hz, two-sided]; “read at 1 s” is another figure: a low-pass lowers it"),
    ("density / N", "two-sided density of the spectrum's floor over N from the Allan curve: two ways to one figure"),
    ("RRW, K", "K [deg/h/√h] = 60·K [deg/h/√s]"),
    ("bias instability, B", "flicker coefficient, min σ/0.664 where the curve has a flat floor"),
    ("bias drift", "the papers' name for the minimum of the Allan curve, min σ, given with its τ"),
    ("Q, R", "part of the model only where the curve gives evidence of them; else an upper limit, “< x”"),
    ("improvement factor", "mean over the single gyros / figure of the virtual gyro (Liu et al. 2015, eq. 18)"),
    ("bandwidth", "−3 dB and noise-equivalent, one-sided, of the method alone; DC gain 1: a constant rate passes"),
)  # fmt: skip
BLOCK_WORDS = (
    "length by the rule for an AR(1) series with the correlation length of the data (Carlstein 1986; Politis and White "
    "2004), at most an eighth of the recording"
)
CALIBRATION_WORDS = (
    "one least-squares line through all points, both directions; noise of the points taken off each size; a size below "
    "the floor, which a perfect gyro would show by its noise, is given as an upper limit"
)


def conventions_part(dataset: DatasetPart) -> Markup:
    """The conventions, and the meaning of each figure."""
    pairs = [*CONVENTIONS, *_chosen(dataset.options), ("calibration", CALIBRATION_WORDS)]
    return join(
        definitions(pairs),
        _meanings("Meaning of every figure", dataset.figures),
        _meanings("Meaning of every figure of a calibration", dataset.calibration_figures),
    )


def _chosen(options: Record) -> list[tuple[str, str]]:
    """Conventions that depend on the options of the analysis."""
    metrics = options.get("metrics") or {}
    confidence = percent(float(metrics.get("confidence", 0.95)))
    threshold = metrics.get("outlier_threshold")
    outliers = (
        "none is left out"
        if threshold is None
        else f"single samples more than {plain(float(threshold))} standard deviations off are counted and left out of "
        "Allan deviation and spectrum"
    )
    bandwidth = metrics.get("equal_bandwidth_hz")
    to = "the narrowest of the methods" if bandwidth is None else f"{plain(float(bandwidth))} Hz"
    lost = plain(float(metrics.get("most_lost_s", 0.0)))
    return [
        ("equal bandwidth", f"every series low-passed to one bandwidth, {to}, with DC gain 1, before its 1σ is taken"),
        (
            "intervals",
            f"{confidence}: chi² with equivalent degrees of freedom (Greenhall and Riley) for Allan deviations, "
            "parametric bootstrap for the coefficients, moving-block bootstrap else",
        ),
        (
            "paired",
            "all series of an improvement factor are resampled in the same blocks; “not significant”: it may be 1",
        ),
        ("blocks", BLOCK_WORDS),
        (
            "gaps",
            f"nothing is put in place of a lost sample; an average goes over losses of up to {lost} s, at the true "
            "times, where at least 90 % of each half is there; a longer loss is never bridged",
        ),
        ("outliers", outliers),
    ]


def _meanings(title: str, figures: Mapping[str, Figure]) -> Markup:
    rows = [[Cell(figure.title), Cell(figure.unit), Cell(figure.meaning)] for figure in figures.values()]
    columns = [
        TableColumn("figure", numeric=False),
        TableColumn("unit", numeric=False),
        TableColumn("meaning", numeric=False),
    ]
    return details(title, render_table(columns, rows)) if rows else Markup("")


def provenance_part(dataset: DatasetPart) -> Markup:
    """Files with their hashes, hashes of the options and of the code of each artefact, the options."""
    files = [
        [
            Cell(recording.name),
            Cell(str(entry.get("name", ""))),
            Cell(f"{entry.get('bytes', 0):,}"),
            _hash(entry.get("sha256")),
        ]
        for recording in dataset.recordings
        for entry in recording.integrity.get("files") or []
    ]
    artefacts = [
        [Cell(path), Cell(str(record.get("schema", ""))), *(_hash(value) for value in _hashes(record))]
        for path, record in dataset.sources.items()
    ]
    words = "The same files, options and code give the same page, byte for byte. Hashes are the first of SHA-256."
    parts: list[Markup | str] = [paragraph(words)]
    if files:
        columns = [
            TableColumn("recording", numeric=False),
            TableColumn("file", numeric=False),
            TableColumn("bytes"),
            TableColumn("SHA-256", numeric=False),
        ]
        parts.append(details("Data files", render_table(columns, files, compact=True)))
    if artefacts:
        names = ("artefact", "schema", "inputs", "options", "code")
        columns = [TableColumn(name, numeric=False) for name in names]
        parts.append(details("Artefacts", render_table(columns, artefacts, compact=True)))
    parts.append(details("Analysis options", definitions(_flat(dataset.options))))
    return join(*parts)


def _hashes(record: Record) -> tuple[str, str, str]:
    provenance = record.get("provenance") or {}
    inputs = ", ".join(f"{name} {str(value)[:8]}" for name, value in sorted((provenance.get("inputs") or {}).items()))
    return inputs, str(provenance.get("options") or ""), str(provenance.get("code") or "")


def _hash(value: object) -> Cell:
    text = str(value or "—")
    short = text if " " in text else text[:12]
    return Cell(short, hint=text if text != short else "")


def _flat(options: object, prefix: str = "") -> list[tuple[str, str]]:
    if isinstance(options, dict):
        return [
            pair for key, value in options.items() for pair in _flat(value, f"{prefix}.{key}" if prefix else str(key))
        ]
    if isinstance(options, list | tuple):
        return [(prefix, ", ".join(map(str, options)))]
    return [(prefix, "not set" if options is None else str(options))]

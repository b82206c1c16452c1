"""What an ARCH effect of each gyro's level is: the verdicts of effects.parquet, as a table and in one sentence."""

from __future__ import annotations

from markupsafe import Markup

from vgyro.report.model import ArrayPart, rows_of
from vgyro.report.tables import Cell, TableColumn, Tone, render_table

# First word of each part of a verdict → tone; any other first word says why there is none.
TONES: dict[str, Tone] = {
    "heteroskedastic": "bad",
    "drift": "warn",
    "tone": "warn",
    "disturbance": "warn",
    "disturbances": "warn",
    "correlation": "warn",
    "nothing": "good",
}
SHORT = {"disturbance": "disturbance", "disturbances": "disturbance"}
ARCH_RULE = (
    "An ARCH effect of the level is called heteroskedastic only where the series without drift, tones, correlation and "
    "short disturbances still rejects; else it is called what makes the test reject. The levels of the tests are such "
    "that white noise gets any verdict but “nothing” in less than 5 % of cases."
)
COLUMNS = (
    TableColumn("gyro", numeric=False),
    TableColumn("verdict", numeric=False),
    TableColumn("why", numeric=False, wide=True),
)


def verdicts(array: ArrayPart) -> dict[str, list[str]]:
    """Verdict → gyros, without the times of disturbances; empty where there was no test."""
    found: dict[str, list[str]] = {}
    for row in rows_of(array.tables.get("effects", {})):
        parts = [SHORT.get(_first(part), part) for part in str(row["verdict"]).split(" + ")]
        words = " + ".join(parts) if _first(parts[0]) in TONES else f"no verdict ({row['verdict']})"
        found.setdefault(words, []).append(str(row["gyro"]))
    return found


def _first(part: str) -> str:
    return part.split(" ", 1)[0]


def effects_table(array: ArrayPart) -> Markup:
    """One sentence a gyro; empty where there was no test."""
    table = array.tables.get("effects")
    if table is None or not len(table["gyro"]):
        return Markup("")
    rows = [[Cell(row["gyro"]), _verdict(str(row["verdict"])), Cell(row["sentence"])] for row in rows_of(table)]
    return render_table(COLUMNS, rows, "What the ARCH effect of each gyro's level is")


def _verdict(verdict: str) -> Cell:
    tone = TONES.get(_first(verdict))
    return Cell("no verdict", tone="muted", hint=verdict) if tone is None else Cell(verdict, tone=tone)

"""What an ARCH effect of each gyro's level is: the verdicts of effects.parquet, as a table and in one sentence."""

from __future__ import annotations

from markupsafe import Markup

from vgyro.report.model import ArrayPart, rows_of
from vgyro.report.tables import Cell, Column, Tone, render_table

NOTHING = "nothing"
HETEROSKEDASTIC = "heteroskedastic"
TONES: dict[str, Tone] = {HETEROSKEDASTIC: "bad", NOTHING: "good"}
KNOWN = (HETEROSKEDASTIC, "drift", "tone", NOTHING)
ARCH_RULE = (
    "An ARCH effect is called heteroskedastic only where the whitened series (tones taken out) still rejects at 5 %; "
    "else it is called what explains it: drift, or a tone."
)
COLUMNS = (Column("gyro", numeric=False), Column("verdict", numeric=False), Column("why", numeric=False))


def verdicts(array: ArrayPart) -> dict[str, str]:
    """Gyro → verdict; empty where there was no test."""
    return {str(row["gyro"]): str(row["verdict"]) for row in rows_of(array.tables.get("effects", {}))}


def effects_table(array: ArrayPart) -> Markup:
    """One sentence a gyro; empty where there was no test."""
    table = array.tables.get("effects")
    if table is None or not len(table["gyro"]):
        return Markup("")
    rows = [[Cell(row["gyro"]), _verdict(str(row["verdict"])), Cell(row["sentence"])] for row in rows_of(table)]
    return render_table(COLUMNS, rows, "What the ARCH effect of each gyro's level is")


def _verdict(verdict: str) -> Cell:
    if not set(parts(verdict)) <= set(KNOWN):
        return Cell("no verdict", tone="muted", hint=verdict)
    return Cell(verdict, tone=TONES.get(parts(verdict)[0], "warn"))


def parts(verdict: str) -> list[str]:
    """The words of a verdict, which a + joins."""
    return [word.strip() for word in verdict.split("+")]

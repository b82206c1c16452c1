"""The published tables as data (jiang2012.yaml, liu2015.yaml): every numeric cell as printed, and where ours is found.

A table's cell names its counterpart by a selection: keys of the table, its row, its column and a variant, put over one
another in this order. `artefact` is the kind of table to look in, `value` its column; all other keys must be equal.
A text "$gyro4" in a selection stands for the fourth gyro of the array.
"""

from __future__ import annotations

from functools import cache
from importlib import resources

from pydantic import Field, model_validator

from vgyro.papers.claims import Claim
from vgyro.validation import StrictModel, parse_model

PAPERS: tuple[str, ...] = ("jiang2012", "liu2015")
Selection = dict[str, str | int | bool]


class Heading(StrictModel):
    """A row or a column: its name as printed, the unit of its cells, its part of the selection."""

    name: str
    unit: str | None = None
    select: Selection = Field({})


class Variant(StrictModel):
    """One way to read our figure of a cell; the first that covers a cell is the one its agreement is judged by."""

    name: str
    columns: tuple[str, ...] | None = Field(None, description="columns that it covers; null: all")
    rows: tuple[str, ...] | None = Field(None, description="rows that it covers; null: all")
    compared: bool = Field(True, description="false: another quantity, shown beside the printed one")
    select: Selection = Field({})


class Case(StrictModel):
    """A true rate at which methods are compared.

    name : "{rate}" in it stands for the rate that was added, deg/s;  suffix : behind the name of every artefact
    """

    name: str
    suffix: str = ""


class OwnFigure(Heading):
    """A figure by which methods of ours stand beside the paper's: the smaller the better, or near a target.

    paired         : artefact that holds ratios of the same samples; null: the quotient of two figures, taken as
                     independent, so that its interval is too wide
    target, within : what the figure should be, and how near; null: as small as can be
    """

    paired: str | None = None
    target: float | None = None
    within: float = 0.0


class Beside(StrictModel):
    """Methods of vgyro's own beside the paper's, on the same simulated board.

    rivals : names of the table's rows or columns, extra ones included, that ours are compared with
    """

    methods: tuple[Heading, ...] = Field(min_length=1)
    rivals: tuple[str, ...] = Field(min_length=1)
    figures: tuple[OwnFigure, ...] = Field(min_length=1)
    cases: tuple[Case, ...] = (Case(name=""),)
    note: str = ""


class PublishedTable(StrictModel):
    """number : 1-3, or "text" for figures that stand in the running text; values : as printed, null where no cell is"""

    number: int | str
    title: str
    where: str
    note: str = ""
    unit: str | None = None
    select: Selection = Field({})
    rows: tuple[Heading, ...]
    columns: tuple[Heading, ...]
    values: tuple[tuple[str | None, ...], ...]
    variants: tuple[Variant, ...] = Field(min_length=1)
    extra_rows: tuple[Heading, ...] = Field((), description="rows of ours that the paper does not have")
    extra_columns: tuple[Heading, ...] = Field((), description="columns of ours that the paper does not have")
    beside: Beside | None = Field(None, description="methods of ours beside the paper's")

    @model_validator(mode="after")
    def _shape(self) -> PublishedTable:
        if len(self.values) != len(self.rows):
            raise ValueError(f"table {self.number}: {len(self.rows)} rows are named, {len(self.values)} are given")
        for row, values in zip(self.rows, self.values, strict=True):
            if len(values) != len(self.columns):
                raise ValueError(f"table {self.number}, {row.name}: {len(values)} values, {len(self.columns)} columns")
        for row in self.rows:
            for column in self.columns:
                if row.unit is None and column.unit is None and self.unit is None:
                    raise ValueError(f"table {self.number}: {row.name} / {column.name} has no unit")
        self.rivals()
        return self

    def rivals(self) -> tuple[Heading, ...]:
        """The headings that methods of ours are compared with.  raises : ValueError for a name that is not there"""
        names = self.beside.rivals if self.beside else ()
        known = {one.name: one for one in (*self.rows, *self.columns, *self.extra_rows, *self.extra_columns)}
        unknown = [name for name in names if name not in known]
        if unknown:
            raise ValueError(f"table {self.number} has no {unknown[0]!r} to compare with")
        return tuple(known[name] for name in names)

    def unit_of(self, row: Heading, column: Heading) -> str:
        """Unit of a cell: the row's, else the column's, else the table's."""
        return row.unit or column.unit or self.unit or ""

    def text(self, row: str, column: str) -> str | None:
        """A cell as printed, by the names of its row and column."""
        rows, columns = [heading.name for heading in self.rows], [heading.name for heading in self.columns]
        return self.values[rows.index(row)][columns.index(column)]

    def number_at(self, row: str, column: str) -> float:
        """A cell as a number.  raises : ValueError if the paper prints none there"""
        text = self.text(row, column)
        if text is None:
            raise ValueError(f"table {self.number} prints nothing at {row} / {column}")
        return float(text)


class Setting(StrictModel):
    """A setting that the paper states, and how the twin takes it."""

    name: str
    printed: str
    twin: str


class Paper(StrictModel):
    """One paper: its tables, its settings, its claims, and what cannot be had again."""

    name: str
    title: str
    citation: str
    settings: tuple[Setting, ...]
    tables: tuple[PublishedTable, ...]
    claims: tuple[Claim, ...]
    limits: tuple[str, ...] = Field(description="what could not be reproduced, and why")

    def table(self, number: int | str) -> PublishedTable:
        """The table of that number."""
        return next(table for table in self.tables if table.number == number)


@cache
def load_paper(name: str) -> Paper:
    """Read one of PAPERS from the package's data.

    raises : KeyError for another name; InvalidFile if the data are wrong
    """
    if name not in PAPERS:
        raise KeyError(f"no paper {name!r}; known: {', '.join(PAPERS)}")
    text = resources.files("vgyro.papers").joinpath(f"{name}.yaml").read_text(encoding="utf-8")
    return parse_model(text, Paper, f"vgyro/papers/{name}.yaml")


def half_unit(text: str) -> float:
    """Half a unit of the last printed digit: how far rounding can have moved the number ("4.94e-4" → 5e-7)."""
    mantissa, _, exponent = text.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return float(0.5 * 10.0 ** ((int(exponent) if exponent else 0) - decimals))

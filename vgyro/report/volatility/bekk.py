"""DCC against its alternatives on a sample of windows: CCC and both kinds of BEKK, by BIC and by how they weigh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from vgyro.arrays import Floats
from vgyro.report.html import join, paragraph
from vgyro.report.model import ArrayPart, Table
from vgyro.report.numbers import MISSING, count, significant
from vgyro.report.tables import Cell, TableColumn, TableRow, render_table

TITLES = {"ccc": "CCC", "dcc": "DCC", "bekk_scalar": "BEKK, scalar", "bekk_diagonal": "BEKK, diagonal"}
OURS = "dcc"
CAPTION = "DCC against its alternatives on a random sample of windows"
BY_BIC, BY_WEIGHTS = "fit to the window", "weights carried on over the next step"
COLUMNS = (
    TableColumn("", numeric=False),
    TableColumn("windows", hint="of the sample, in which all four models could be compared"),
    TableColumn("parameters"),
    TableColumn("Δ log-likelihood", hint="median of the windows, less that of DCC", group=BY_BIC),
    TableColumn("Δ BIC", hint="median of the windows, less that of DCC; less is better", group=BY_BIC),
    TableColumn("least BIC", hint="windows in which it has the least BIC of the four", group=BY_BIC),
    TableColumn("1σ", "deg/s", hint="r.m.s. of the fused r_t over the step after the window", group=BY_WEIGHTS),
    TableColumn("1σ / DCC", hint="geometric mean over the windows, least and greatest", group=BY_WEIGHTS),
    TableColumn("less than DCC", hint="windows in which its 1σ is less than that of DCC", group=BY_WEIGHTS),
)
WORDS = (
    "Δ: median of the windows, less that of DCC. BEKK(1,1): H_t = CC' + A r r'A + B H B with A and B multiples of the "
    "identity (scalar) or diagonal, fitted by Gaussian likelihood; CCC and DCC as the engine fitted them, in two "
    "steps, so that their likelihood is not quite the greatest. The 1σ of r_t is taken about zero, the mean of these "
    "models. A model weighs better than DCC where the geometric mean is below 1 and its 1σ is less in at least three "
    "quarters of the windows."
)
MOST_WINDOWS = 0.75


@dataclass(frozen=True)
class ComparedFits:
    """One model over W windows: log-likelihood, BIC and 1σ, each [W], DCC's own beside them; least [W] of BIC."""

    model: str
    parameters: int
    likelihood: np.ndarray
    bic: np.ndarray
    sigma: np.ndarray
    of_dcc: np.ndarray
    least: np.ndarray

    @property
    def ratio(self) -> Floats:
        """1σ over that of DCC, where both are known."""
        ratio = self.sigma / self.of_dcc
        known: Floats = ratio[np.isfinite(ratio)]
        return known

    @property
    def mean_ratio(self) -> float:
        """Geometric mean of the ratios."""
        return float(np.exp(np.mean(np.log(self.ratio)))) if len(self.ratio) else np.nan

    @property
    def better(self) -> int:
        """Windows in which the 1σ is less than that of DCC."""
        return int((self.ratio < 1).sum())

    @property
    def weighs_better(self) -> bool:
        """By the rule of WORDS."""
        return self.mean_ratio < 1 and self.better >= MOST_WINDOWS * len(self.ratio)


def bekk_part(array: ArrayPart) -> Markup:
    """The table, all definitions of r_t one under the other, and a sentence; empty where there was no sample."""
    table = array.tables.get("bekk")
    if table is None or not len(table["model"]):
        return Markup("")
    rows: list[TableRow] = []
    for definition in dict.fromkeys(table["definition"].tolist()):
        found = compare(table, table["definition"] == definition)
        rows += [
            TableRow(heading=f"definition “{definition}”"),
            *(TableRow(_cells(one)) for one in found if one.parameters),
        ]
    rendered = render_table(COLUMNS, rows, CAPTION, compact=True)
    return join(rendered, paragraph(sentence(compare(table))), paragraph(WORDS, "note"))


def compare(table: Table, rows: np.ndarray | None = None) -> list[ComparedFits]:
    """The models of bekk.parquet, of some of its rows, over the windows in which all four have a BIC."""
    chosen = np.ones(len(table["model"]), dtype=bool) if rows is None else rows
    of = {model: chosen & (table["model"] == model) for model in TITLES}
    bic = np.array([table["bic"][mask] for mask in of.values()], dtype=float)
    known = np.isfinite(bic).all(axis=0)
    least = np.argmin(bic[:, known], axis=0) if known.any() else np.empty(0, dtype=int)

    def column(model: str, name: str) -> Floats:
        values: Floats = np.asarray(table[name][of[model]], dtype=float)[known]
        return values

    def more(model: str, name: str) -> Floats:
        return column(model, name) - column(OURS, name)

    return [
        ComparedFits(
            model, int(column(model, "parameters").max(initial=0)), more(model, "log_likelihood"), more(model, "bic"),
            column(model, "sigma"), column(OURS, "sigma"), least == place,
        )
        for place, model in enumerate(TITLES)
    ]  # fmt: skip


def sentence(found: Sequence[ComparedFits]) -> str:
    """Which has the least BIC in how many windows, and whether an alternative weighs better than DCC."""
    windows = len(found[0].least)
    if not windows:
        return "In no window could all four models be fitted."
    least: Mapping[str, int] = {one.model: int(one.least.sum()) for one in found}
    order = sorted((model for model in least if least[model]), key=lambda model: -least[model])
    wins = ", ".join(f"{TITLES[model]} in {least[model]}" for model in order)
    others = [one for one in found if one.model != OURS and len(one.ratio)]
    better = [one for one in others if one.weighs_better]
    ratios = ", ".join(
        f"{TITLES[one.model]} {significant(one.mean_ratio)} (less in {one.better} of {len(one.ratio)})"
        for one in others
    )
    verdict = f"{' and '.join(TITLES[one.model] for one in better)} weighs better" if better else "none weighs better"
    tail = f" Their 1σ over that of DCC: {ratios}." if ratios else ""
    return (
        f"Of {windows} fits of all definitions the least BIC has {wins}. Of the alternatives to DCC {verdict} in the "
        f"step after the window.{tail}"
    )


def _cells(one: ComparedFits) -> tuple[Cell, ...]:
    ratio = one.ratio
    own = one.model == OURS
    limits = f"{significant(ratio.min())} … {significant(ratio.max())}" if len(ratio) and not own else ""
    sigma = one.sigma[np.isfinite(one.sigma)]
    r_m_s = float(np.sqrt(np.mean(np.square(sigma)))) if len(sigma) else np.nan
    return (
        Cell(TITLES[one.model]),
        Cell(count(len(one.least))),
        Cell(count(one.parameters)),
        Cell(MISSING if own else _difference(one.likelihood)),
        Cell(MISSING if own else _difference(one.bic)),
        Cell(count(int(one.least.sum()))),
        Cell(significant(r_m_s)),
        Cell(MISSING if own else significant(one.mean_ratio), limits, "good" if one.weighs_better else ""),
        Cell(MISSING if own else f"{one.better} of {len(ratio)}"),
    )


def _difference(values: np.ndarray) -> str:
    middle = float(np.median(values))
    return f"+{significant(middle)}" if middle > 0 else significant(middle)

"""Methods of vgyro's own beside those of a paper, on the same simulated board: figures, ratios to the paper's best."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from vgyro.papers.claims import ratio
from vgyro.papers.evidence import Ours, PaperEvidence, look_up
from vgyro.papers.published import Case, Heading, OwnFigure, PublishedTable, Selection

Standing = Literal["better", "undecided", "worse", "met", "missed", "none"]
CASE_RATE = "true_rate"


@dataclass(frozen=True)
class ComparedMethod:
    """One figure of one method.

    case     : in words;  own : the method is vgyro's, not the paper's
    over     : the paper's method that has the least of this figure; empty for the paper's own, and beside a target
    ratio    : figure over that of `over`
    standing : better, worse: the whole interval of the ratio lies below or above 1; undecided: it holds 1.
               Of a figure with a target: met, missed (the whole interval inside or outside of what is allowed)
    """

    case: str
    method: str
    figure: str
    unit: str
    own: bool
    value: Ours
    over: str
    ratio: Ours
    standing: Standing


def set_beside(table: PublishedTable, evidence: PaperEvidence) -> tuple[ComparedMethod, ...]:
    """Every figure of ours and of the paper's methods that the table asks for, case by case; () if it asks for none.

    A case of which no artefact was made is left out.
    """
    beside = table.beside
    if beside is None:
        return ()
    return tuple(
        one for case in beside.cases if _made(table, case, evidence) for one in _of_case(table, case, evidence)
    )


def _made(table: PublishedTable, case: Case, evidence: PaperEvidence) -> bool:
    return not case.suffix or bool(evidence.rows.get(f"{table.select['artefact']}{case.suffix}"))


def _of_case(table: PublishedTable, case: Case, evidence: PaperEvidence) -> Iterator[ComparedMethod]:
    assert table.beside is not None
    rivals, name = table.rivals(), _case_name(table, case, evidence)
    for methods, own in ((table.beside.methods, True), (rivals, False)):
        for method in methods:
            for figure in table.beside.figures:
                value = _figure(table, case, method, figure, evidence)
                over, quotient = Heading(name=""), Ours(math.nan)
                if own and figure.target is None:
                    over, quotient = _over_best(table, case, method, figure, rivals, evidence)
                standing = _near(value, figure) if figure.target is not None else _below_one(quotient)
                yield ComparedMethod(
                    name, method.name, figure.name, table.unit_of(figure, figure), own, value, over.name, quotient,
                    standing if own else "none",
                )  # fmt: skip


def _case_name(table: PublishedTable, case: Case, evidence: PaperEvidence) -> str:
    rows = evidence.rows.get(f"{table.select['artefact']}{case.suffix}", ())
    rate = max((float(row.get(CASE_RATE, 0.0)) for row in rows), default=0.0)
    return case.name.format(rate=f"{rate:g}")


def _select(table: PublishedTable, case: Case, method: Heading, figure: OwnFigure) -> Selection:
    select = {**table.select, **method.select, **figure.select}
    return {**select, "artefact": f"{select['artefact']}{case.suffix}"}


def _figure(table: PublishedTable, case: Case, method: Heading, figure: OwnFigure, evidence: PaperEvidence) -> Ours:
    return look_up(evidence, _select(table, case, method, figure))


def _over_best(
    table: PublishedTable,
    case: Case,
    method: Heading,
    figure: OwnFigure,
    rivals: Sequence[Heading],
    evidence: PaperEvidence,
) -> tuple[Heading, Ours]:
    """The rival with the least of a figure, and the ratio of ours to it."""
    found = [(_figure(table, case, rival, figure, evidence), rival) for rival in rivals]
    known = [(abs(value.value), place) for place, (value, _) in enumerate(found) if value.known]
    if not known:
        return Heading(name=""), Ours(math.nan, reason="the paper's methods have no such figure")
    least, best = found[min(known)[1]]
    if figure.paired is None:
        return best, ratio(_figure(table, case, method, figure, evidence), least)
    of, to = (_select(table, case, one, figure) for one in (method, best))
    place = {key: value for key, value in of.items() if key not in {"absolute", "artefact"}}
    over = {"over_method": to["method"], "over_definition": to["definition"]}
    return best, look_up(evidence, {**place, **over, "artefact": f"{figure.paired}{case.suffix}"})


def _below_one(quotient: Ours) -> Standing:
    if not quotient.known:
        return "none"
    low, high = _limits(quotient)
    return "better" if high < 1.0 else "worse" if low > 1.0 else "undecided"


def _near(value: Ours, figure: OwnFigure) -> Standing:
    if not value.known or figure.target is None:
        return "none"
    low, high = _limits(value)
    least, most = figure.target - figure.within, figure.target + figure.within
    if low >= least and high <= most:
        return "met"
    return "missed" if high < least or low > most else "undecided"


def _limits(value: Ours) -> tuple[float, float]:
    """The limits; the value itself where there are none."""
    if math.isnan(value.low) or math.isnan(value.high):
        return value.value, value.value
    return value.low, value.high

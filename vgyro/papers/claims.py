"""The papers' claims as data, each with a rule by which figures decide it.

A rule sees our figures (Evidence) and figures that follow from the papers' equations (`implied`). A figure with an
interval decides only if the whole interval lies on one side of the bound; a straddling one leaves the claim undecided.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from vgyro.papers.evidence import Ours, PaperEvidence, look_up
from vgyro.validation import StrictModel

Outcome = Literal["holds", "does not hold", "cannot be decided"]
HOLDS: Outcome = "holds"
FAILS: Outcome = "does not hold"
OPEN: Outcome = "cannot be decided"
Selection = dict[str, str | int | bool]
EACH = "$each"
# So many reasons are given in full.
FEW = 2


class Bounded(StrictModel):
    """What a figure must satisfy: above < figure < below; `means` names the figure for people."""

    means: str
    above: float | None = None
    below: float | None = None

    @model_validator(mode="after")
    def _bounded(self) -> Bounded:
        if self.above is None and self.below is None:
            raise ValueError(f"the rule on {self.means!r} needs above or below")
        return self

    def needs(self) -> str:
        """The bounds in words."""
        if self.above is not None and self.below is not None:
            return f"between {self.above:g} and {self.below:g}"
        return f"above {self.above:g}" if self.above is not None else f"below {self.below:g}"


class ValueRule(Bounded):
    """One figure against bounds; with "$each" in the selection, the figure of every gyro.

    undecided_if_not : why a figure outside the bounds proves nothing (a test without power); null: then it fails
    """

    kind: Literal["value"]
    figure: Selection
    undecided_if_not: str | None = None


class RatioRule(Bounded):
    """One figure over another. The interval takes the two as independent; they share noise, so that it is too wide.

    paired : both are the same samples through filters that pass the slow part alike, so that they share nearly all
             their scatter: the ratio itself decides
    """

    kind: Literal["ratio"]
    paired: bool = False
    of: Selection
    to: Selection


class ImpliedRule(Bounded):
    """A figure that follows from the paper's own equations or tables."""

    kind: Literal["implied"]
    figure: str


class BuiltInRule(StrictModel):
    """The twin was built with this property, so that it cannot test it."""

    kind: Literal["built_in"]
    because: str


class AllRule(StrictModel):
    """Holds if every part holds, fails if one part fails."""

    kind: Literal["all"]
    rules: tuple[Annotated[ValueRule | RatioRule | ImpliedRule, Field(discriminator="kind")], ...] = Field(min_length=1)


Rule = Annotated[ValueRule | RatioRule | ImpliedRule | BuiltInRule | AllRule, Field(discriminator="kind")]


class Claim(StrictModel):
    """text : the claim in our words;  comment : a sentence for each verdict that wants one"""

    name: str
    text: str
    where: str
    rule: Rule
    comment: dict[Outcome, str] = Field({})


@dataclass(frozen=True)
class Verdict:
    """outcome and the sentence that gives the reason."""

    outcome: Outcome
    reason: str


def judge(claim: Claim, evidence: PaperEvidence, implied: Mapping[str, float]) -> Verdict:
    """Decide one claim.  implied : name → figure that follows from the equations (vgyro.papers.implied.FIGURES)"""
    verdict = _judge_rule(claim.rule, evidence, implied)
    comment = claim.comment.get(verdict.outcome, "")
    return Verdict(verdict.outcome, f"{verdict.reason}; {comment}" if comment else verdict.reason)


def _judge_rule(rule: Any, evidence: PaperEvidence, implied: Mapping[str, float]) -> Verdict:
    if isinstance(rule, BuiltInRule):
        return Verdict(OPEN, rule.because)
    if isinstance(rule, AllRule):
        return _all([_judge_rule(part, evidence, implied) for part in rule.rules])
    if isinstance(rule, ImpliedRule):
        return _decide(rule, Ours(implied[rule.figure]))
    if isinstance(rule, RatioRule):
        return _decide(rule, ratio(look_up(evidence, rule.of), look_up(evidence, rule.to), rule.paired))
    each = [key for key, value in rule.figure.items() if value == EACH]
    if not each:
        return _decide(rule, look_up(evidence, rule.figure))
    if not evidence.gyros:
        return Verdict(OPEN, f"{rule.means}: no gyros are known")
    return _all([
        _decide(rule, look_up(evidence, {**rule.figure, **dict.fromkeys(each, gyro)}), gyro) for gyro in evidence.gyros
    ])  # fmt: skip


def _decide(rule: Bounded, figure: Ours, of: str = "") -> Verdict:
    means = f"{rule.means} of {of}" if of else rule.means
    if not figure.known:
        return Verdict(OPEN, f"{means} is missing ({figure.reason})")
    has_limits = not (math.isnan(figure.low) or math.isnan(figure.high))
    low, high = (figure.low, figure.high) if has_limits else (figure.value, figure.value)
    limits = f" [{low:.4g}, {high:.4g}]" if has_limits else ""
    reason = f"{means} is {figure.value:.4g}{limits}, and the claim needs {rule.needs()}"
    if (rule.above is None or low > rule.above) and (rule.below is None or high < rule.below):
        return Verdict(HOLDS, reason)
    if (rule.above is not None and high <= rule.above) or (rule.below is not None and low >= rule.below):
        excuse = getattr(rule, "undecided_if_not", None)
        return Verdict(OPEN, f"{reason}: {excuse}") if excuse else Verdict(FAILS, reason)
    return Verdict(OPEN, f"{reason}: the interval lies on both sides")


def _all(parts: list[Verdict]) -> Verdict:
    """The worst part decides; its reason is the reason."""
    outcomes: tuple[Outcome, ...] = (FAILS, OPEN)
    for outcome in outcomes:
        worst = [part for part in parts if part.outcome == outcome]
        if worst:
            more = f" (and {len(worst) - 1} more of {len(parts)} like it)" if len(worst) > 1 else ""
            return Verdict(worst[0].outcome, worst[0].reason + more)
    reasons = list(dict.fromkeys(part.reason for part in parts))
    more = f" (and {len(reasons) - FEW} more like it)" if len(reasons) > FEW else ""
    return Verdict(HOLDS, "; ".join(reasons[:FEW]) + more)


def ratio(of: Ours, to: Ours, paired: bool = False) -> Ours:
    """One figure over another, limits by independent relative half-widths in quadrature.

    No limits if either figure has none, or if the two are `paired`.
    """
    for part in (of, to):
        if not part.known:
            return part
    if to.value == 0.0:
        return Ours(math.nan, reason="the denominator is 0")
    value = of.value / to.value
    if paired or of.value <= 0.0 or to.value <= 0.0:
        return Ours(value)
    below = value * (1.0 - math.hypot((of.value - of.low) / of.value, (to.high - to.value) / to.value))
    above = value * (1.0 + math.hypot((of.high - of.value) / of.value, (to.value - to.low) / to.value))
    return Ours(value, max(below, 0.0) if not math.isnan(below) else below, above)

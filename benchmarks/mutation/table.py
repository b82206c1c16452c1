"""The outcomes as Markdown: the share that is killed, by kind, and the survivors."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.mutation.run import Outcome
from benchmarks.mutation.sample import Entry


def as_markdown(sample: Sequence[Entry], outcomes: dict[int, Outcome]) -> str:
    """Of the mutants that were run and are not equivalent to the original."""
    counted = [one for one in sample if one.mutant in outcomes and not one.equivalent]
    killed = [one for one in counted if outcomes[one.mutant].killed]
    lines = [_share("all", len(killed), len(counted))]
    for kind in sorted({one.name[2] for one in counted}):
        of_kind = [one for one in counted if one.name[2] == kind]
        lines.append(_share(kind, sum(one in killed for one in of_kind), len(of_kind)))
    equivalent = sum(bool(one.equivalent) for one in sample)
    text = [
        "| kind | killed | of | share | 95 % interval |", "|---|---:|---:|---:|---|", *lines, "",
        f"{equivalent} of {len(sample)} are equivalent to the original and not counted; "
        f"{len(sample) - equivalent - len(counted)} were not run.", "",
        "| mutant | module | function | change | line | tests |", "|---:|---|---|---|---|---:|",
    ]  # fmt: skip
    for one in counted:
        if not outcomes[one.mutant].killed:
            module, function, _, line, change, _ = one.name
            cells = (str(one.mutant), module, function, change, f"`{line}`", str(outcomes[one.mutant].tests))
            text.append("| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |")
    return "\n".join(text) + "\n"


def _share(name: str, killed: int, of: int) -> str:
    low, high = interval(killed, of)
    share = f"{100 * killed / of:.0f} %" if of else ""
    return f"| {name} | {killed} | {of} | {share} | {100 * low:.0f} … {100 * high:.0f} % |"


def interval(killed: int, of: int, confidence: float = 0.95) -> tuple[float, float]:
    """Of a share, by the binomial distribution: Clopper and Pearson (1934), Biometrika 26(4)."""
    from scipy.stats import beta

    tail = (1.0 - confidence) / 2.0
    low = float(beta.ppf(tail, killed, of - killed + 1)) if killed else 0.0
    high = float(beta.ppf(1.0 - tail, killed + 1, of - killed)) if killed < of else 1.0
    return low, high

"""The tables and claims of the two papers as data, what follows from their equations, and how they are judged.

Jiang et al. (2012), Sensors 12, 1720-1737, and Liu et al. (2015), Micromachines 6, 684-698 (see the YAML files).
"""

from __future__ import annotations

from vgyro.papers.claims import Claim, Verdict, judge
from vgyro.papers.compare import ComparedCell, Comparison, compare, csv_of
from vgyro.papers.evidence import Ours, PaperEvidence, look_up, with_single
from vgyro.papers.implied import Implied
from vgyro.papers.published import PAPERS, Paper, PublishedTable, load_paper

__all__ = [
    "PAPERS",
    "Claim",
    "ComparedCell",
    "Comparison",
    "Implied",
    "Ours",
    "Paper",
    "PaperEvidence",
    "PublishedTable",
    "Verdict",
    "compare",
    "csv_of",
    "judge",
    "load_paper",
    "look_up",
    "with_single",
]

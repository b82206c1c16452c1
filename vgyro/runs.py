"""Runs: stretches of neighbouring samples that are alike, such as the gap-free ones of a recording."""

from __future__ import annotations

import numpy as np


def run_starts(*marks: np.ndarray) -> np.ndarray:
    """First sample of each run in which none of the marks [T] changes: int [R]; the first is 0, where T > 0."""
    changes = np.zeros(max(len(marks[0]) - 1, 0), dtype=bool)
    for mark in marks:
        changes |= mark[1:] != mark[:-1]
    starts = np.flatnonzero(changes) + 1
    return np.append(0, starts) if len(marks[0]) else starts


def runs(*marks: np.ndarray) -> np.ndarray:
    """Runs in which none of the marks [T] changes: int [R, 2], first sample and one beyond the last."""
    starts = run_starts(*marks)
    return np.column_stack((starts, np.append(starts[1:], len(marks[0]))[: len(starts)]))


def true_runs(mask: np.ndarray) -> np.ndarray:
    """Runs in which a mask [T] is true: int [R, 2], first sample and one beyond the last."""
    return np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)

"""GARCH and DCC of many windows of one series, and the models that their weights are made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np

from vgyro import engine as engines
from vgyro.config import Definition
from vgyro.engine.models import (
    DCC_STATUSES,
    FAILED,
    GARCH_STATUSES,
    NOT_POSITIVE_DEFINITE,
    TOO_SHORT,
    DccWindows,
    GarchWindows,
)
from vgyro.volatility.batches import fitted_batch
from vgyro.volatility.rolling import WindowModels
from vgyro.volatility.windowed import MIN_SAMPLES, fit_array_dcc_windows

Arrays = TypeVar("Arrays", GarchWindows, DccWindows)
NOTES = {
    DCC_STATUSES.index(NOT_POSITIVE_DEFINITE): "correlation not positive definite, taken as 0",
    DCC_STATUSES.index(FAILED): "DCC failed, correlation taken as constant",
}


@dataclass(frozen=True)
class WindowFits:
    """The fits of K windows, in their order."""

    garch: GarchWindows
    dcc: DccWindows


def fit_windows(
    values: np.ndarray,
    starts: np.ndarray,
    length: int,
    definition: Definition,
    span: int = 15,
    stretch_starts: np.ndarray | None = None,
    engine: str = "native",
) -> WindowFits:
    """Fit GARCH(1,1) to each gyro and DCC(1,1) to the array, in K windows of one length.

    values, starts, stretch_starts : as in vgyro.volatility.batches.fitted_batch, but in any mixture
    engine : name of the engine
    A window of fewer than MIN_SAMPLES samples is not fitted: status `too short`.
    """
    n = values.shape[1]
    if length < MIN_SAMPLES or len(starts) == 0:
        return _nothing(len(starts), n)
    first_of_all = starts if stretch_starts is None else stretch_starts
    # A window at the start of its stretch has one difference fewer than the others.
    begins = (starts == first_of_all) & (definition == "difference")
    groups = [np.flatnonzero(mask) for mask in (begins, ~begins) if mask.any()]
    fits = []
    for group in groups:
        r = fitted_batch(values, starts[group], length, definition, span, first_of_all[group])
        garch = engines.get(engine).garch.fit_garch_windows(r)
        fits.append((garch, fit_array_dcc_windows(r, garch, engine)))
    order = np.argsort(np.concatenate(groups))
    return WindowFits(_joined([garch for garch, _ in fits], order), _joined([dcc for _, dcc in fits], order))


def _joined(parts: Sequence[Arrays], order: np.ndarray) -> Arrays:
    if len(parts) == 1:
        return parts[0]
    kind = type(parts[0])
    names = [field.name for field in fields(kind)]
    return kind(**{name: np.concatenate([getattr(part, name) for part in parts])[order] for name in names})


def _nothing(count: int, n: int) -> WindowFits:
    def nan(*shape: int) -> np.ndarray:
        return np.full((count, *shape), np.nan)

    garch_status = np.full((count, n), GARCH_STATUSES.index(TOO_SHORT), dtype=np.uint8)
    dcc_status = np.full(count, DCC_STATUSES.index(TOO_SHORT), dtype=np.uint8)
    garch = GarchWindows(nan(n), nan(n), nan(n), nan(n, 3), nan(n), garch_status)
    return WindowFits(garch, DccWindows(nan(), nan(), nan(2), nan(2), nan(n, n), nan(), nan(), nan(), dcc_status))


def window_models(fits: WindowFits, starts: np.ndarray, length: int, gyros: Sequence[str]) -> WindowModels:
    """The models of K windows, with what is to be said beside their weights.

    starts [K] : first sample of each window in the series;  gyros : names, for the notes
    """
    garch, dcc = fits.garch, fits.dcc
    lost = ~np.isfinite(garch.omega)
    told = np.where(np.isin(dcc.status, list(NOTES)), dcc.status, 255)
    # Few windows have anything to tell, and many of those the same.
    marks = np.column_stack([np.where(lost, garch.status, 255), told])
    kinds, place = np.unique(marks, axis=0, return_inverse=True)
    words = [_note(kind, gyros) for kind in kinds]
    notes = ("", *dict.fromkeys(word for word in words if word))
    note = np.array([notes.index(word) for word in words], dtype=np.int64)[place.ravel()]
    a, b = np.nan_to_num(dcc.a), np.nan_to_num(dcc.b)
    return WindowModels(starts, length, garch.omega, garch.alpha, garch.beta, a, b, dcc.target, note, notes)


def _note(mark: np.ndarray, gyros: Sequence[str]) -> str:
    missing = [
        f"without {gyro}: {GARCH_STATUSES[code]}" for gyro, code in zip(gyros, mark[:-1], strict=True) if code != 255
    ]
    told = [NOTES[int(mark[-1])]] if mark[-1] != 255 else []
    return "; ".join([*missing, *told])

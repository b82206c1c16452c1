"""Rolling windows: which window's model gives the weights of which sample (Liu et al. 2015, sections 4 and 5)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Bools, Floats
from vgyro.config import CorrelationModel, Definition, Mode
from vgyro.engine.models import NO_VARIANCE, NOT_POSITIVE_DEFINITE, ConditionalWeights
from vgyro.volatility.batches import WindowPlaces, window_batch
from vgyro.volatility.stretches import Window

OK = "ok"
NO_MODEL_YET = "no model yet"
_OK, _NO_MODEL_YET, _SINGULAR, _TOO_SHORT, _NO_VARIANCE = range(5)

PIECE = 512
"""Windows that are weighed in one call of the engine."""


@dataclass(frozen=True)
class WindowModels:
    """The fitted models of K windows of one length, in the order of the series.

    start [K] : first sample of each window in the series;  length : samples of a window
    omega (deg/s)², alpha, beta : [K, N]; NaN for a gyro that has no model: its weight is 0
    a, b [K], target [K, N, N]  : DCC, finite for the gyros that have a model (the identity where S was singular)
    note [K]  : what to say beside the weights, a place in `notes`; notes[0] is "", nothing
    """

    start: np.ndarray
    length: int
    omega: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    a: np.ndarray
    b: np.ndarray
    target: np.ndarray
    note: np.ndarray
    notes: tuple[str, ...] = ("",)

    def part(self, chosen: np.ndarray | slice) -> WindowModels:
        """Some of the windows."""
        names = ("start", "omega", "alpha", "beta", "a", "b", "target", "note")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


@dataclass(frozen=True)
class WindowWeights:
    """Weights of the samples begin, begin + 1, … of the series.

    weights [E, N]; sigma [E] = √(w'Hw) and deviation [E, N] = √h, deg/s, NaN without a model
    status [E] : places in `statuses`
    """

    begin: int
    weights: np.ndarray
    sigma: np.ndarray
    deviation: np.ndarray
    status: np.ndarray
    statuses: tuple[str, ...]


def weights_of_windows(
    values: np.ndarray,
    models: WindowModels,
    runs: Sequence[Window],
    definition: Definition,
    modes: Sequence[Mode],
    correlation: CorrelationModel,
    step: int,
    span: int = 15,
    engine: str = "native",
    offset: int = 0,
    too_short: str = "too short",
) -> dict[Mode, WindowWeights]:
    """Weights of the samples that belong to a chunk of consecutive windows, `step` apart.

    values : [m, N] deg/s, samples offset..offset+m-1 of the series, which hold `rows_needed`; NaN where a gyro has no
             value: in a window with one it has no model, and no weight
    models : of the chunk's windows; none only where the whole series holds no window
    runs   : all stretches of the series, in order
    span   : of the definition `residual`
    too_short : status of a stretch that holds no window; its weights are equal

    in_sample : the newest `step` samples of a window take its H_t; the first window of a stretch gives all of its own
    causal    : a window's parameters are carried forward over the `step` samples after it; H_t knows nothing of
                sample t or later. Before the first window of a stretch is complete the weights are equal.
    After the last window of a stretch its model is carried forward to the end, in both modes.
    Stretches without a window belong to the window before them. So chunks put together give the whole series, with the
    same bits whatever the chunks.
    Liu et al. (2015), sections 4 and 5; `causal` is ours.
    """
    place, rows = _Place.of(models, runs, step), _Rows(values, offset)
    statuses = (OK, NO_MODEL_YET, NOT_POSITIVE_DEFINITE, too_short, NO_VARIANCE, *models.notes[1:])
    found = {mode: _blank(place.owned(mode), values.shape[1], statuses) for mode in modes}
    for mode in modes:
        for start, stop in zip(place.run_start[place.first], place.taken(mode)[0][place.first], strict=True):
            found[mode].status[start - found[mode].begin : stop - found[mode].begin] = _NO_MODEL_YET
    for chosen, ranges, gyros in _groups(models, place, modes):
        begin, end = int(ranges[:, 0].min()), int(ranges[:, 1].max())
        part = models.part(chosen)
        weighed = None
        if gyros.any() and begin < end:
            r = _residuals(rows, part, end - part.length, definition, span, place.run_start[chosen])
            some = r if gyros.all() else r[:, :, gyros]
            weighed = _weigh(some, part, gyros, Window(begin, end), correlation, engine)
        for mode, (low, high) in zip(modes, ranges, strict=True):
            _store(found[mode], part, gyros, weighed, slice(low - begin, high - begin), int(low))
    return found


def rows_needed(models: WindowModels, runs: Sequence[Window], step: int) -> Window:
    """The samples of the series that `weights_of_windows` needs for a chunk of windows."""
    if len(models.start) == 0:
        return Window(0, 0)
    place = _Place.of(models, runs, step)
    before = max(int(place.run_start[0]), int(models.start[0]) - 1)
    return Window(before, int(place.taken("causal")[1].max()))


@dataclass(frozen=True)
class _Place:
    """Where K windows lie in their stretches, and which samples are theirs."""

    start: np.ndarray
    stop: np.ndarray
    step: int
    run_start: np.ndarray
    run_stop: np.ndarray
    first: np.ndarray
    last: np.ndarray
    begin: int
    end: int
    """Samples of the stretches that begin, and end, with this chunk, those without a window among them."""

    @staticmethod
    def of(models: WindowModels, runs: Sequence[Window], step: int) -> _Place:
        edges = np.array(runs, dtype=np.int64).reshape(-1, 2)
        start = np.asarray(models.start, dtype=np.int64)
        stop = start + models.length
        run = np.searchsorted(edges[:, 0], start, side="right") - 1
        run_start, run_stop = edges[run].T
        begin, end = 0, int(edges[-1, 1]) if len(edges) else 0
        if len(start):
            holds = np.flatnonzero(edges[:, 1] - edges[:, 0] >= models.length)
            begin = int(run_start[0]) if run[0] > holds[0] else 0
            end = int(edges[holds[holds > run[-1]][0], 0]) if run[-1] < holds[-1] else end
        return _Place(start, stop, step, run_start, run_stop, start == run_start, stop + step > run_stop, begin, end)

    def taken(self, mode: Mode) -> tuple[np.ndarray, np.ndarray]:
        """First sample, and first sample no more, that take their weights from each window."""
        if mode == "causal":
            return self.stop, np.where(self.last, self.run_stop, self.stop + self.step)
        begin = np.where(self.first, self.start, self.stop - self.step)
        return begin, np.where(self.last, self.run_stop, self.stop)

    def owned(self, mode: Mode) -> Window:
        """The samples that this chunk gives."""
        if len(self.start) == 0:
            return Window(self.begin, self.end)
        begin, end = self.taken(mode)
        return Window(
            self.begin if self.first[0] else int(begin[0]),
            self.end if self.last[-1] else int(end[-1]),
        )


def _blank(owned: Window, n: int, statuses: tuple[str, ...]) -> WindowWeights:
    """Equal weights of stretches that are too short."""
    count = owned.length
    return WindowWeights(
        begin=owned.start,
        weights=np.full((count, n), 1 / n),
        sigma=np.full(count, np.nan),
        deviation=np.full((count, n), np.nan),
        status=np.full(count, _TOO_SHORT, dtype=np.int16),
        statuses=statuses,
    )


def _groups(
    models: WindowModels, place: _Place, modes: Sequence[Mode]
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Windows that can be weighed in one call: their numbers, the samples for each mode [modes, 2], their gyros [N].

    Samples are counted from the window's first one.
    """
    if len(models.start) == 0:
        return
    ranges = np.stack([edge - place.start for mode in modes for edge in place.taken(mode)], axis=1)
    gyros = np.isfinite(models.omega)
    alike: dict[tuple[bytes, bytes], list[int]] = {}
    for number in range(len(gyros)):
        alike.setdefault((ranges[number].tobytes(), gyros[number].tobytes()), []).append(number)
    for numbers in alike.values():
        first = numbers[0]
        for start in range(0, len(numbers), PIECE):
            yield np.array(numbers[start : start + PIECE]), ranges[first].reshape(-1, 2), gyros[first]


class _Rows(NamedTuple):
    """Some samples [m, N] of the series, deg/s, from number `offset` on."""

    values: np.ndarray
    offset: int


def _residuals(
    series: _Rows, part: WindowModels, ahead: int, definition: Definition, span: int, run_start: np.ndarray
) -> np.ndarray:
    """r_t of windows and of the samples after them, from no more of the series than that takes."""
    values, offset = series
    first = max(int(part.start[0]) - 1 - offset, 0)
    rows = values[first : int(part.start[-1]) + part.length + ahead - offset]
    from_here = offset + first
    windows = WindowPlaces(part.start - from_here, part.length, ahead, run_start - from_here)
    r = window_batch(rows, windows, definition, span)
    if not np.isnan(rows).any():
        return r
    # A gyro with a model may lack values after its window: there its variance goes on without a shock.
    ahead_of = np.nan_to_num(r[:, part.length :], nan=0.0)
    return np.concatenate([r[:, : part.length], ahead_of], axis=1)


def _weigh(
    r: Floats, part: WindowModels, gyros: Bools, samples: Window, correlation: CorrelationModel, engine: str
) -> ConditionalWeights:
    dynamic = 0.0 if correlation == "ccc" else 1.0
    omega, alpha, beta = (parameter[:, gyros] for parameter in (part.omega, part.alpha, part.beta))
    return engines.get(engine).weights.conditional_weights(
        r, part.length, omega, alpha, beta, dynamic * part.a, dynamic * part.b, part.target[:, gyros][:, :, gyros],
        samples.start, samples.stop,
    )  # fmt: skip


def _store(
    found: WindowWeights,
    part: WindowModels,
    gyros: np.ndarray,
    weighed: ConditionalWeights | None,
    columns: slice,
    low: int,
) -> None:
    """Put the weights of one mode where they belong; `low`: first of its samples, from the window's first one."""
    width = columns.stop - columns.start
    rows = _rows(part.start + low - found.begin, width)
    said = np.where(part.note > 0, part.note + _NO_VARIANCE, _OK if weighed else _NO_VARIANCE).astype(np.int16)
    if weighed is None:
        found.status[rows] = np.repeat(said, width)
        return
    found.weights[rows] = _of_all_gyros(weighed.weights[:, columns], gyros, 0.0)
    found.deviation[rows] = _of_all_gyros(weighed.deviation[:, columns], gyros, np.nan)
    found.sigma[rows] = weighed.sigma[:, columns].ravel()
    found.status[rows] = np.where(weighed.good[:, columns], said[:, None], np.int16(_SINGULAR)).ravel()


def _rows(first: np.ndarray, width: int) -> np.ndarray | slice:
    """`width` rows from each of `first`; a slice, which is faster, where they follow from one another."""
    if (np.diff(first) == width).all():
        return slice(int(first[0]), int(first[-1]) + width)
    return (first[:, None] + np.arange(width)).ravel()


def _of_all_gyros(values: np.ndarray, gyros: np.ndarray, missing: float) -> np.ndarray:
    """[K, E, n] of the gyros that have a model → [K·E, N] of all."""
    if gyros.all():
        return values.reshape(-1, len(gyros))
    whole = np.full((*values.shape[:2], len(gyros)), missing)
    whole[:, :, gyros] = values
    return whole.reshape(-1, len(gyros))

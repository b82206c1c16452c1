"""What to conclude: plain sentences that follow from the figures by stated rules."""

from __future__ import annotations

import statistics
from dataclasses import dataclass

import numpy as np

from vgyro.report.calibration.section import nominal, rates_as_logged
from vgyro.report.conclusions.best import motion_sentences, rest_sentences
from vgyro.report.conclusions.crosscheck import failures
from vgyro.report.conclusions.suspicions import suspicion_sentences
from vgyro.report.fusion.failed import failed_sentences
from vgyro.report.fusion.noise import OVERLAPPING
from vgyro.report.model import ArrayPart, DatasetPart, RecordingPart, rows_of
from vgyro.report.numbers import percent, significant
from vgyro.report.recordings.faults import fault_sentences, faulty_gyros
from vgyro.report.sentences import Conclusion, moved_words, named
from vgyro.report.volatility.arch import verdicts
from vgyro.report.volatility.fits import NO_USE

BAD_FACTOR = 2.0
BAD_ARW_FACTOR = 1.5
FEWEST_GYROS = 3
SHORTEST_TAU = 1.0
MOST_LOST = 1e-3
MOST_UNFITTED = 0.01
FREE = "free"
AT_REST_KINDS = ("static", "thermal", FREE)
BAD_RULE = (
    f"A gyro is called bad where, at rest, its 1σ or its Allan deviation at {SHORTEST_TAU:g} s or longer is more than "
    f"{BAD_FACTOR:g} times the median of its array, or its ARW read at 1 s more than {BAD_ARW_FACTOR:g} times "
    f"({FEWEST_GYROS} gyros or more); the lower 95 % limit counts."
)


@dataclass(frozen=True)
class BadGyro:
    """A gyro and its worst figure. figure : in words;  factor : over the median of its array"""

    gyro: str
    axis: str
    recording: str
    figure: str
    factor: float


def conclude(dataset: DatasetPart) -> list[Conclusion]:
    """All sentences, the most important first."""
    found = suspicion_sentences(dataset) + moved_sentences(dataset) + failed_sentences(dataset)
    found += _gyro_sentences(dataset) + fault_sentences(dataset)
    for array in main_arrays(dataset):
        found += rest_sentences(dataset, array)
    found += motion_sentences(dataset)
    found += _arch_sentences(dataset)
    return found + limits(dataset)


def moved_sentences(dataset: DatasetPart) -> list[Conclusion]:
    """Recordings in which the board moved though they are declared to be at rest."""
    return [
        Conclusion(f"Recording {recording.name} {moved_words(recording.kind, recording.moved)}.", "bad", "recordings")
        for recording in dataset.recordings
        if recording.moved is not None
    ]


def at_rest(dataset: DatasetPart) -> list[ArrayPart]:
    """Arrays of the recordings whose purpose includes rest."""
    return [array for array in dataset.arrays if dataset.recording(array.recording).kind in AT_REST_KINDS]


def main_arrays(dataset: DatasetPart) -> list[ArrayPart]:
    """One array an axis: of the first static recording, else thermal, else free; the longest of its kind.

    A recording in which the board moved is as a free one, whatever it is declared to be.
    """

    def rank(array: ArrayPart) -> tuple[int, float]:
        recording = dataset.recording(array.recording)
        kind = recording.kind if recording.moved is None else FREE
        return AT_REST_KINDS.index(kind), -float(recording.integrity.get("duration_s") or 0)

    candidates = {axis: [array for array in at_rest(dataset) if array.axis == axis] for axis in dataset.board.axes}
    return [min(arrays, key=rank) for arrays in candidates.values() if arrays]


def bad_gyros(dataset: DatasetPart) -> list[BadGyro]:
    """Gyros far above the median of their array, each with its worst figure, the worst gyro first."""
    worst: dict[str, BadGyro] = {}
    for array in at_rest(dataset):
        found = [
            *_by_figure(array, "sigma", "1σ", BAD_FACTOR),
            *_by_figure(array, "arw_1s", "ARW at 1 s", BAD_ARW_FACTOR),
        ]
        for bad in (*found, *_by_curve(array)):
            if bad.gyro not in worst or bad.factor > worst[bad.gyro].factor:
                worst[bad.gyro] = bad
    return sorted(worst.values(), key=lambda bad: -bad.factor)


def _by_figure(array: ArrayPart, metric: str, words: str, limit: float) -> list[BadGyro]:
    """Gyros whose figure is above `limit` times the median of the array."""
    values = array.values()
    known = {gyro: values[gyro, ""][metric] for gyro in array.gyros if metric in values.get((gyro, ""), {})}
    return _above(array, words, limit, {gyro: (value.value, value.low) for gyro, value in known.items() if value.known})


def _by_curve(array: ArrayPart) -> list[BadGyro]:
    """Gyros whose Allan deviation is too high at some τ."""
    curves: dict[float, dict[str, tuple[float, float]]] = {}
    for row in rows_of(array.tables.get("allan", {})):
        # The τ nearest to 1 s may lie a little below it.
        if row["kind"] != OVERLAPPING:
            continue
        if row["series"] in array.gyros and row["tau"] > 0.9 * SHORTEST_TAU and np.isfinite(row["deviation"]):
            curves.setdefault(float(row["tau"]), {})[str(row["series"])] = (float(row["deviation"]), float(row["low"]))
    return [
        bad
        for tau, points in curves.items()
        for bad in _above(array, f"Allan deviation at τ = {significant(tau, 2)} s", BAD_FACTOR, points)
    ]


def _above(array: ArrayPart, words: str, limit: float, known: dict[str, tuple[float, float]]) -> list[BadGyro]:
    """Gyros (value, lower limit) with the lower limit above `limit` times the median of the values."""
    median = statistics.median(value for value, _ in known.values()) if len(known) >= FEWEST_GYROS else 0.0
    return [
        BadGyro(gyro, array.axis, array.recording, words, value / median)
        for gyro, (value, low) in known.items()
        if median > 0 and low > limit * median
    ]


def _gyro_sentences(dataset: DatasetPart) -> list[Conclusion]:
    found = []
    bad = bad_gyros(dataset)
    tested = {gyro for array in at_rest(dataset) if len(array.gyros) >= FEWEST_GYROS for gyro in array.gyros}
    for axis in dataset.board.axes:
        members = [gyro.name for gyro in dataset.board.array(axis)]
        mine = [one for one in bad if one.axis == axis]
        if mine:
            listed = "; ".join(
                f"{one.gyro} ({one.figure} {significant(one.factor, 2)} times the median, {one.recording})"
                for one in mine
            )
            verb = "is" if len(mine) == 1 else "are"
            text = f"Axis {axis}: {len(mine)} of {len(members)} gyros {verb} bad: {listed}."
            found.append(Conclusion(text, "bad", f"{mine[0].recording}-{axis}"))
        elif set(members) <= tested and not faulty_gyros(dataset).intersection(members):
            found.append(Conclusion(f"Axis {axis}: all {len(members)} gyros are healthy.", "good", f"axis-{axis}"))
    return found


def _arch_sentences(dataset: DatasetPart) -> list[Conclusion]:
    """What the ARCH effects of each array at rest are, gyros of one verdict together."""
    found = []
    for array in at_rest(dataset):
        groups = verdicts(array)
        if groups:
            listed = "; ".join(f"{verdict}: {named(gyros)}" for verdict, gyros in groups.items())
            text = f"ARCH effects of the level (axis {array.axis}, {array.recording}): {listed}."
            found.append(Conclusion(text, "", array.anchor))
    return found


def limits(dataset: DatasetPart) -> list[Conclusion]:
    """What limits the result: nominal scale, refused recordings, lost frames, too little data, failed checks."""
    found = []
    unmeasured = nominal(dataset)
    if unmeasured:
        whose = "every gyro" if len(unmeasured) == len(dataset.board.gyros) else named(unmeasured)
        words = f"Nominal scale for {whose}: absolute figures carry the data sheet's error."
        if rates_as_logged(dataset):
            words = f"Rates as logged for {whose}: absolute figures carry the error of a scale not measured here."
        found.append(Conclusion(words, "warn", "calibration"))
    for recording in dataset.recordings:
        found += _incomplete(recording)
        falling = [gyro for array in recording.arrays for gyro in _falling(array)]
        if falling and recording.kind in AT_REST_KINDS:
            everyone = len(falling) == sum(len(array.gyros) for array in recording.arrays)
            whose = "all gyros" if everyone else named(falling)
            text = f"{recording.name} is too short for the floor of {whose}: the Allan curve still falls at its end"
            found.append(Conclusion(f"{text}, so bias drift is an upper limit.", "warn", recording.arrays[0].anchor))
    for array in dataset.arrays:
        found += _unfitted(array)
    failed = {array.anchor: failures(array) for array in dataset.arrays if failures(array)}
    if failed:
        places = "; ".join(
            f"{array.recording}, axis {array.axis}" for array in dataset.arrays if array.anchor in failed
        )
        total = sum(failed.values())
        text = f"The cross-check failed in {total} {'comparison' if total == 1 else 'comparisons'} ({places})."
        found.append(Conclusion(text, "bad", next(iter(failed))))
    return found


def _incomplete(recording: RecordingPart) -> list[Conclusion]:
    if not recording.usable:
        reasons = "; ".join(reason.rstrip(".") for reason in recording.integrity["reasons"])
        return [Conclusion(f"Recording {recording.name} was refused: {reasons}.", "bad", "recordings")]
    frames = recording.integrity["frames"]
    if 1 - frames["good_share"] > MOST_LOST:
        text = f"{recording.name} lacks {percent(1 - frames['good_share'], 2)} of its frames"
        return [Conclusion(f"{text}; nothing is put in their place.", "warn", "recordings")]
    return []


def _unfitted(array: ArrayPart) -> list[Conclusion]:
    """Gyros that have no usable GARCH model in more than a few windows, by the definition where it is worst."""
    worst: dict[str, tuple[float, str, str]] = {}
    for definition, part in array.volatility.items():
        for one in part.garch:
            lost = {status: one.statuses[status] for status in NO_USE if status in one.statuses}
            share = sum(lost.values()) / max(one.windows, 1)
            if share > max(MOST_UNFITTED, worst.get(one.gyro, (0.0,))[0]):
                worst[one.gyro] = share, max(lost, key=lost.__getitem__), definition
    if not worst:
        return []
    listed = "; ".join(
        f"{gyro} {percent(share, 2)} of the windows, mostly {status} (definition {definition})"
        for gyro, (share, status, definition) in worst.items()
    )
    text = f"Windows without a usable GARCH model ({array.recording}, axis {array.axis}): {listed}."
    return [Conclusion(text, "warn", array.anchor)]


def _falling(array: ArrayPart) -> list[str]:
    values = array.values()
    return [
        gyro
        for gyro in array.gyros
        if "bias_drift" in values.get((gyro, ""), {}) and "upper_limit" in values[gyro, ""]["bias_drift"].flags
    ]

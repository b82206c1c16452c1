"""What to conclude: plain sentences that follow from the figures by stated rules."""

from __future__ import annotations

import statistics
from dataclasses import dataclass

import numpy as np

from vgyro.report.crosscheck import failures
from vgyro.report.fits import NO_USE
from vgyro.report.model import ArrayPart, DatasetPart, RecordingPart, Value, rows_of
from vgyro.report.noise import method_labels
from vgyro.report.numbers import percent, significant
from vgyro.report.scale import nominal
from vgyro.report.tables import Tone
from vgyro.report.volatility import LEVEL_OF_TEST

BAD_FACTOR = 2.0
BAD_ARW_FACTOR = 1.5
FEWEST_GYROS = 3
SHORTEST_TAU = 1.0
MOST_NAMED = 6
SIMPLE = ("average", "median", "inverse_variance_arw")
MOST_LOST = 1e-3
MOST_UNFITTED = 0.01
AT_REST_KINDS = ("static", "thermal", "free")
REST_FACTORS = (("if_sigma", "1σ"), ("if_bias_drift", "bias drift"))
IN_SAMPLE = "_in_sample"
STILL_FALLS = "the curve still falls"
BAD_RULE = (
    f"A gyro is called bad where, at rest, its 1σ or its Allan deviation at {SHORTEST_TAU:g} s or longer is more than "
    f"{BAD_FACTOR:g} times the median of its array, or its ARW read at 1 s more than {BAD_ARW_FACTOR:g} times "
    f"({FEWEST_GYROS} gyros or more); the lower 95 % limit counts."
)
BEST_RULE = (
    "Best method: the greatest improvement factor over the mean of the single gyros, in each axis' main recording "
    "at rest; in-sample weights are left out, because they have seen what they weigh. DCC beats the simple baselines "
    "(average, median, fixed inverse variance) where the lower limit of its factor is above the best of theirs."
)
ARCH_RULE = "ARCH of the level is called drift where the detrended series does not reject at 5 %."


@dataclass(frozen=True)
class Conclusion:
    """One sentence. anchor : part of the page that it rests on"""

    text: str
    tone: Tone = ""
    anchor: str = ""


@dataclass(frozen=True)
class BadGyro:
    """A gyro and its worst figure. figure : in words;  factor : over the median of its array"""

    gyro: str
    axis: str
    recording: str
    figure: str
    factor: float


@dataclass(frozen=True)
class Best:
    """Best method of an array by one improvement factor."""

    label: str
    method: str
    factor: Value
    axis: str
    recording: str


def conclude(dataset: DatasetPart) -> list[Conclusion]:
    """All sentences, the most important first."""
    found = _gyro_sentences(dataset)
    for array in main_arrays(dataset):
        found += _rest_sentences(array)
    found += _motion_sentences(dataset)
    found += _arch_sentences(dataset)
    return found + limits(dataset)


def at_rest(dataset: DatasetPart) -> list[ArrayPart]:
    """Arrays of the recordings whose purpose includes rest."""
    return [array for array in dataset.arrays if dataset.recording(array.recording).kind in AT_REST_KINDS]


def main_arrays(dataset: DatasetPart) -> list[ArrayPart]:
    """One array an axis: of the first static recording, else thermal, else free; the longest of its kind."""

    def rank(array: ArrayPart) -> tuple[int, float]:
        recording = dataset.recording(array.recording)
        return AT_REST_KINDS.index(recording.kind), -float(recording.integrity.get("duration_s") or 0)

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


def best_method(array: ArrayPart, metric: str, *, full_bandwidth: bool = False) -> Best | None:
    """The method, not in-sample, with the greatest improvement factor.

    full_bandwidth : of those that do not narrow the bandwidth
    """
    labels = _labels(array)
    limited = {(row["method"], row["definition"]) for row in array.methods() if np.isfinite(row["bandwidth_hz"])}
    found = [
        Best(labels[name], name[0], known[metric], array.axis, array.recording)
        for name, known in array.values().items()
        if name in labels and metric in known and known[metric].known
        if not name[0].endswith(IN_SAMPLE) and not (full_bandwidth and name in limited)
    ]
    return max(found, key=lambda best: best.factor.value, default=None)


def _labels(array: ArrayPart) -> dict[tuple[str, str], str]:
    names = method_labels(array)
    return {(row["method"], row["definition"]): names[row["column"]] for row in array.methods() if row["column"]}


def _gyro_sentences(dataset: DatasetPart) -> list[Conclusion]:
    found = []
    bad = bad_gyros(dataset)
    tested = {gyro for array in at_rest(dataset) if len(array.gyros) >= FEWEST_GYROS for gyro in array.gyros}
    for axis in dataset.board.axes:
        members = [gyro.name for gyro in dataset.board.array(axis)]
        mine = [one for one in bad if one.axis == axis]
        if mine:
            listed = "; ".join(
                f"{one.gyro} ({one.figure} {significant(one.factor, 2)}×, {one.recording})" for one in mine
            )
            verb = "is" if len(mine) == 1 else "are"
            text = f"Axis {axis}: {len(mine)} of {len(members)} gyros {verb} bad, × the median of the array: {listed}."
            found.append(Conclusion(text, "bad", f"{mine[0].recording}-{axis}"))
        elif set(members) <= tested:
            found.append(Conclusion(f"Axis {axis}: all {len(members)} gyros are healthy.", "good", f"axis-{axis}"))
    return found


def _rest_sentences(array: ArrayPart) -> list[Conclusion]:
    place = f"axis {array.axis}, {array.recording}"
    parts = []
    for metric, words in REST_FACTORS:
        best = best_method(array, metric)
        if best is not None:
            parts.append(f"by {words} {best.label}, improvement factor {_factor(best.factor)}")
            free = best_method(array, metric, full_bandwidth=True)
            if free is not None and free.label != best.label:
                parts[-1] += f" (without narrowing the bandwidth: {free.label}, {_factor(free.factor)})"
    if not parts:
        return []
    found = [Conclusion(f"Best method at rest ({place}): {'; '.join(parts)}.", "", array.anchor)]
    compared = [text for metric, words in REST_FACTORS if (text := _dcc_words(array, metric, words))]
    if compared:
        found.append(Conclusion(f"Causal DCC ({place}) {'; '.join(compared)}.", "", array.anchor))
    return found


def _factor(value: Value) -> str:
    holds_one = value.low <= 1 <= value.high
    return interval(value) + (", not significant: the interval holds 1" if holds_one else "")


def named(gyros: list[str]) -> str:
    """Names, or how many where they are too many to read."""
    return ", ".join(gyros) if len(gyros) <= MOST_NAMED else f"{len(gyros)} gyros"


def interval(value: Value) -> str:
    """A figure and its interval in one line."""
    text = significant(value.value)
    if np.isfinite(value.low) and np.isfinite(value.high):
        text += f" ({significant(value.low)} … {significant(value.high)})"
    return text


def _dcc_words(array: ArrayPart, metric: str, words: str) -> str:
    labels = _labels(array)
    known = {
        name: values[metric]
        for name, values in array.values().items()
        if name in labels and metric in values and values[metric].known
    }
    simple = [name for name in known if name[0] in SIMPLE]
    dcc = [name for name in known if name[0] == "dcc_causal"]
    if not simple or not dcc:
        return ""
    baseline = max(simple, key=lambda name: known[name].value)
    ours = max(dcc, key=lambda name: known[name].value)
    verdict = "beats" if known[ours].low > known[baseline].value else "does not beat"
    figures = f"{interval(known[ours])} with definition {ours[1]} against {significant(known[baseline].value)}"
    return f"{verdict} the simple baselines by {words}: {figures} of {labels[baseline]}"


def _motion_sentences(dataset: DatasetPart) -> list[Conclusion]:
    found = []
    for array in dataset.arrays:
        labels = _labels(array)
        errors = {
            name: values["error_sigma"]
            for name, values in array.values().items()
            if name in labels and "error_sigma" in values and values["error_sigma"].known
        }
        if errors:
            best = min(errors, key=lambda name: errors[name].value)
            text = (
                f"In motion (axis {array.axis}, {array.recording}) the least error 1σ is {interval(errors[best])} deg/s"
            )
            against = (
                f", against {significant(errors['average', ''].value)} of the average"
                if ("average", "") in errors
                else ""
            )
            found.append(Conclusion(f"{text}, by {labels[best]}{against}.", "", array.anchor))
    return found


def _arch_sentences(dataset: DatasetPart) -> list[Conclusion]:
    found = []
    for recording in dataset.recordings:
        raw: list[str] = []
        left: list[str] = []
        tested = 0
        for array in recording.arrays:
            level = array.volatility.get("level")
            for row in rows_of(level.arch_lm or {}) if level else ():
                if row["status"] == "ok":
                    rejects = row["p_value"] < LEVEL_OF_TEST
                    tested += row["series"] == "level"
                    raw += [row["gyro"]] if rejects and row["series"] == "level" else []
                    left += [row["gyro"]] if rejects and row["series"] == "detrended" else []
        if raw:
            verdict = "it is drift" if not left else f"it is more than drift for {named(left)}"
            text = f"ARCH effect of the level in {recording.name}: {len(raw)} of {tested} gyros; detrended: {len(left)}"
            found.append(Conclusion(f"{text}; {verdict}.", "", recording.arrays[0].anchor))
    return found


def limits(dataset: DatasetPart) -> list[Conclusion]:
    """What limits the result: nominal scale, refused recordings, lost frames, too little data, failed checks."""
    found = []
    unmeasured = nominal(dataset)
    if unmeasured:
        whose = "every gyro" if len(unmeasured) == len(dataset.board.gyros) else named(unmeasured)
        words = f"Nominal scale for {whose}: absolute figures carry the data sheet's error."
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
        text = f"{recording.name} lacks {percent(1 - frames['good_share'], 2)} of its frames; no figure bridges a gap."
        return [Conclusion(text, "warn", "recordings")]
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
        if "bias_drift" in values.get((gyro, ""), {}) and STILL_FALLS in values[gyro, ""]["bias_drift"].note
    ]

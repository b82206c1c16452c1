"""What to conclude: plain sentences that follow from the figures by stated rules."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.report.crosscheck import failures
from vgyro.report.model import ArrayPart, DatasetPart, Value
from vgyro.report.noise import method_labels
from vgyro.report.numbers import duration, percent, significant
from vgyro.report.scale import nominal
from vgyro.report.tables import Tone
from vgyro.report.volatility import LEVEL_OF_TEST

BAD_FACTOR = 2.0
FEWEST_GYROS = 3
GYRO_FIGURES = ("sigma", "arw", "bias_drift")
SIMPLE = ("average", "median", "inverse_variance_arw")
MOST_LOST = 1e-4
STILL_FALLS = "the curve still falls"
BAD_RULE = (
    f"A gyro is called bad where its 1σ, its fitted ARW or its bias drift at rest is more than {BAD_FACTOR:g} times "
    f"the median of its array ({FEWEST_GYROS} gyros or more)."
)
BEST_RULE = (
    "Best method: the greatest improvement factor. DCC beats the simple baselines (average, median, fixed inverse "
    "variance) where the interval of its improvement factor lies above the best of theirs; causal DCC only, because "
    "in-sample weights have seen the samples that they weigh."
)


@dataclass(frozen=True)
class Conclusion:
    """One sentence. anchor : part of the page that it rests on"""

    text: str
    tone: Tone = ""
    anchor: str = ""


@dataclass(frozen=True)
class BadGyro:
    """factor : its figure over the median of its array"""

    gyro: str
    axis: str
    recording: str
    metric: str
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
    for array in dataset.arrays:
        if len(array.gyros) > 1:
            found += _method_sentences(array)
    found += _arch_sentences(dataset)
    found += _limits(dataset)
    return found


def bad_gyros(dataset: DatasetPart) -> list[BadGyro]:
    """Gyros far above the median of their array, each with its worst figure, the worst gyro first."""
    worst: dict[str, BadGyro] = {}
    for array in dataset.arrays:
        values = array.values()
        for metric in GYRO_FIGURES:
            for gyro, factor in _over_median(array, values, metric).items():
                if factor > BAD_FACTOR and (gyro not in worst or factor > worst[gyro].factor):
                    worst[gyro] = BadGyro(gyro, array.axis, array.recording, metric, factor)
    return sorted(worst.values(), key=lambda bad: -bad.factor)


def _over_median(
    array: ArrayPart, values: Mapping[tuple[str, str], Mapping[str, Value]], metric: str
) -> dict[str, float]:
    figures = {gyro: values[gyro, ""][metric].value for gyro in array.gyros if metric in values.get((gyro, ""), {})}
    figures = {gyro: value for gyro, value in figures.items() if np.isfinite(value)}
    if len(figures) < FEWEST_GYROS:
        return {}
    median = statistics.median(figures.values())
    return {gyro: value / median for gyro, value in figures.items()} if median > 0 else {}


def best_method(array: ArrayPart, metric: str) -> Best | None:
    """The method with the greatest improvement factor of one figure."""
    labels = _labels(array)
    found = [
        Best(labels[name], name[0], known[metric], array.axis, array.recording)
        for name, known in array.values().items()
        if name in labels and metric in known and known[metric].known
    ]
    return max(found, key=lambda best: best.factor.value, default=None)


def _labels(array: ArrayPart) -> dict[tuple[str, str], str]:
    names = method_labels(array)
    return {(row["method"], row["definition"]): names[row["column"]] for row in array.methods() if row["column"]}


def _gyro_sentences(dataset: DatasetPart) -> list[Conclusion]:
    found = []
    bad = bad_gyros(dataset)
    tested = {gyro for array in dataset.arrays if len(array.gyros) >= FEWEST_GYROS for gyro in array.gyros}
    for one in bad:
        title = dataset.figures[one.metric].title if one.metric in dataset.figures else one.metric
        text = f"Gyro {one.gyro} (axis {one.axis}) is bad: its {title} is {significant(one.factor, 2)} times the median"
        found.append(Conclusion(f"{text} of its array in {one.recording}.", "bad", f"{one.recording}-{one.axis}"))
    for axis in dataset.board.axes:
        members = [gyro.name for gyro in dataset.board.array(axis)]
        if set(members) <= tested and not any(one.axis == axis for one in bad):
            words = f"All {len(members)} gyros of axis {axis} are healthy by that rule."
            found.append(Conclusion(words, "good"))
    return found


def _method_sentences(array: ArrayPart) -> list[Conclusion]:
    found = []
    place = f"axis {array.axis}, {array.recording}"
    for metric, words in (("if_bias_drift", "bias drift"), ("if_sigma", "1σ")):
        best = best_method(array, metric)
        if best is not None:
            sure = "" if _significant(best.factor) else ": not significant, the interval holds 1"
            figure = f"improvement factor {interval(best.factor)}{sure}"
            text = f"By {words} the best method ({place}) is {best.label}, {figure}."
            found.append(Conclusion(text, "", array.anchor))
            found += [Conclusion(text, "", array.anchor) for text in _dcc_sentence(array, metric, words, place)]
    return found


def _significant(value: Value) -> bool:
    return not value.low <= 1 <= value.high


def interval(value: Value) -> str:
    """A figure and its interval in one line."""
    text = significant(value.value)
    if np.isfinite(value.low) and np.isfinite(value.high):
        text += f" ({significant(value.low)} … {significant(value.high)})"
    return text


def _dcc_sentence(array: ArrayPart, metric: str, words: str, place: str) -> list[str]:
    labels = _labels(array)
    known = {
        name: values[metric]
        for name, values in array.values().items()
        if name in labels and metric in values and values[metric].known
    }
    simple = [name for name in known if name[0] in SIMPLE]
    dcc = [name for name in known if name[0] == "dcc_causal"]
    if not simple or not dcc:
        return []
    baseline = max(simple, key=lambda name: known[name].value)
    ours = max(dcc, key=lambda name: known[name].value)
    figures = f"{interval(known[ours])} against {significant(known[baseline].value)} of {labels[baseline]}"
    verdict = "beats" if known[ours].low > known[baseline].value else "does not beat"
    return [f"By {words} causal DCC {verdict} the simple baselines ({place}): {labels[ours]} reaches {figures}."]


def _arch_sentences(dataset: DatasetPart) -> list[Conclusion]:
    found = []
    for array in dataset.arrays:
        table = array.volatility.get("level", {}).get("arch_lm")
        if table is None:
            continue
        shares = {}
        for series in ("level", "detrended"):
            mine = (table["series"] == series) & (table["status"] == "ok")
            shares[series] = (int((table["p_value"][mine] < LEVEL_OF_TEST).sum()), int(mine.sum()))
        (raw, tested), (left, _) = shares["level"], shares["detrended"]
        if not tested or not raw:
            continue
        what = "mostly drift" if left < raw / 2 else "more than drift"
        text = (
            f"ARCH-LM (axis {array.axis}, {array.recording}) rejects for {raw} of {tested} gyros on the level and for "
            f"{left} on the detrended series: the “ARCH effect” of the level is {what}."
        )
        found.append(Conclusion(text, "", array.anchor))
    return found


def _limits(dataset: DatasetPart) -> list[Conclusion]:
    found = []
    unmeasured = nominal(dataset)
    if unmeasured:
        whose = "every gyro" if len(unmeasured) == len(dataset.board.gyros) else ", ".join(unmeasured)
        found.append(
            Conclusion(
                f"Nominal scale for {whose}: absolute figures carry the data sheet's error.", "warn", "calibration"
            )
        )
    for recording in dataset.recordings:
        if not recording.usable:
            reasons = "; ".join(recording.integrity.get("reasons") or ["no reason given"])
            found.append(Conclusion(f"Recording {recording.name} was refused: {reasons}.", "bad", "recordings"))
            continue
        frames = recording.integrity.get("frames") or {}
        missing = (frames.get("lost") or 0) + (frames.get("bad") or 0)
        total = missing + (frames.get("good") or 0)
        if total and missing / total > MOST_LOST:
            text = f"{recording.name} lacks {percent(missing / total, 2)} of its frames; no figure bridges a gap."
            found.append(Conclusion(text, "warn", "recordings"))
    found += [_too_short(array, names) for array in dataset.arrays if (names := _falling(array))]
    for array in dataset.arrays:
        if failed := failures(array):
            text = f"{failed} cross-check comparisons failed (axis {array.axis}, {array.recording})."
            found.append(Conclusion(text, "bad", array.anchor))
    return found


def _falling(array: ArrayPart) -> list[str]:
    values = array.values()
    return [
        gyro
        for gyro in array.gyros
        if "bias_drift" in values.get((gyro, ""), {}) and STILL_FALLS in values[gyro, ""]["bias_drift"].note
    ]


def _too_short(array: ArrayPart, names: Sequence[str]) -> Conclusion:
    whose = "all gyros" if len(names) == len(array.gyros) else ", ".join(names)
    text = (
        f"{array.recording} is too short for the floor of {whose} on axis {array.axis}: the Allan curve still falls at "
        "its end, and bias drift is an upper limit."
    )
    return Conclusion(text, "warn", array.anchor)


def hours_of(dataset: DatasetPart) -> str:
    """Length of all usable recordings together."""
    return duration(sum(float(part.integrity.get("duration_s") or 0) for part in dataset.recordings if part.usable))

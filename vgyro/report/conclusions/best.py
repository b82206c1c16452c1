"""Which method is best at rest and in motion, by stated rules, and which one a constant rate spoils."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from vgyro.figure import Figure
from vgyro.report.figure_cells import says_limited
from vgyro.report.fusion.moved import failing
from vgyro.report.fusion.noise import OVERLAPPING, method_labels
from vgyro.report.model import ArrayPart, DatasetPart, Value, rows_of
from vgyro.report.numbers import plain, significant
from vgyro.report.sentences import Conclusion, factor, interval

SIMPLE = ("average", "median", "inverse_variance_arw")
FAIR, RAW = "if_sigma_equal", "if_sigma"
FACTORS = ((FAIR, "1σ at equal bandwidth"), ("if_arw", "N"), ("if_bias_drift", "bias drift"))
RAW_FACTOR = (RAW, "1σ")
IN_SAMPLE = "_in_sample"
FROM_ITSELF = "weights made from this very recording"
"""In the note of a row whose fixed weights are of the least Allan variance in the recording that is judged."""
AVERAGING_S = 1.0
"""Weights that are best for the samples need not be for means over so long."""
OFFLINE = " (offline)"
BEST_RULES = (
    "Best method: the greatest improvement factor over the mean of the single gyros, in each axis' main recording at "
    "rest, by 1σ at equal bandwidth (every series low-passed to one bandwidth), by the fitted N and by bias drift. "
    "In-sample weights, and fixed weights that were made from the very recording, are left out, because they have seen "
    "what they weigh. Where the best is an offline method, the best causal one is named, too. A smoother whose shape "
    "is not that of a low-pass run once, or forward and back, is not compared by 1σ or N.",
    "In motion: the least 1σ of the error against the reference, in-sample weights left out again.",
    "Which method is best depends on the averaging time: of those that keep the full bandwidth, the one with the least "
    "Allan deviation at the shortest averaging time has not the least at 1 s, and the lower limit of its own there is "
    "above that of the other. The spectra of the gyros differ in shape, then.",
    "DCC beats the simple baselines (average, median, fixed inverse variance) where the lower limit of its factor is "
    "above the best of theirs.",
)
Name = tuple[str, str]
RECOMMENDED: Name = ("recommended", "")


@dataclass(frozen=True)
class BestMethod:
    """Best method of an array by one improvement factor. figure : its name in metrics.parquet"""

    label: str
    name: Name
    figure: str
    factor: Value
    axis: str
    recording: str

    @property
    def method(self) -> str:
        return self.name[0]


def best_method(array: ArrayPart, figure: str, allowed: Callable[[Name], bool] = lambda _: True) -> BestMethod | None:
    """The method, not in-sample, with the greatest improvement factor, of those that `allowed` lets pass."""
    seen = in_sample(array)
    found = [
        BestMethod(label, name, figure, array.values()[name][figure], array.axis, array.recording)
        for name, label in _labels(array).items()
        if name not in seen and allowed(name) and figure in _known(array, name)
        if not says_limited(array.values()[name][figure])
    ]
    return max(found, key=lambda best: best.factor.value, default=None)


def best_of_all(array: ArrayPart) -> BestMethod | None:
    """By 1σ at equal bandwidth, of the methods that hold at the added rate.

    Where bandwidths were not made equal: by 1σ, of those that do not narrow the bandwidth.
    """
    failed = failing(array)
    limited = {(row["method"], row["definition"]) for row in array.methods() if np.isfinite(row["bandwidth_hz"])}
    fair = best_method(array, FAIR, lambda name: name not in failed)
    return fair or best_method(array, RAW, lambda name: name not in failed and name not in limited)


def in_sample(array: ArrayPart) -> set[Name]:
    """Methods whose weights have seen what they weigh."""
    return {
        (row["method"], row["definition"])
        for row in array.methods()
        if str(row["method"]).endswith(IN_SAMPLE) or FROM_ITSELF in str(row["note"])
    }


def _known(array: ArrayPart, name: Name) -> Mapping[str, Value]:
    return {metric: value for metric, value in array.values().get(name, {}).items() if value.known}


def _labels(array: ArrayPart) -> dict[Name, str]:
    names = method_labels(array)
    return {(row["method"], row["definition"]): names[row["column"]] for row in array.methods() if row["column"]}


def _causal(array: ArrayPart, name: Name) -> bool:
    return next(bool(row["causal"]) for row in array.methods() if (row["method"], row["definition"]) == name)


def factors_of(array: ArrayPart) -> tuple[tuple[str, str], ...]:
    """The factors by which methods are compared: the fair ones; raw 1σ where bandwidths were not made equal."""
    fair = any(FAIR in known for known in array.values().values())
    return FACTORS if fair else (RAW_FACTOR, *FACTORS[1:])


def rest_sentences(dataset: DatasetPart, array: ArrayPart) -> list[Conclusion]:
    """The best methods at rest, whether DCC beats the baselines, and what fails at the added rate."""
    place = f"axis {array.axis}, {array.recording}"
    listed = _listed(array)
    if not listed:
        return []
    found = [*_recommended(array, place), Conclusion(f"Best method at rest ({place}): {listed}.", "", array.anchor)]
    if OFFLINE in listed:
        causal = _listed(array, causal=True)
        found += [Conclusion(f"Best causal method at rest ({place}): {causal}.", "", array.anchor)] if causal else []
    found += _averaging_sentence(array, place)
    compared = [text for figure, words in factors_of(array) if (text := _dcc_words(array, figure, words))]
    if compared:
        found.append(Conclusion(f"Causal DCC ({place}) {'; '.join(compared)}.", "", array.anchor))
    return found + _failing_sentence(dataset, array, place)


def _recommended(array: ArrayPart, place: str) -> list[Conclusion]:
    """What the recommended method reaches at rest; nothing where it did not run."""
    known = _known(array, RECOMMENDED)
    said = [f"{factor(known[figure])} by {words}" for figure, words in factors_of(array) if figure in known]
    if not said:
        return []
    return [Conclusion(f"Recommended virtual gyro ({place}): improvement factor {', '.join(said)}.", "", array.anchor)]


def _averaging_sentence(array: ArrayPart, place: str) -> list[Conclusion]:
    """Where the best method of full bandwidth at the shortest averaging time is not the best at 1 s."""
    limited = {row["column"] for row in array.methods() if np.isfinite(row["bandwidth_hz"])}
    failed, seen = failing(array), in_sample(array)
    columns = {row["column"]: (row["method"], row["definition"]) for row in array.methods() if row["column"]}
    labels = _labels(array)
    curves: dict[float, dict[Name, tuple[float, float]]] = {}
    for row in rows_of(array.tables.get("allan", {})):
        name = columns.get(row["series"])
        if row["kind"] != OVERLAPPING or name is None or name in failed or row["series"] in limited:
            continue
        if name not in seen and np.isfinite(row["deviation"]):
            curves.setdefault(float(row["tau"]), {})[name] = (float(row["deviation"]), float(row["low"]))
    if not curves:
        return []
    short, second = min(curves), min(curves, key=lambda tau: abs(tau - AVERAGING_S))
    fast, slow = (min(curves[tau], key=lambda name: curves[tau][name][0]) for tau in (short, second))
    at_second = curves[second]
    if second < AVERAGING_S / 2 or fast not in at_second or not at_second[fast][1] > at_second[slow][0]:
        return []
    ratio = significant(at_second[slow][0] / at_second[fast][0], 2)
    text = f"Which method is best depends on the averaging time ({place}): of those that keep the full bandwidth "
    text += f"{labels[fast]} has the least Allan deviation at {significant(short, 2)} s, {labels[slow]} at "
    text += f"{significant(second, 2)} s, {ratio} of the former's"
    return [Conclusion(f"{text}.", "warn", array.anchor)]


def _listed(array: ArrayPart, *, causal: bool = False) -> str:
    """The best method by each factor, with that factor; "" where none is known.  causal : of the causal ones alone"""
    failed = failing(array)
    parts: dict[str, list[str]] = {}

    def allowed(name: Name) -> bool:
        return not causal or _causal(array, name)

    def holding(name: Name) -> bool:
        return name not in failed and allowed(name)

    for figure, words in factors_of(array):
        best = best_method(array, figure, allowed)
        if best is None:
            continue
        said = f"{factor(best.factor)} by {words}"
        if best.name in failed:
            holds = best_method(array, figure, holding)
            other = f"; of those that hold {holds.label}, {factor(holds.factor)}" if holds else ""
            said += f" (fails at {plain(array.added_rate)} deg/s{other})"
        parts.setdefault(f"{best.label}{'' if _causal(array, best.name) else OFFLINE}", []).append(said)
    return "; ".join(f"{label}, improvement factor {', '.join(said)}" for label, said in parts.items())


def _failing_sentence(dataset: DatasetPart, array: ArrayPart, place: str) -> list[Conclusion]:
    """Of the methods that fail at the added rate the one that improves most at rest, with its figures; others named."""
    failed, labels = failing(array), _labels(array)
    raw = factors_of(array)[0][0]

    def gain(name: Name) -> float:
        value = _known(array, name).get(raw)
        return value.value if value else 0.0

    names = sorted((name for name in failed if name in labels), key=gain, reverse=True)
    if not names:
        return []
    first, others = names[0], [labels[name] for name in names[1:]]
    said = "; ".join(
        f"{_figure(dataset, figure).title} {significant(after.value)} {after.unit}, at rest {significant(before.value)}"
        for figure, (before, after) in failed[first].items()
    )
    wins = f"improves 1σ {significant(gain(first))} times at rest but " if gain(first) > 1 else ""
    text = f"{labels[first]} {wins}fails at {plain(array.added_rate)} deg/s ({place}): {said}"
    more = f"; so {'do' if len(others) > 1 else 'does'} {'; '.join(others)}" if others else ""
    return [Conclusion(f"{text}{more}.", "warn", array.anchor)]


def _figure(dataset: DatasetPart, name: str) -> Figure:
    return dataset.figures.get(name) or Figure(name, "", "")


def _dcc_words(array: ArrayPart, figure: str, words: str) -> str:
    labels = _labels(array)
    known = {name: _known(array, name)[figure] for name in labels if figure in _known(array, name)}
    simple = [name for name in known if name[0] in SIMPLE]
    dcc = [name for name in known if name[0] == "dcc_causal"]
    if not simple or not dcc:
        return ""
    baseline = max(simple, key=lambda name: known[name].value)
    ours = max(dcc, key=lambda name: known[name].value)
    verdict = "beats" if known[ours].low > known[baseline].value else "does not beat"
    figures = f"{interval(known[ours])} with definition {ours[1]} against {significant(known[baseline].value)}"
    return f"{verdict} the simple baselines by {words}: {figures} of {labels[baseline]}"


def motion_sentences(dataset: DatasetPart) -> list[Conclusion]:
    """The method with the least error in each recording that has a reference, and the causal one with the least."""
    found = []
    for array in dataset.arrays:
        labels = {name: label for name, label in _labels(array).items() if name not in in_sample(array)}
        errors = {name: _known(array, name)["error_sigma"] for name in labels if "error_sigma" in _known(array, name)}
        if not errors:
            continue
        best = min(errors, key=lambda name: errors[name].value)
        text = f"In motion (axis {array.axis}, {array.recording}) the least error 1σ is {interval(errors[best])} deg/s"
        text += f", by {labels[best]}"
        causal = [name for name in errors if _causal(array, name)]
        if causal and not _causal(array, best):
            first = min(causal, key=lambda name: errors[name].value)
            text += f"{OFFLINE}, of the causal methods {significant(errors[first].value)}, by {labels[first]}"
        if RECOMMENDED in errors and best != RECOMMENDED:
            text += f"; the recommended method {interval(errors[RECOMMENDED])}"
        if ("average", "") in errors:
            text += f", against {significant(errors['average', ''].value)} of the average"
        found.append(Conclusion(f"{text}.", "", array.anchor))
    return found

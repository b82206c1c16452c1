"""Methods that ended with an error: what the page concludes from it, and the overview."""

from __future__ import annotations

from vgyro.report.fusion.methods import FAILED
from vgyro.report.model import DatasetPart
from vgyro.report.sentences import Conclusion

OURS = ("recommended", "recommended_unsmoothed")
"""The rows that a reader is told to use: where one of them fails, nothing else says so as loudly."""
PREFIX = f"{FAILED}: "


def failed_sentences(dataset: DatasetPart) -> list[Conclusion]:
    """One sentence a method and reason, the recommended rows first; the places where it failed in it."""
    places: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
    for array in dataset.arrays:
        for method in array.methods():
            if method.get("state") == FAILED:
                key = str(method["method"]), str(method["title"]), str(method["note"]).removeprefix(PREFIX)
                place = f"{array.recording}, axis {array.axis}", array.anchor
                if place not in places.setdefault(key, []):
                    places[key].append(place)
    found = []
    for (name, title, reason), where in sorted(places.items(), key=lambda item: item[0][0] not in OURS):
        text = f"The method {title!r} failed ({'; '.join(one for one, _ in where)}): {reason.rstrip('.')}."
        found.append(Conclusion(text, "bad" if name in OURS else "warn", where[0][1]))
    return found


def recommended_failed(dataset: DatasetPart) -> bool:
    """Did a row that a reader is told to use end with an error anywhere?"""
    return any(
        method.get("state") == FAILED and method["method"] in OURS
        for array in dataset.arrays
        for method in array.methods()
    )

"""What seems wrong in the manifest or the board, by the data: said first, for all other figures follow from it."""

from __future__ import annotations

from vgyro.report.model import DatasetPart
from vgyro.report.sentences import Conclusion


def suspicion_sentences(dataset: DatasetPart) -> list[Conclusion]:
    """Mistakes that the calibration found."""
    return [
        Conclusion(f"{text[:1].upper()}{text[1:]}.", "bad", "calibration")
        for text in dataset.calibration.get("suspicions", [])
    ]

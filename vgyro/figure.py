"""What a figure is called, its unit and what it means: of the metrics, of a calibration, on a page."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """title : for people;  unit : of the value and its limits, "1" for a pure number;  meaning : the definition"""

    title: str
    unit: str
    meaning: str

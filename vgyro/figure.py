"""What a figure is called, its unit and what it means: of the metrics, of a calibration, on a page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Flag = Literal["band_limited", "takes_part", "not_shown", "not_significant", "upper_limit"]

FLAGS: dict[Flag, str] = {
    "band_limited": "a low-pass lowers the figure by itself: it is no measure of the noise",
    "takes_part": "an improvement factor in which such a figure stands",
    "not_shown": "not shown to exist: `high` is the upper limit",
    "not_significant": "an improvement factor whose limits hold 1",
    "upper_limit": "the curve still falls at its end, or does not rise: an upper limit",
}
"""What decides how a value is used: `flags` of metrics.parquet. Notes are for people, and decide nothing."""


@dataclass(frozen=True)
class Figure:
    """title : for people;  unit : of the value and its limits, "1" for a pure number;  meaning : the definition"""

    title: str
    unit: str
    meaning: str

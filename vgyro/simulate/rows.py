"""Moments of a recording as rows: sample k is taken at k / rate_hz."""

from __future__ import annotations

import math


def row_at(moment: float, rate_hz: float) -> int:
    """The first row that is not before `moment`, s."""
    row = max(math.ceil(moment * rate_hz) - 1, 0)
    while row / rate_hz < moment:
        row += 1
    return row

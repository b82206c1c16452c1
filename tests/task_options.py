"""Options of a task as its rule gives them: nothing is missing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vgyro.config import Analysis


def complete(changed: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """All sections of `analysis`, as JSON, with some keys changed."""
    return Analysis.model_validate(dict(changed or {})).model_dump(mode="json")

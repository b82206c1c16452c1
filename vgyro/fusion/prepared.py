"""The rates as linear, Gaussian methods may take them: what is wrong with single samples and with scales is mended.

Done once for a recording; what comes after (R_t, slow errors, motion) knows nothing of it. Each step takes an array and
gives one, and says in a note what it found.
"""

from __future__ import annotations

from dataclasses import dataclass

from vgyro.fusion.array import ArrayRates, FilterParameters


@dataclass(frozen=True)
class Prepared:
    """array : as the methods take it;  notes : what was found"""

    array: ArrayRates
    notes: tuple[str, ...] = ()


def prepared(array: ArrayRates, parameters: FilterParameters) -> Prepared:
    """Made once for all methods that need it."""
    return array.once(("prepared", parameters), lambda: _prepared(array, parameters))


def _prepared(array: ArrayRates, parameters: FilterParameters) -> Prepared:  # noqa: ARG001
    return Prepared(array)

"""Gyros that say nothing: those that repeat one value, copies of another, and those without a measured noise.

The covariance of an array with such a gyro is singular, and a method that inverts it ends. `on_usable` gives a method
the others, and a weight of zero to these.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps

import numpy as np

from vgyro.fusion.types import ArrayNoise, ArrayRates, CannotRun, FilterParameters, Fused

Fuse = Callable[[ArrayRates, FilterParameters], Fused]
OF_GYROS = ("missing", "lowpass_hz")
"""Fields of ArrayRates whose last axis is that of the gyros, or None."""
FIRST_LOOK = 4096
"""Samples that are compared before all are."""


@dataclass(frozen=True)
class Usable:
    """kept : places of the gyros that are used, rising;  reasons : place → why a gyro is left out"""

    kept: list[int]
    reasons: dict[int, str]

    @property
    def note(self) -> str:
        """One line that names the gyros from 1."""
        return "; ".join(f"gyro {place + 1} is left out: {why}" for place, why in sorted(self.reasons.items()))


def usable_gyros(array: ArrayRates) -> Usable:
    """Which gyros of a recording move at all, and are no copy of one before them. One that is stuck is no copy.

    All of them where none moves, or none differs from another: then there is nothing to choose.
    """
    return array.once("usable", lambda: _usable(array.rate))


def _usable(rate: np.ndarray) -> Usable:
    kept: list[int] = []
    reasons: dict[int, str] = {}
    stuck = 0
    for place in range(rate.shape[1]):
        column = rate[:, place]
        same = next((one for one in kept if _equal(column, rate[:, one])), None)
        if _equal(column, column[0]):
            reasons[place] = f"it is {column[0]:.6g} deg/s in every sample"
            stuck += 1
        elif same is not None:
            reasons[place] = f"it is a copy of gyro {same + 1}"
        else:
            kept.append(place)
    if not kept or (len(kept) == 1 and not stuck):
        return Usable(list(range(rate.shape[1])), {})
    return Usable(kept, reasons)


def _equal(column: np.ndarray, other: np.ndarray | np.floating) -> bool:
    """Are all samples the same?  other : [T], or one value"""
    first = other[:FIRST_LOOK] if isinstance(other, np.ndarray) else other
    return bool((column[:FIRST_LOOK] == first).all() and (column == other).all())


def on_usable(fuse: Fuse, needs_arw: bool = True) -> Fuse:
    """The method `fuse`, run on the usable gyros; the others have the weight zero, and the note says why.

    needs_arw : a gyro whose angle random walk is not known is left out, too, where others have one
    raises    : as `fuse`; CannotRun if fewer than two gyros are usable
    """

    @wraps(fuse)
    def run(array: ArrayRates, parameters: FilterParameters) -> Fused:
        found = usable_gyros(array)
        if needs_arw:
            found = _with_noise(found, array.noise.with_arw(parameters.arw))
        if not found.reasons:
            return fuse(array, parameters)
        if len(found.kept) < 2:
            raise CannotRun(f"fewer than two gyros can be used: {found.note}")
        fused = fuse(_only(array, found.kept), parameters)
        note = "; ".join(part for part in (found.note, fused.note) if part)
        if not isinstance(fused.weights, np.ndarray):
            return replace(fused, note=note)
        weights = np.zeros(array.rate.shape[1])
        weights[found.kept] = fused.weights
        return replace(fused, weights=weights, note=note)

    return run


def _with_noise(found: Usable, noise: ArrayNoise) -> Usable:
    """Without the gyros that have no noise of their own; as it is where that is all of them."""
    known = np.isfinite(noise.arw) & (noise.arw > 0)
    kept = [place for place in found.kept if known[place]]
    if not kept:
        return found
    unknown = {place: "it has no measured angle random walk" for place in found.kept if not known[place]}
    return Usable(kept, {**found.reasons, **unknown})


def _only(array: ArrayRates, kept: list[int]) -> ArrayRates:
    """The array of some of the gyros; without weights, which are of all of them."""
    faults = tuple(replace(one, gyro=kept.index(one.gyro)) for one in array.faults if one.gyro in kept)
    columns = {name: getattr(array, name, None) for name in OF_GYROS}
    return replace(
        array,
        rate=np.asfortranarray(array.rate[:, kept]),
        noise=array.noise.of(kept),
        faults=faults,
        weights={},
        no_weights={},
        deviations={},
        **{name: values[..., kept] for name, values in columns.items() if values is not None},
    )

"""The rates as linear, Gaussian methods may take them: what is wrong with single samples and with scales is mended.

Done once for a recording; what comes after (R_t, slow errors, motion) knows nothing of it. Each step takes an array and
gives one, and says in a note what it found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vgyro.fusion.heavy_tails.samples import without_tails
from vgyro.fusion.motion.relative import Relative, without_relative
from vgyro.fusion.noise.motion_noise import motion_noise
from vgyro.fusion.samples.clipped import without_clipped
from vgyro.fusion.samples.missing import unseen
from vgyro.fusion.samples.quantised import grid, with_grid
from vgyro.fusion.samples.unseen import StandIn, stand_in
from vgyro.fusion.types import ArrayRates, FilterParameters

MENDED = {"clipped": "clipped", "outlier": "tails"}
"""Faults of single samples, and the parts that mend them: the rest of the stretch is as good as any."""


@dataclass(frozen=True)
class Prepared:
    """The rates made ready.

    array : as the methods take it;  notes : what was found;  step : of each gyro's values [N], deg/s, 0: none
    relative : answers of the gyros to the motion, taken off; None: not looked for, or the motion is too small
    guess : in motion, what is likely where no gyro says anything; None: there are no such samples
    """

    array: ArrayRates
    step: np.ndarray
    notes: tuple[str, ...] = ()
    relative: Relative | None = None
    guess: StandIn | None = None


def prepared(array: ArrayRates, parameters: FilterParameters) -> Prepared:
    """Made once for all methods that need it."""
    return array.once(("prepared", parameters), lambda: _prepared(array, parameters))


def _prepared(array: ArrayRates, parameters: FilterParameters) -> Prepared:
    notes, lost = [], unseen(array)
    mended = [kind for kind, part in MENDED.items() if parameters.has(part)]
    faults = tuple(one for one in array.faults if one.kind not in mended)
    if len(faults) < len(array.faults):
        array = replace(array, faults=faults)
    known = grid(array)
    step = known.step if parameters.has("quantised") else np.zeros(array.rate.shape[1])
    if parameters.has("clipped"):
        array, note = without_clipped(array)
        notes.append(note)
    relative = None
    if parameters.has("response") and parameters.in_motion:
        array, relative, note = without_relative(array)
        notes.append(note)
    if parameters.has("tails"):
        array, note = _without_tails(array, step, parameters)
        notes.append(note)
    array = with_grid(array, known)
    guess = stand_in(array, lost) if parameters.in_motion else None
    return Prepared(array, step, tuple(filter(None, notes)), relative, guess)


def _without_tails(array: ArrayRates, step: np.ndarray, parameters: FilterParameters) -> tuple[ArrayRates, str]:
    """Where the motion adds to the noise a sample far off is no sign of a gyro's tails, and stays as it is."""
    motion = motion_noise(array) if parameters.in_motion and parameters.has("motion") else None
    if motion is None:
        return without_tails(array, step)
    loud = np.broadcast_to(motion.loud_samples()[:, None], array.rate.shape)
    found, note = without_tails(replace(array, missing=loud if array.missing is None else loud | array.missing), step)
    return array if found.rate is array.rate else replace(array, rate=found.rate), note

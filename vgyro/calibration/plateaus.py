"""Plateaus of a rate table: found in a logged reference, and averaged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Floats

BATCHES = 20
FEWEST_BATCHES = 4
TURN = 360.0
DIRECTION_NAMES = {1: "up", -1: "down", 0: "none"}


@dataclass(frozen=True)
class PlateauMeans:
    """What a test on a rate table gives: P plateaus, N gyros.

    rate [P] deg/s; mean, standard_error [P, N] counts (NaN where clipped or empty); samples [P]
    time [P]      : middle of the average, s;  seconds [P] : its length
    turns [P]     : whole turns of the table that were averaged; 0: the plateau holds less than one
    direction [P] : 1 reached from a lower rate, -1 from a higher one, 0 the first, or the rate of the one before
    temperature [P, N] : mean, °C; NaN without a thermometer
    """

    rate: np.ndarray
    mean: np.ndarray
    standard_error: np.ndarray
    samples: np.ndarray
    time: np.ndarray
    seconds: np.ndarray
    turns: np.ndarray
    direction: np.ndarray
    temperature: np.ndarray


def find_plateaus(
    reference: np.ndarray,
    time: np.ndarray,
    min_duration_s: float = 3.0,
    settle_s: float = 1.0,
    tolerance: float | None = None,
) -> list[tuple[float, float, float]]:
    """Stretches of constant rate in a logged reference, as (start s, stop s, rate deg/s).

    reference : array [T], deg/s;  time : array [T], s, ascending
    settle_s  : cut from the start of each stretch, and half of it from the end
    tolerance : deg/s; two successive second-long means of a plateau differ by less. None: a thousandth of the span of
                the reference, or six times its own noise, whichever is larger
    returns   : stretches of at least min_duration_s after the cuts, in order of time
    """
    reference, time = np.asarray(reference, dtype=float), np.asarray(time, dtype=float)
    keep = np.isfinite(reference) & np.isfinite(time)
    reference, time = reference[keep], time[keep]
    if time.size < 2:
        return []
    step = max(float(np.median(np.diff(time))), 1e-9)
    width = max(round(min(0.5, min_duration_s / 6) / step), 1)
    if tolerance is None:
        noise = float(np.median(np.abs(np.diff(reference)))) * 1.4826 / np.sqrt(2)
        tolerance = max(1e-3 * float(np.ptp(reference)), 6 * noise / np.sqrt(width), 1e-9)
    blocks = time.size // width
    level = reference[: blocks * width].reshape(blocks, width).mean(axis=1)
    swing = np.ptp(reference[: blocks * width].reshape(blocks, width), axis=1)
    calm = swing <= max(tolerance, 8 * np.median(swing))
    plateaus, first = [], 0
    for block in range(1, blocks + 1):
        together = (
            block < blocks
            and calm[block]
            and calm[first]
            and abs(level[block] - np.median(level[first:block])) <= tolerance
        )
        if together:
            continue
        start, stop = time[first * width] + settle_s, time[block * width - 1] - settle_s / 2
        if calm[first] and stop - start >= min_duration_s:
            inside = (time >= start) & (time <= stop)
            plateaus.append((float(start), float(stop), float(np.mean(reference[inside]))))
        first = block
    return plateaus


def average_plateaus(
    counts: np.ndarray,
    time: np.ndarray,
    plateaus: list[tuple[float, float, float]],
    rails: tuple[float, float] | None = None,
    *,
    whole_turns: bool = True,
    temperature: np.ndarray | None = None,
) -> PlateauMeans:
    """Mean count of every gyro on every plateau, and its standard error by batch means.

    counts      : array [T, N], NaN where a channel has no value;  time : array [T], s
    plateaus    : (start, stop, rate) each, in order of time, the settling already left out
    rails       : counts at which the converter clips; a plateau with a clipped sample is NaN for that gyro
    whole_turns : average whole turns of the table where a plateau holds one (360°/|rate|), so that the horizontal part
                  of the Earth rate, gravity and the wobble of the table cancel; the end of the plateau is left out
    temperature : °C, [T] of one thermometer or [T, N] of one for each gyro
    returns     : PlateauMeans. Standard error: the average is cut into 20 batches (fewer where it is short) and the
                  spread of their means is taken, so that noise slower than a sample counts.
    """
    number = counts.shape[1]
    shape = (len(plateaus), number)
    mean, error, warmth = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, np.nan)
    samples = np.zeros(len(plateaus), dtype=np.int64)
    starts, stops, rate = (np.array([plateau[k] for plateau in plateaus], dtype=float) for k in range(3))
    turns = np.floor((stops - starts) * np.abs(rate) / TURN + 1e-9).astype(np.int64) if whole_turns else samples.copy()
    turned = turns > 0
    stops[turned] = starts[turned] + turns[turned] * TURN / np.abs(rate[turned])
    for row, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        first = np.searchsorted(time, start, side="left")
        # The sample at the end of a whole turn is the first one of the next turn.
        last = np.searchsorted(time, stop - 1e-9 if turned[row] else stop, side="left" if turned[row] else "right")
        part = np.asarray(counts[first:last], dtype=float)
        samples[row] = len(part)
        if len(part) < FEWEST_BATCHES:
            continue
        mean[row] = part.mean(axis=0)
        error[row] = _batch_error(part)
        for gyro in np.flatnonzero(np.isnan(mean[row])):
            # What a channel has is taken as if there were no more.
            own = part[~np.isnan(part[:, gyro]), gyro]
            if len(own) >= FEWEST_BATCHES:
                mean[row, gyro], error[row, gyro] = own.mean(), _batch_error(own[:, None])[0]
        if temperature is not None:
            warmth[row] = _mean_of_known(temperature[first:last])
        if rails is not None:
            clipped = (part <= rails[0]).any(axis=0) | (part >= rails[1]).any(axis=0)
            mean[row, clipped] = error[row, clipped] = np.nan
    direction = np.sign(np.diff(rate, prepend=rate[:1])).astype(np.int8)
    return PlateauMeans(
        rate, mean, error, samples, (starts + stops) / 2, stops - starts, turns, direction, warmth
    )  # fmt: skip


def _mean_of_known(values: Floats) -> Floats:
    """Mean along the first axis of the values that are there; NaN where there are none."""
    there = np.isfinite(values)
    if there.all():
        mean: Floats = np.mean(values, axis=0)
        return mean
    count = there.sum(axis=0)
    return np.where(count > 0, np.where(there, values, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)


def _batch_error(part: Floats) -> Floats:
    """Standard error of the mean of part [T, N] by batch means."""
    length = max(len(part) // BATCHES, 1)
    batches = len(part) // length
    means = part[: batches * length].reshape(batches, length, part.shape[1]).mean(axis=1)
    error: Floats = means.std(axis=0, ddof=1) / np.sqrt(batches)
    return error

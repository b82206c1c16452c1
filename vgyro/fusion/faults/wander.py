"""How far the bias of a gyro wanders in health: white noise of the block means, flicker and random walk, robustly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vgyro.fusion.faults.candidate import lengths_up_to, running_sum, spread
from vgyro.fusion.faults.residuals import Residuals

LOW_SHARE = 0.35
LOW_SQUARE = 0.2059
"""The 35 % quantile of the square of a standard normal variable: a fault in half of the windows inflates it 4.6-fold,
and the median without limit."""
LOW_NOISE = 6.0
"""Variance of a variance from that quantile, relative, times the number of windows."""
FEWEST_WINDOWS = 4
MEDIAN_NOISE = 1.25
CLEAR = 3.0
HIGH_SHARE = 0.8
HIGH_SQUARE = 1.642
"""The same of what the motion adds: hard motion adds more than its share."""
LEAST_VARIANCE = 1e-3
BEND_OF_FLICKER = 2.434
CONTRAST_OF_BEND = 2.0 / 3.0
ENOUGH_BLOCKS = 50
ENOUGH_SHARE = 0.2
NEARBY = 4  # blocks on each side


@dataclass(frozen=True)
class Slow:
    """The residual of one gyro in block means, and its healthy behaviour.

    mean   : [B] deg/s;  white : [B] (deg/s)², variance of its white part, from the noise in and around the block
    counts : [B], false where the mean is filled in;  run : [B], as of BlockSums
    flicker, walk : (deg/s)² and (deg/s)² a block: the difference of two neighbouring means of n blocks has the variance
                    flicker + 2/3·n·walk beside its white part
    measured : length → what the recording itself shows of that, where it has windows enough
    """

    mean: np.ndarray
    white: np.ndarray
    counts: np.ndarray
    run: np.ndarray
    flicker: float = 0.0
    walk: float = 0.0
    measured: dict[int, float] | None = None

    def wander(self, length: float) -> float:
        """Variance of the difference of neighbouring means of `length` blocks on average, without its white part."""
        modelled = self.flicker + self.walk * length * 2.0 / 3.0
        return max([modelled, *(value for known, value in (self.measured or {}).items() if known <= length)])

    @property
    def usual_white(self) -> float:
        return float(np.median(self.white))


def local_variance(found: Residuals, gyro: int) -> np.ndarray:
    """Variance of a sample of the residual in and around each block [B]: the greater one of the two, for bursts."""
    variance = np.where(np.isfinite(found.variance[:, gyro]), found.variance[:, gyro], found.expected[:, gyro])
    # A gyro that gives one value alone has noise all the same: that of its converter.
    variance = np.maximum(variance, LEAST_VARIANCE * found.expected[:, gyro])
    sums = running_sum(variance)
    blocks = np.arange(len(variance))
    low, high = np.maximum(blocks - NEARBY, 0), np.minimum(blocks + NEARBY + 1, len(variance))
    return np.maximum((sums[high] - sums[low]) / (high - low), variance)


def slow_part(found: Residuals, gyro: int, counts: np.ndarray, run: np.ndarray, mean: np.ndarray) -> Slow:
    """The residual means [B] of a gyro as a series without holes: a straight line bridges blocks that do not count."""
    mean = mean.copy()
    if counts.any() and not counts.all():
        places = np.arange(len(mean))
        mean[~counts] = np.interp(places[~counts], places[counts], mean[counts])
    return Slow(mean, _white(mean, found, gyro, counts), counts, run)


def _white(mean: np.ndarray, found: Residuals, gyro: int, counts: np.ndarray) -> np.ndarray:
    """Variance of a block mean [B]: proportional to that of the samples, and to the motion where the board moves."""
    local = local_variance(found, gyro)
    power = found.motion[:, gyro] ** 2 + found.energy[:, gyro]
    steps = np.diff(mean)
    both = counts[1:] & counts[:-1]
    moving = found.moving[1:] | found.moving[:-1]
    quiet = both & ~moving
    if quiet.sum() < max(ENOUGH_BLOCKS, ENOUGH_SHARE * both.sum()):
        quiet = both
    pair = local[1:] + local[:-1]
    share = spread(steps[quiet] / np.sqrt(pair[quiet])) ** 2 if quiet.any() else 1.0
    leak = 0.0
    if (both & moving).sum() >= ENOUGH_BLOCKS and not np.array_equal(quiet, both):
        excess = steps**2 - share * pair
        ratio = (excess / (power[1:] + power[:-1]))[both & moving]
        leak = max(float(np.quantile(ratio, HIGH_SHARE)) / HIGH_SQUARE, 0.0)
    return share * local + leak * np.where(found.moving, power, 0.0)


def contrasts(slow: Slow, length: int, before: int | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places b, mean of `length` blocks from b on less that of `before` ahead of b, and the variance of its white part.

    Only where both lie in one run.  before : None: length
    """
    ahead = before or length
    sums, white = running_sum(slow.mean), running_sum(slow.white)
    places = np.arange(ahead, len(slow.mean) - length + 1)
    places = places[slow.run[places - ahead] == slow.run[places + length - 1]]
    high, middle, low = places + length, places, places - ahead
    difference = (sums[high] - sums[middle]) / length - (sums[middle] - sums[low]) / ahead
    noise = (white[high] - white[middle]) / length**2 + (white[middle] - white[low]) / ahead**2
    return places, difference, noise


def _bends(slow: Slow, length: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First blocks of three neighbouring windows, m1 - 2·m2 + m3 of their means, and the variance of its white part."""
    sums, white = running_sum(slow.mean), running_sum(slow.white)
    first = np.arange(len(slow.mean) - 3 * length + 1)
    first = first[slow.run[first] == slow.run[first + 3 * length - 1]]
    edges = [first + length * part for part in range(4)]
    bend = (sums[edges[3]] - 3.0 * sums[edges[2]] + 3.0 * sums[edges[1]] - sums[edges[0]]) / length
    outer = white[edges[3]] - white[edges[2]] + white[edges[1]] - white[edges[0]]
    return first, bend, (outer + 4.0 * (white[edges[2]] - white[edges[1]])) / length**2


@dataclass(frozen=True)
class Bends:
    """What the bends of one gyro show, by length of the windows [L].

    excess : (deg/s)², variance of a bend beyond its white part;  white : that part;  error : standard error of excess
    """

    length: np.ndarray
    excess: np.ndarray
    white: np.ndarray
    error: np.ndarray


def bends_of(slow: Slow, healthy: np.ndarray) -> Bends:
    """Robust variances of the bends that lie in healthy blocks, for every length with windows enough."""
    rows = []
    masked = running_sum(~(healthy & slow.counts))
    for length in lengths_up_to(len(slow.mean) // 3):
        first, bend, white = _bends(slow, length)
        free = masked[first + 3 * length] == masked[first]
        windows = float(free.sum()) / (3 * length)
        if windows < FEWEST_WINDOWS:
            break
        ratio = np.quantile(bend[free] ** 2 / white[free], LOW_SHARE) / LOW_SQUARE
        usual = float(np.median(white[free]))
        rows.append((length, (ratio - 1.0) * usual, usual, max(ratio, 1.0) * usual * np.sqrt(LOW_NOISE / windows)))
    return Bends(*np.array(rows).reshape(-1, 4).T)


def healthy_array(parts: Sequence[Slow], bends: Sequence[Bends]) -> list[Slow]:
    """The parts with what their bias does in health.

    A day tells one gyro's flicker and walk, half an hour hardly: the medians of the array, whose gyros are of one kind,
    enter each gyro's fit as a guess that may be wrong by its own size. Bends (Hadamard) rather than contrasts (Allan),
    as an even drift of any length has none. Beside its white part a bend has the variance walk·n + 2.434·flicker, where
    a contrast has 2/3·walk·n + flicker: Hadamard and Allan variance of flicker are as ½·ln(256/27) to 2·ln 2, and a
    bend is six, a contrast two of these.
    """
    rows = min(len(one.length) for one in bends)
    if rows == 0:
        return list(parts)
    heights = {name: np.array([getattr(one, name)[:rows] for one in bends]) for name in ("excess", "white", "error")}
    medians = {name: np.median(value, axis=0) for name, value in heights.items()}
    medians["error"] = medians["error"] * MEDIAN_NOISE / np.sqrt(len(bends))
    shared, errors = _fitted(Bends(bends[0].length[:rows], **medians), np.zeros(3), np.full(3, np.inf))
    guess = np.array([shared[0], shared[1], 0.0])
    error = np.array([shared[0] + errors[0], shared[1] + errors[1], np.inf])
    found = []
    for part, one in zip(parts, bends, strict=True):
        (flicker, walk, more), _ = _fitted(one, guess, error)
        # What falls as white noise does is white: there is more of it than neighbouring blocks show.
        modelled = BEND_OF_FLICKER * flicker + one.length * walk + more * one.white
        clear = one.excess > modelled + CLEAR * one.error
        measured = {
            int(length): float(value) * CONTRAST_OF_BEND
            for length, value in zip(one.length[clear], (one.excess - more * one.white)[clear], strict=True)
        }
        found.append(
            replace(part, flicker=float(flicker), walk=float(walk), measured=measured, white=part.white * (1.0 + more))
        )
    return found


def _fitted(bends: Bends, guess: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """flicker, walk and further share of white noise, none below zero, and their standard errors.

    guess, error : [3] what was known of them before, and its standard errors
    """
    from scipy.optimize import nnls

    # Columns of one size: the solver is not told of units.
    size = np.array([bends.white[-1], bends.white[-1] / bends.length[-1], 1.0])
    design = np.column_stack([np.full(len(bends.length), BEND_OF_FLICKER), bends.length, bends.white]) * size
    design = np.vstack([design / bends.error[:, None], np.diag(size / error)])
    target = np.append(bends.excess / bends.error, np.where(np.isfinite(error), guess / error, 0.0))
    spread_of = np.sqrt(np.diag(np.linalg.pinv(design.T @ design)))
    return nnls(design, target)[0] * size, spread_of * size

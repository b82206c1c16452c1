"""More noise than usual: for long (noise) or for a short time (burst), from the variances of the blocks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from vgyro.fusion.faults.candidate import SuspectedFault, best_interval, lengths_up_to, running_sum, spread
from vgyro.fusion.faults.residuals import Residuals

LEAST_LONG = 1.25
LEAST_SHORT = 2.0
SHORT_S = 60.0
"""Least ratios of the standard deviation to the usual one, for hours and for SHORT_S or less: the noise of a healthy
gyro comes in clusters, too, the higher the shorter they are."""
LOW_SHARE = 0.15
LOW_PLACE = 1.036
"""So many standard deviations above its 15 % quantile lies the median of a normal variable."""
MOST_AT_ONCE = 64
APART = 64
"""Blocks between two windows whose noise no longer depends on each other's (GARCH noise of α + β = 0.95: 4 %)."""
FEWEST_WINDOWS = 16
LEAST_BREAK = 4  # blocks
LEAST_SHARE = 0.05


@dataclass(frozen=True)
class NoiseLevel:
    """Log-variance of one gyro's residual over its usual one.

    level  : [B] of log S² less what is usual, 0 in blocks that do not count
    counts : [B] the block counts
    spread : length of a window in blocks → standard deviation of the mean of `level` over it, in health
    share  : part of the usual variance that is the gyro's own
    """

    level: np.ndarray
    counts: np.ndarray
    spread: dict[int, float]
    share: float


def noise_level(found: Residuals, gyro: int, counts: np.ndarray, healthy: np.ndarray) -> NoiseLevel:
    """The log-variances, their usual level and how far it wanders by itself.

    counts  : [B], false where something else than noise is known to be wrong
    healthy : [B], true where the noise is not known to be at fault: what is usual is seen there
    The usual level is found from below, for the fault may last for most of the recording; how far it wanders, from
    differences between windows far apart, most of which no single change falls between. In motion the residual grows
    by a share of the motion that belongs to the array, not to a fault: scale factors, axes and clocks differ a little.
    """
    variance, expected = found.variance[:, gyro], found.expected[:, gyro]
    counts = counts & np.isfinite(variance) & (variance > 0)
    level = np.zeros(len(variance))
    healthy = healthy & counts if (healthy & counts).sum() >= FEWEST_WINDOWS else counts
    if not counts.any():
        return NoiseLevel(level, counts, {}, 1.0)
    level[counts] = np.log(variance[counts] / expected[counts])
    usual = _usual(level[healthy])
    usual_variance = expected * np.exp(usual)
    leak = _leak(found, gyro, healthy, usual_variance)
    level[counts] -= np.log1p(leak * found.energy[counts, gyro] / usual_variance[counts])
    usual_level = _usual(level[healthy])
    level = np.where(counts, level - usual_level, 0.0)
    others = (expected - found.sigma2[gyro]) / (expected * np.exp(usual_level))
    share = float(np.clip(1.0 - np.median(others), LEAST_SHARE, 1.0))
    return NoiseLevel(level, counts, _spreads(level[healthy], len(level)), share)


def _usual(level: np.ndarray) -> float:
    apart = max(1, min(APART, len(level) // 8))
    scatter = spread(level[apart:] - level[:-apart]) / np.sqrt(2.0) if len(level) > 2 * apart else spread(level)
    return float(min(np.quantile(level, LOW_SHARE) + LOW_PLACE * scatter, np.median(level)))


def _leak(found: Residuals, gyro: int, counts: np.ndarray, usual: np.ndarray) -> float:
    """Share of the motion's variance that is usual in the residual."""
    moving = counts & found.moving
    if moving.sum() < FEWEST_WINDOWS:
        return 0.0
    excess = (found.variance[moving, gyro] - usual[moving]) / found.energy[moving, gyro]
    return float(max(np.median(excess), 0.0))


def _spreads(level: np.ndarray, blocks: int) -> dict[int, float]:
    """Standard deviation of window means, in health, for every length of window."""
    sums, found = running_sum(level), dict[int, float]()
    floor = 0.0
    for length in lengths_up_to(blocks):
        means = (sums[length:] - sums[:-length]) / length
        apart = length + min(APART, max(1, len(level) // 8))
        if len(means) > apart + FEWEST_WINDOWS * length or length == 1:
            lagged = means[apart:] - means[:-apart] if len(means) > apart + FEWEST_WINDOWS else means - np.median(means)
            floor = max(spread(lagged) / np.sqrt(2.0), floor / np.sqrt(2.0), 1e-6)
        else:
            # Too few windows: at best the blocks add up as if they were independent.
            floor /= np.sqrt(2.0)
        found[length] = floor
    return found


def least_ratio(seconds: float) -> float:
    """Least ratio of a fault of that length."""
    return LEAST_LONG + (LEAST_SHORT - LEAST_LONG) * min(1.0, SHORT_S / seconds)


def suspect_noise(
    state: NoiseLevel, gyro: int, block_s: float, burst_s: float, threshold: float
) -> Iterator[SuspectedFault]:
    """The windows in which the noise is far above the usual, the farthest first, their ends by maximum likelihood.

    block_s : length of a block, s;  burst_s : a shorter event is a burst
    The evidence is the mean log-variance of the window over its standard deviation in health.
    """
    level, counts = state.level.copy(), state.counts.copy()
    for _ in range(MOST_AT_ONCE):
        found = _farthest(replace(state, level=level, counts=counts), block_s, threshold)
        if found is None:
            return
        evidence, (first, last), mean = found
        ratio, seconds = ratio_of(mean, state.share), (last - first) * block_s
        if ratio >= least_ratio(seconds):
            yield SuspectedFault(gyro, "burst" if seconds < burst_s else "noise", first, last, evidence, ratio, "1")
        level[first:last], counts[first:last] = 0.0, False


def _farthest(state: NoiseLevel, block_s: float, threshold: float) -> tuple[float, tuple[int, int], float] | None:
    """Evidence, first and last block, and mean level of the window that is farthest above the usual."""
    sums, usable = running_sum(state.level), running_sum(state.counts)
    best: tuple[float, int, int] | None = None
    for length, scatter in state.spread.items():
        if length > len(state.level) // 2 and length > 1:
            break
        means = (sums[length:] - sums[:-length]) / np.maximum(usable[length:] - usable[:-length], 0.5 * length)
        place = int(np.argmax(means))
        if ratio_of(means[place], state.share) < least_ratio(length * block_s):
            continue
        evidence = float(means[place]) / scatter
        if evidence >= threshold and (best is None or evidence > best[0]):
            best = evidence, place, place + length
    if best is None:
        return None
    evidence, first, last = best
    # What is below the usual counts as usual: only an increase is looked for.
    first, last = _unbroken(sums, *best_interval(sums, first, last), threshold * state.spread[1])
    number = max(usable[last] - usable[first], 1.0)
    mean = float(sums[last] - sums[first]) / number
    length = 1 << int(np.log2(number))
    evidence = max(evidence, mean / state.spread[length] * np.sqrt(number / length))
    while last < len(state.counts) and not state.counts[last]:
        last += 1
    return evidence, (first, last), mean


def _unbroken(sums: np.ndarray, first: int, last: int, price: float) -> tuple[int, int]:
    """The stretch, or the stronger of two parts of it that are apart by a stretch of usual noise.

    sums : as of best_interval;  price : two parts must gain the square of it: twice the log-likelihood ratio is Σx²/n
    """
    while last - first > 2 * LEAST_BREAK:
        mean = (sums[last] - sums[first]) / (last - first)
        # The break is where the sum of mean/2 - x grows most.
        lack = 0.5 * mean * np.arange(last - first + 1) - (sums[first : last + 1] - sums[first])
        low = np.minimum.accumulate(lack)
        stop = int(np.argmax(lack - low))
        start = int(np.argmin(lack[: stop + 1]))
        if start == 0 or stop == last - first or stop - start < LEAST_BREAK:
            break
        parts = ((first, first + start), (first + stop, last))
        gains = [(sums[high] - sums[low]) ** 2 / (high - low) for low, high in parts]
        if sum(gains) - mean**2 * (last - first) < price**2:
            break
        first, last = parts[int(np.argmax(gains))]
    return first, last


def mean_level(state: NoiseLevel, first: int, last: int) -> float:
    """Mean log-variance over the usual one in blocks [first, last)."""
    number = state.counts[first:last].sum()
    return float(state.level[first:last].sum()) / number if number else 0.0


def ratio_of(level: float, share: float) -> float:
    """Ratio of the gyro's own standard deviation to the usual one, from the log-variance of its residual.

    share : of the gyro's own noise in the usual variance of the residual
    """
    return float(np.sqrt(max(1.0 + (np.exp(level) - 1.0) / share, 0.0)))

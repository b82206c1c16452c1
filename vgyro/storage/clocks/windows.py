"""Minima over windows, periods and resolution: the arithmetic on stamps that the tests of a clock need."""

from __future__ import annotations

import numpy as np

MAX_LAG = 16_384
SHARP = 0.02  # spread of the mean step over a lag, at which it is taken for the period
STEADY_STEPS = 0.25  # spread of single steps, at which their middle is taken for the period if bursts are absent
SHORT_STEPS = 0.05  # share of steps below half a period, from which on rows come in bursts
LONG_STEP = 5  # times the 99th percentile of forward steps: such a one says nothing about the usual period
FIRST_LAG, ENOUGH_LAG = 16, 4096
MOST_OFF = 0.1  # of itself, that a rough period may be off


def forward_min(values: np.ndarray, width: int) -> np.ndarray:
    """[n]: least of values[i : i + width]; of fewer at the end."""
    count = -(-len(values) // width) + 1
    padded = np.full(count * width, np.inf)
    padded[: len(values)] = values
    blocks = padded.reshape(count, width)
    ahead = np.minimum.accumulate(blocks, axis=1).ravel()
    behind = np.minimum.accumulate(blocks[:, ::-1], axis=1)[:, ::-1].ravel()
    return np.minimum(behind[: len(values)], ahead[width - 1 : width - 1 + len(values)])


def backward_min(values: np.ndarray, width: int) -> np.ndarray:
    """[n]: least of values[i - width : i]; inf for the first."""
    return forward_min(np.concatenate([np.full(width, np.inf), values]), width)[: len(values)]


def midmean(values: np.ndarray) -> float:
    """Mean of what lies between the 16th and the 84th percentile, both included."""
    low, high = np.quantile(values, 0.16, method="lower"), np.quantile(values, 0.84, method="higher")
    return float(values[(values >= low) & (values <= high)].mean())


def robust_sd(values: np.ndarray) -> float:
    """From the median absolute deviation; 0 for no values."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values)))) if len(values) else 0.0


def without_long_steps(steps: np.ndarray) -> np.ndarray:
    """Steps, the longest cut to five times the 99th percentile of those forward."""
    forward = steps[steps > 0]
    return np.minimum(steps, LONG_STEP * np.quantile(forward, 0.99)) if len(forward) else steps


def rough_period(times: np.ndarray) -> tuple[float, int]:
    """The usual advance from row to row, however rows are bundled, and the lag that told; 0 or less: no advance.

    The shortest lag m (1, 2, 4 …) over which the advance varies by less than 2 % gives it; single steps also if they
    vary by less than 25 % and less than 5 % of them are below half of it, as losses spoil longer lags. Lags at
    which it is not within a factor of 1.5 of the advance over n/8 rows are passed over: m rows are part of a burst.
    times : float64 [n], n >= 2
    """
    times = np.concatenate([[0.0], np.cumsum(without_long_steps(np.diff(times)))])
    longest = min(max(1, len(times) // 8), MAX_LAG)
    mean = midmean(times[longest:] - times[:-longest]) / longest
    best, lag = (np.inf, mean, longest), 1
    while lag <= longest:
        advance = times[lag:] - times[:-lag]
        low, high = np.quantile(advance, [0.16, 0.84])
        period = midmean(advance) / lag
        if period > 0 and mean / 1.5 <= period <= mean * 1.5:
            spread = float(high - low) / 2 / (lag * period)
            steady = lag == 1 and spread < STEADY_STEPS and np.mean(advance < period / 2) < SHORT_STEPS
            if spread < SHARP or steady:
                return period, lag
            best = min(best, (spread, period, lag))
        lag *= 2
    return best[1:]


def refined_period(times: np.ndarray, period: float, rough_lag: int) -> float:
    """The period of an even grid, from the lower envelope of the times over ever longer lags.

    Lost samples shift the envelope by whole periods; where it is known to better than a quarter of one they are folded
    away (about the median at the first lag, as long as the period is rough), else the median over all pairs has to do,
    at lags above the one that told the rough period.
    times : float64 [n]; period, rough_lag: what `rough_period` gives
    """
    rows = np.arange(len(times))
    rough = rough_lag > 1  # single steps tell the period well enough
    lag = max(1, min(FIRST_LAG if rough else 2, len(times) // 8))
    # Longer lags would tell more of what happens in between: a clock that is set, drift.
    longest = min(len(times) // 2, max(ENOUGH_LAG, 2 * rough_lag))
    while lag <= longest:
        width = max(1, min(256, lag, len(times) // 16))
        # The last rows have no full window ahead of them.
        envelope = (forward_min(times - period * rows, width) + period * rows)[: len(times) - width + 1]
        if len(envelope) <= lag:
            break
        excess = (envelope[lag:] - envelope[:-lag]) / period - lag
        middle = float(np.median(excess))
        centre = middle if rough else 0.0
        fold = excess - centre - np.rint(excess - centre)
        sharp = float(np.quantile(np.abs(fold), 0.84)) < 0.25
        if rough:
            # Whole bursts would fold away as well, and one lag may be just one burst.
            sharp = all(_agree(envelope, period, span) for span in (lag, lag + lag // 2))
        change = (centre + midmean(fold) if sharp else middle) / lag
        if abs(change) < MOST_OFF and (sharp or lag >= rough_lag):
            period *= 1 + change
            rough = False
        lag *= 2
    return period


def _agree(times: np.ndarray, period: float, lag: int) -> bool:
    """Three quarters of the advances over a lag lie within a quarter of a period."""
    if len(times) <= lag:
        return False
    advance = (times[lag:] - times[:-lag]) / period
    return float(np.quantile(np.abs(advance - np.median(advance)), 0.75)) < 0.25


def resolution_ticks(stamps: np.ndarray) -> float:
    """The smallest step that stamps show, in ticks: the greatest common divisor of their steps on a decimal grid; the
    spacing of floating-point numbers if there is no such grid.

    stamps : [n], all usable
    """
    if np.issubdtype(stamps.dtype, np.integer):
        return float(_divisor(np.diff(stamps)))
    spacing = float(np.spacing(np.abs(stamps).max()))
    for digits in range(10):
        grid = 10.0**-digits
        tolerance = max(1e-3, 4 * spacing / grid)
        if tolerance > 0.05 or float(np.abs(stamps).max()) / grid > 2**52:
            break
        whole = np.rint(stamps / grid)
        if np.mean(np.abs(stamps / grid - whole) <= tolerance) >= 0.999:
            return grid * _divisor(np.diff(whole).astype(np.int64))
    return spacing


def _divisor(steps: np.ndarray) -> int:
    """Greatest common divisor of usual steps forward; wraps, restarts and damaged stamps have none."""
    steps = steps[steps > 0]
    if not len(steps):
        return 1
    return max(1, int(np.gcd.reduce(steps[steps <= LONG_STEP * np.quantile(steps, 0.99)])))

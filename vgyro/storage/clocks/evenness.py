"""What the stamps are: an even grid, arrival times of one, or uneven sampling. The test is in `judge`."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from vgyro.arrays import Floats
from vgyro.storage.clocks.windows import (
    SHORT_STEPS,
    forward_min,
    midmean,
    refined_period,
    robust_sd,
    rough_period,
)

SHORTEST_PERIOD = 1e-9  # s; less is no advance
FEW = 64  # rows; fewer tell little …
FEW_SPREAD = 0.28  # … but how far steps are from whole periods, r.m.s.
STRICTLY_EVEN = 0.005  # s.d. of the steps, periods: too little to accumulate within a few hundred rows
COHERENT = 0.25  # s.d. of the steps up to which their phase is told apart
SMALL_JITTER = 0.2  # r.m.s., periods: stamps are sampling times
STEADY_JITTER = 0.1  # … up to here single steps tell a lost sample
WALK = 0.35  # of the variance of independent steps
QUARTILES = 1.349  # distance of those of a normal distribution, sigma
COARSE = 0.02  # resolution, periods
LONG_PAUSE = 5.0  # mean steps, and …
BEYOND_USUAL = 2.0  # … times the 99.9th percentile of the steps …
FEW_STEPS = 1000  # … or, of fewer steps, times the former bound
ROUNDED_STEPS = 0.3  # resolution, periods
SHORTEST_BEAT = 3.0  # rows; closer odd steps are not odd
MIN_BEATS, BEAT_SPREAD = 8, 0.3  # regular odd steps: distances between them, and their s.d. over their mean
BURST_ROWS = 32  # of the envelope in which odd steps of bursts are looked for
REACH = 192  # rows after a loss within which it shows
ENVELOPE_ROWS = 256  # of the blocks whose minima tell the noise of the envelope
HORIZON, LONGEST_HORIZON = 2048, 65_536  # rows over which an envelope is taken


class Beat(NamedTuple):
    """rows: between odd steps; factor: the period in mean steps over that in usual steps."""

    rows: float
    factor: float


class Judgement(NamedTuple):
    """What the stamps are, from the head of the recording.

    period     : s
    even       : on a grid
    time_from  : "stamps", "line" or "envelope"
    losses     : how they are found: by "steps" of the stamps, by the "level" of their envelope, by "pauses"
    jitter     : s, r.m.s. about the grid; of the steps if uneven
    resolution : s
    horizon    : rows of the envelope; noise: of the envelope, one sigma, s
    reach      : rows after a loss within which it shows
    least_loss : samples that must be missing in a row to be seen
    pause      : s, a longer step is an interruption, of uneven stamps
    why        : a sentence
    """

    period: float
    even: bool
    time_from: Literal["stamps", "line", "envelope"]
    losses: Literal["steps", "level", "pauses"]
    jitter: float
    resolution: float
    horizon: int
    noise: float
    reach: int
    least_loss: int
    pause: float
    why: str


def judge(times: np.ndarray, resolution: float, finest: float, meaning: str) -> Judgement | None:
    """Decide what the stamps are.

    1. Grid or walk. Stamps about an even grid, however late they arrive, stay near it: the variance of s[k+m]-s[k] does
       not grow with m. The steps of a poll loop are independent: it grows as m. Lost samples shift a grid by whole
       periods P, so that where steps spread by less than 0.25 P and bursts are absent, phases are compared: with
       R(m) = |mean exp(2πi (s[k+m]-s[k])/P)|, a grid has R(m) = R(1), a walk R(1)^m. The smallest m (a power of two up
       to 1024) with R(1)^m < 0.3 decides, at the geometric mean of both. Steps that spread by less than 0.005 P are
       even. Else, the variances: a walk if D(m) > 0.35 m D(1) at m = n/64, at least 8 and at most 1024; the outer
       0.5 % of steps are cut off, and D(m) is taken from the quartiles. With fewer than 64 rows only the distance of
       steps from whole periods counts: even below 0.28 P.
    2. On a grid: stamps that are off by up to 0.25 to 1.2 steps of their resolution, and that above 0.02 P, are
       rounded: sampled, time from the line through them. With less than 0.2 P r.m.s. of jitter, and less than 5 % of
       steps below half a period, they are sampled: time is the stamp. Else they are arrival times, never earlier than
       the sample: time is the lower envelope.
    3. Off the grid: sampled unevenly, time is the stamp.
    Steps of one or more whole resolutions: samples are missing, unless the odd ones come regularly (nine or more,
    distances with a s.d. below 0.3 of their mean, chance gives 1; or 17 or more, below 0.15 of their median): then the
    period is no whole number of ticks. Likewise for bursts of nearly a whole number of samples.
    What this cannot tell: latency that wanders over more than m rows looks like a walk, and a lost sample at regular
    distances like rounding, if the period is one tick.

    times      : float64 [n], s, wraps undone, repeats dropped
    resolution : s, as the steps show it; finest: s, taken instead if that is but the period
    meaning    : "auto"; "sampled" and "arrival" set the meaning, the test still says whether it is a grid
    returns    : None if the times do not advance
    """
    if len(times) < 2:
        return None
    period, lag = rough_period(times)
    if not period >= SHORTEST_PERIOD:
        return None
    steps, beat, on_tick = np.diff(times), None, False
    if 0.95 < period / resolution < 1.05:
        beat = _beat(np.rint(steps / resolution))
        on_tick = beat is None
        period, resolution = (resolution, finest) if beat is None else (resolution * beat.factor, resolution)
    phase_sd, short = _step_phase(steps, period)
    even, why = _on_grid(times, period, phase_sd, short)
    if not even and meaning != "arrival":
        return _uneven(times, period, resolution, why)
    if len(times) >= FEW and beat is None and not on_tick:
        period = refined_period(times, period, lag)
        phase_sd, short = _step_phase(steps, period)
    coarse = resolution > COARSE * period and not on_tick and _is_rounded(times, period, resolution)
    coarse = coarse or beat is not None
    if short >= SHORT_STEPS and not coarse and (beat := _beat_of_bursts(times, period)) is not None:
        period *= beat.factor
    jitter = phase_sd / math.sqrt(2) if short < SHORT_STEPS and phase_sd < math.inf else math.inf
    time_from, why_time = _time_from(meaning, coarse, jitter, resolution / period)
    # Rounding by more than this moves single steps by as much as a lost sample does.
    fine = not coarse or resolution < ROUNDED_STEPS * period
    steady = jitter < STEADY_JITTER and time_from != "envelope" and fine
    if jitter > SMALL_JITTER:
        jitter = _local_jitter(times, period)
    why = f"{why}; {why_time}"
    return _even(times, _Grid(period, resolution, jitter, steady, coarse, beat), time_from, why)


class _Grid(NamedTuple):
    """An even grid as its stamps show it: period, s; their resolution, s; r.m.s. jitter, periods.

    steady : single steps show losses;  coarse : stamps are rounded;  beat : odd steps that come regularly
    """

    period: float
    resolution: float
    jitter: float
    steady: bool
    coarse: bool
    beat: Beat | None


def _even(times: np.ndarray, grid: _Grid, time_from: Literal["stamps", "line", "envelope"], why: str) -> Judgement:
    """How losses are looked for on a grid."""
    period, resolution, jitter, steady, coarse, beat = grid
    horizon, reach = _horizon(len(times), resolution / period), REACH
    if beat is not None:
        # A rounded stamp moves against the grid for as many rows before it jumps back.
        horizon = int(min(max(HORIZON, 1.5 * beat.rows), LONGEST_HORIZON))
        reach = int(min(max(REACH, 1.2 * beat.rows), horizon))
    noise = _envelope_noise(times, period, horizon if coarse or beat else min(ENVELOPE_ROWS, horizon))
    # Five sigma of the envelope, and at least half a period.
    least = 1 if steady else max(1, math.ceil(min(5 * noise / period + 0.5, 1e9)))
    losses: Literal["steps", "level"] = "steps" if steady else "level"
    return Judgement(
        period, True, time_from, losses, jitter * period, resolution, horizon, noise, reach, least, math.inf, why
    )


def _step_phase(steps: np.ndarray, period: float) -> tuple[float, float]:
    """S.d. of the steps modulo the period, in periods, and the share of steps below half a period."""
    concentration = abs(np.exp(2j * np.pi * np.fmod(steps / period, 1.0)).mean())
    spread = math.sqrt(max(0.0, -2 * math.log(concentration))) / (2 * math.pi) if concentration > 1e-9 else math.inf
    return spread, float(np.mean(steps < 0.5 * period))


def _on_grid(times: np.ndarray, period: float, phase_sd: float, short: float) -> tuple[bool, str]:
    rows = len(times)
    if rows < FEW:
        periods = np.diff(times) / period
        spread = float(np.std(periods - np.maximum(1, np.rint(periods))))
        return spread < FEW_SPREAD, f"{rows} rows: steps spread by {spread:.3g} periods"
    if short < SHORT_STEPS and phase_sd <= STRICTLY_EVEN:
        return True, f"steps spread by {phase_sd:.2g} periods"
    if short < SHORT_STEPS and phase_sd < COHERENT:
        return _by_phase(times, period)
    return _by_variance(times)


def _by_phase(times: np.ndarray, period: float) -> tuple[bool, str]:
    def concentration(lag: int) -> float:
        turns = np.fmod((times[lag:] - times[:-lag]) / period, 1.0)
        return float(abs(np.exp(2j * np.pi * turns).mean()))

    first = concentration(1)
    lag, most = 2, max(2, min(1024, len(times) // 8))
    while first**lag >= 0.3 and 2 * lag <= most:
        lag *= 2
    found, walk = concentration(lag), first**lag
    text = f"phases over {lag} steps agree to {found:.2g} (a grid: {first:.2g}, independent steps: {walk:.2g})"
    return found > math.sqrt(first * walk), text


def _by_variance(times: np.ndarray) -> tuple[bool, str]:
    lag = max(min(1024, len(times) // 64), min(8, len(times) // 8))

    steps = np.diff(times)
    one = float(np.clip(steps, *np.quantile(steps, [0.005, 0.995])).var())
    # Stalls spoil many long lags, though few steps: quartiles, scaled as those of a normal distribution.
    low, high = np.quantile(times[lag:] - times[:-lag], [0.25, 0.75])
    ratio = float((high - low) / QUARTILES) ** 2 / (lag * one) if one > 0 else 0.0
    return ratio <= WALK, f"over {lag} steps the variance is {ratio:.2g} of that of independent steps"


def _uneven(times: np.ndarray, period: float, resolution: float, why: str) -> Judgement:
    steps = np.diff(times)
    pause = max(LONG_PAUSE * period, BEYOND_USUAL * float(np.quantile(steps, 0.999)))
    if len(steps) < FEW_STEPS:
        # The longest step itself must not be what is usual.
        pause = min(pause, BEYOND_USUAL * LONG_PAUSE * period)
    usual = steps[steps <= pause]
    mean = float(usual.mean()) if len(usual) and usual.mean() > 0 else period
    spread = float(usual.std()) if len(usual) else 0.0
    why = f"{why}; sampled unevenly, steps {mean:.4g} s ± {spread:.2g} s"
    return Judgement(mean, False, "stamps", "pauses", spread, resolution, 1, 0.0, 1, 1, pause, why)


def _time_from(
    meaning: str, coarse: bool, jitter: float, resolution: float
) -> tuple[Literal["stamps", "line", "envelope"], str]:
    if meaning == "arrival":
        return "envelope", "arrival times, as was set"
    if coarse:
        return "line", f"rounded to {resolution:.2g} periods"
    if meaning == "sampled":
        return "stamps", "sampled, as was set"
    if jitter < SMALL_JITTER:
        return "stamps", f"jitter {jitter:.2g} periods r.m.s.: stamps are sampling times"
    return "envelope", "far off an even grid for a while, but not for good: stamps are arrival times"


def _blocks(times: Floats, period: float, width: int) -> Floats:
    """[n / width, width]: distance from a line of that period, block by block."""
    rest = times - period * np.arange(len(times))
    width = max(1, min(width, len(times)))
    count = len(times) // width
    return rest[: count * width].reshape(count, width)


def _is_rounded(times: np.ndarray, period: float, resolution: float) -> bool:
    """Distances from the line fill a good part of one step of the resolution, and no more, in short or long blocks."""
    for width in (FEW, 16 * FEW, int(min(4 * resolution / period, LONGEST_HORIZON))):
        blocks = _blocks(times, period, min(max(FEW, width), max(FEW, len(times) // 4)))
        if 0.25 <= float(np.median(np.ptp(blocks, axis=1))) / resolution <= 1.2:
            return True
    return False


def _beat(ticks: np.ndarray) -> Beat | None:
    """Odd steps that come regularly; None if they do not. See `judge`.

    ticks : [n], whole periods (or ticks) from row to row
    """
    ahead = np.cumsum(ticks - 1)
    ahead = np.maximum.accumulate(ahead if ahead[-1] > 0 else -ahead)
    # Jitter about a bound of the rounding goes to and fro: only the first time counts.
    odd = np.flatnonzero(np.diff(ahead, prepend=0.0) > 0)
    apart = np.diff(odd)
    if len(apart) < MIN_BEATS or np.mean(np.diff(ahead[odd]) == 1) < 0.95:
        return None
    rows = float(apart.mean())
    if float(apart.std()) >= BEAT_SPREAD * rows:
        # A few lost samples among many regular steps.
        rows = float(np.median(apart))
        if len(apart) < 2 * MIN_BEATS or robust_sd(apart) >= BEAT_SPREAD / 2 * rows:
            return None
    if rows < SHORTEST_BEAT:
        return None
    return Beat(rows, 1 + np.sign(ticks.mean() - 1) / rows)


def _beat_of_bursts(times: np.ndarray, period: float) -> Beat | None:
    """Bursts of nearly a whole number of samples: the period seems to be a fraction of the burst's, with odd steps."""
    width = max(1, min(BURST_ROWS, len(times) // 16))
    envelope = forward_min(times / period - np.arange(len(times)), width)[: len(times) - width + 1]
    phase = float(np.angle(np.exp(2j * np.pi * envelope).mean())) / (2 * np.pi)
    return _beat(np.diff(np.rint(envelope - phase)) + 1)


def _local_jitter(times: np.ndarray, period: float) -> float:
    """R.m.s. in periods; the median over blocks, for gaps and stalls."""
    return float(np.median(_blocks(times, period, FEW).std(axis=1))) / period


def _horizon(rows: int, resolution: float) -> int:
    """Rows of the envelope: long enough for every phase of a rounded stamp, and for stalls; an eighth of the head."""
    wanted = int(min(max(HORIZON, 4 * resolution), LONGEST_HORIZON))
    return max(4, min(wanted, rows // 8))


def _envelope_noise(times: np.ndarray, period: float, width: int) -> float:
    """One sigma of the minima of blocks, s."""
    width = max(1, min(width, len(times) // 4))
    envelope = forward_min(times - period * np.arange(len(times)), width)[: len(times) - width + 1 : width]
    return robust_sd(np.diff(envelope))


def level_slope(times: np.ndarray, period: float, width: int) -> float:
    """The local period, from minima of blocks of `width` rows, two blocks apart; losses are folded away."""
    lag = 2
    blocks = _blocks(times, period, width).min(axis=1)
    if len(blocks) < 4 * lag:
        return period
    excess = (blocks[lag:] - blocks[:-lag]) / period
    return period * (1 + midmean(excess - np.rint(excess)) / (lag * width))

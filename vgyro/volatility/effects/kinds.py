"""What an ARCH effect of a gyro's level is: changing variance, drift, a tone, a knock, correlation, or nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vgyro.errors import TooShort
from vgyro.volatility.arch_lm import arch_lm, kurtosis
from vgyro.volatility.effects.whiten import FEWEST_SAMPLES, SeriesLine, Whitened, block_gain, usual_size, whiten
from vgyro.volatility.garch import garch_variance
from vgyro.volatility.series import detrended

LONG_LAGS = 12
"""Lags of a second ARCH-LM test: it sees a small α with a large β, which one lag does not."""
VARIANCE_LEVEL = 0.02
"""Level of each of the two ARCH-LM tests of the whitened series; positive correlation of squares is half of it."""
MODEL_LEVEL = 0.01
"""Level at which ARCH-LM of the standardised series says that GARCH(1,1) does not explain the effect."""
DRIFT_LEVEL = 0.01
LEVEL_LEVEL = 0.05
"""Level at which the ARCH-LM test of the level counts as failed, as in Liu et al. (2015)."""
VISIBLE = 0.01  # share of the variance above which a tone is named even if it makes no ARCH effect
BROAD = 0.1  # share of the variance that a tone of the rate must reach if no line is found in the series
SEEN_WITHIN = 3.0  # ratio of a tone's amplitude in the series to what the rate's tone gives there
MOST_EPISODES, EPISODE_S, PAUSE_S = 5, 30.0, 10.0
LOUD = 20.0  # standard deviations: no GARCH model's own sample


@dataclass(frozen=True)
class RateTone:
    """A line in the spectrum of the rate: frequency [Hz], amplitude [deg/s]."""

    frequency: float
    amplitude: float


@dataclass(frozen=True)
class GarchEffect:
    """GARCH(1,1) of the series, as fitted."""

    omega: float
    alpha: float
    beta: float


@dataclass(frozen=True)
class Sampled:
    """How the series was made of the rate: its time [T] s and rate [Hz], samples of the rate in each of its means.

    resolution : Hz, how well the frequency of a RateTone is known
    """

    time: np.ndarray
    rate_hz: float
    block: int
    resolution: float


@dataclass(frozen=True)
class SeenTone:
    """A tone in the series.

    frequency, amplitude : in the rate, where a line of the rate fits; else as in the series
    seen_at, seen : frequency and amplitude in the series;  known : True if a line of the rate fits
    share : of the variance of the series about its drift;  statistic : ARCH-LM that it makes alone
    """

    frequency: float
    amplitude: float
    seen_at: float
    seen: float
    known: bool
    share: float
    statistic: float


@dataclass(frozen=True)
class Episode:
    """A short disturbance: its strongest sample's time [s], and its size in standard deviations of the noise."""

    time: float
    size: float


@dataclass(frozen=True)
class EffectEvidence:
    """What the tests say of one gyro; a statistic and its p-value are pairs, NaN where there is none.

    level, detrended, whitened, standardised : ARCH-LM of the four series
    calm, calm_long : ARCH-LM of the whitened series without its short disturbances, with few and with LONG_LAGS lags
    attract, attract_long : True if the squares correlate positively over those lags, as an ARCH process makes them
    kurtosis, calm_kurtosis : of the whitened series, and without disturbances
    drift     : ARCH-LM that the drift makes alone; None: there is no drift, or the level's test is passed
    moved     : deg/s, how far the drift goes
    tone      : the strongest tone worth naming, or None
    episodes  : the short disturbances, if they are few
    neighbours : correlation of neighbouring samples about the drift; None: it explains no ARCH effect
    """

    lags: int
    level: tuple[float, float]
    detrended: tuple[float, float]
    whitened: tuple[float, float]
    standardised: tuple[float, float]
    standardised_long: tuple[float, float]
    calm: tuple[float, float]
    calm_long: tuple[float, float]
    attract: bool
    attract_long: bool
    kurtosis: float
    calm_kurtosis: float
    drift: float | None
    moved: float
    tone: SeenTone | None
    episodes: tuple[Episode, ...]
    neighbours: float | None

    @property
    def heteroskedastic(self) -> bool:
        """True if the variance changes: one of the two tests of the whitened series fails without the knocks."""
        few = self.attract and self.calm[1] < VARIANCE_LEVEL
        return few or (self.attract_long and self.calm_long[1] < VARIANCE_LEVEL)

    @property
    def knocks(self) -> tuple[Episode, ...]:
        """The disturbances worth naming: all, but beside changing variance only those that no variance explains."""
        return tuple(episode for episode in self.episodes if not self.heteroskedastic or episode.size > LOUD)


def gather_evidence(
    series: np.ndarray, sampled: Sampled, span: int, lags: int, tones: Sequence[RateTone], garch: GarchEffect | None
) -> EffectEvidence | None:
    """Test one series [T] deg/s of one stretch; None if it does not vary, lacks values, or has less than 50.

    span : samples of the running mean and median;  lags : of ARCH-LM;  tones : of the rate;  garch : its model, or None

    The rules; white noise gets any verdict but `nothing` in less than 5 % of cases (T = 360 and 3600).
    heteroskedastic : ARCH-LM of the whitened series fails at 2 %, with `lags` or with 12 lags, short disturbances left
                      out, and the squares correlate positively (α >= 0; one-sided as in Lee & King 1993)
    disturbance     : samples that noise of constant variance does not make (1 of 1000 series), in at most 5 episodes of
                      at most 30 s; beside heteroskedastic, only one of more than 20 standard deviations
    drift           : the level fails ARCH-LM at 5 %; means over `span` samples scatter more than the noise lets them
                      (chi², 1 %); and the drift with noise of constant variance would make ARCH-LM fail at 1 %
    tone            : a line in the series (1 %; vgyro.volatility.effects.whiten) that makes ARCH-LM fail alone at
                      1 %, or holds 1 % of the variance; or a line of the rate that would hold 10 % of the variance,
                      where the detrended series fails at 1 %. It is named by the line of the rate that is seen at that
                      place, aliased, with that amplitude, the gain of the means counted (within a factor of 3).
    correlation     : nothing else, and the correlation of neighbours makes the detrended series fail ARCH-LM at 1 %.
                      Correlation over more than about a tenth of `span` counts as drift.
    Of a component d_t, with noise n_t of variance s² and kurtosis κ, e² = (d + n)² has the autocorrelation
    ρ = cov(d²_t, d²_{t+1})/(var(d²) + 4 mean(d²) s² + (κ - 1) s⁴), and ARCH-LM is about T·ρ² [derived].
    """
    series = np.asarray(series, dtype=float)
    if not np.isfinite(series).all():
        return None
    parts = whiten(series, sampled.rate_hz, span)
    if len(series) < max(FEWEST_SAMPLES, 2 * LONG_LAGS + 2, 2 * lags + 2) or not np.isfinite(parts.residual).all():
        return None
    episodes, calm = _episodes(parts, sampled)
    residual = parts.quiet if episodes else parts.residual
    level = _test(series, lags)
    loose = _test(detrended(series[:, None], span)[:, 0], lags)
    rest = series - parts.drift - parts.tones
    if episodes:
        rest = np.where(parts.disturbed, 0.0, rest)
    tails = float(kurtosis(residual[calm][:, None])[0])
    noise = _Noise(float(np.mean(np.square(rest))), tails, _long_run(rest, residual, parts.autoregression), len(series))
    drift = _drift(parts, rest, noise, span) if level[1] < LEVEL_LEVEL else None
    standard, standard_long = _standardised(series, garch, lags)
    return EffectEvidence(
        lags, level, loose, _test(parts.residual, lags), standard, standard_long,
        _test(residual, lags, calm), _test(residual, LONG_LAGS, calm),
        _attract(residual, lags, calm), _attract(residual, LONG_LAGS, calm),
        float(kurtosis(parts.residual[:, None])[0]), tails,
        drift, float(np.ptp(parts.drift)), _tone(parts, noise, sampled, tones, loose[1]), episodes,
        _neighbours(rest, parts, loose[1], len(series)),
    )  # fmt: skip


@dataclass(frozen=True)
class _Noise:
    """variance and kurtosis of the series about drift and tones; long_run: T times the variance of a mean of T"""

    variance: float
    kurtosis: float
    long_run: float
    samples: int

    def arch_lm(self, component: np.ndarray, own: float = 0.0) -> float:
        """ARCH-LM(1) that a component [T] makes with noise of constant variance; own: noise in its covariance."""
        square = np.square(component)
        covariance = float(np.cov(square[1:], square[:-1])[0, 1])
        covariance = math.copysign(max(abs(covariance) - own, 0.0), covariance)
        total = square.var() + 4 * square.mean() * self.variance + (self.kurtosis - 1) * self.variance**2
        return self.samples * (covariance / float(total)) ** 2


def _test(series: np.ndarray, lags: int, keep: np.ndarray | None = None) -> tuple[float, float]:
    try:
        found = arch_lm(series[:, None], lags, keep)
    except TooShort:
        return math.nan, math.nan
    return float(found.statistic[0]), float(found.p_value[0])


def _attract(series: np.ndarray, lags: int, keep: np.ndarray) -> bool:
    """True if the squares' autocovariances over the lags have a positive sum."""
    away = np.where(keep, np.square(series) - np.mean(np.square(series[keep])), 0.0)
    return sum(float(away[lag:] @ away[:-lag]) for lag in range(1, lags + 1)) > 0


def _standardised(series: np.ndarray, garch: GarchEffect | None, lags: int) -> tuple[tuple[float, float], ...]:
    """ARCH-LM of the series over its GARCH model's deviation, with few and with many lags."""
    if garch is None or not math.isfinite(garch.omega):
        return (math.nan, math.nan), (math.nan, math.nan)
    model = (np.array([each]) for each in (garch.omega, garch.alpha, garch.beta))
    standardised = series / np.sqrt(garch_variance(series[:, None], *model)[:, 0])
    return _test(standardised, lags), _test(standardised, LONG_LAGS)


def _limit(level: float, lags: int = 1) -> float:
    from scipy.special import chdtri

    return float(chdtri(lags, level))


def _long_run(rest: np.ndarray, residual: np.ndarray, autoregression: np.ndarray) -> float:
    """T·var(mean of T samples) of the noise: of the autoregression, but no less than of white noise."""
    plain = float(np.mean(np.square(rest)))
    return max(plain, float(np.mean(np.square(residual))) / max(1 - float(autoregression.sum()), 0.05) ** 2)


def _episodes(parts: Whitened, sampled: Sampled) -> tuple[tuple[Episode, ...], np.ndarray]:
    """The short disturbances, and [T] true for the samples outside them; none if they are many or long."""
    everything = np.ones(len(parts.disturbed), dtype=bool)
    places = np.flatnonzero(parts.disturbed)
    pause = max(round(PAUSE_S * sampled.rate_hz), 2)
    groups = np.split(places, np.flatnonzero(np.diff(places) > pause) + 1) if places.size else []
    longest = max((group[-1] - group[0] for group in groups), default=0)
    if not groups or len(groups) > MOST_EPISODES or longest > EPISODE_S * sampled.rate_hz:
        return (), everything
    size = usual_size(parts.quiet)
    found = []
    for group in groups:
        strongest = group[np.argmax(np.abs(parts.residual[group]))]
        found.append(Episode(float(sampled.time[strongest]), float(abs(parts.residual[strongest]) / size)))
        everything[max(group[0] - pause // 2, 0) : group[-1] + pause // 2 + 1] = False
    return tuple(found), everything


def _drift(parts: Whitened, rest: np.ndarray, noise: _Noise, span: int) -> float | None:
    """ARCH-LM that the drift makes alone; None if there is none, or it makes no ARCH effect."""
    from scipy.special import chdtrc

    count = len(rest) // span
    if count < 3:
        return None
    means = (parts.drift + rest)[: count * span].reshape(count, span).mean(axis=1)
    scatter = float(means.var()) * count * span / noise.long_run
    if not chdtrc(count - 1, scatter) < DRIFT_LEVEL:
        return None
    mean = float(np.mean(np.square(parts.drift)))
    statistic = noise.arch_lm(parts.drift, 4 * mean * np.pi / 2 * noise.long_run / span)
    return statistic if statistic > _limit(DRIFT_LEVEL) else None


def _tone(
    parts: Whitened, noise: _Noise, sampled: Sampled, tones: Sequence[RateTone], p_detrended: float
) -> SeenTone | None:
    """The strongest tone that is worth naming."""
    total = noise.variance + float(np.mean(np.square(parts.tones)))
    if parts.lines:
        line = max(parts.lines, key=lambda one: one.amplitude)
        statistic = noise.arch_lm(parts.tones + np.median(parts.drift))
        share = line.amplitude**2 / 2 / total
        if statistic <= _limit(DRIFT_LEVEL) and share < VISIBLE:
            return None
        source = _source(line, sampled, tones)
        if source is None:
            return SeenTone(line.frequency, line.amplitude, line.frequency, line.amplitude, False, share, statistic)
        return SeenTone(source.frequency, source.amplitude, line.frequency, line.amplitude, True, share, statistic)
    reaching = [(tone.amplitude * _gain(tone, sampled), tone) for tone in tones]
    if not reaching or not p_detrended < DRIFT_LEVEL:
        return None
    seen, tone = max(reaching, key=lambda pair: pair[0])
    share = seen**2 / 2 / total
    if share < BROAD:
        return None
    return SeenTone(tone.frequency, tone.amplitude, alias(tone.frequency, sampled.rate_hz), seen, True, share, math.nan)


def _source(line: SeriesLine, sampled: Sampled, tones: Sequence[RateTone]) -> RateTone | None:
    """The tone of the rate that a line of the series is: at the same place, aliased, and nearest in amplitude."""
    ratios = [
        (abs(math.log(max(tone.amplitude * _gain(tone, sampled), 1e-300) / line.amplitude)), place)
        for place, tone in enumerate(tones)
        if abs(alias(tone.frequency, sampled.rate_hz) - line.frequency) <= sampled.resolution
    ]
    ratio, place = min(ratios, default=(math.inf, -1))
    return tones[place] if ratio <= math.log(SEEN_WITHIN) else None


def alias(frequency: float, rate_hz: float) -> float:
    """Where a frequency is seen in a series of a rate, Hz."""
    return abs(frequency - rate_hz * round(frequency / rate_hz))


def _gain(tone: RateTone, sampled: Sampled) -> float:
    return abs(block_gain(tone.frequency / (sampled.rate_hz * sampled.block), sampled.block))


def _neighbours(rest: np.ndarray, parts: Whitened, p_detrended: float, samples: int) -> float | None:
    """Correlation of neighbouring samples, if it makes the squares correlate (as its square) beyond chance."""
    if not parts.autoregression.size or not p_detrended < DRIFT_LEVEL:
        return None
    correlation = float(rest[1:] @ rest[:-1] / (rest @ rest))
    return correlation if samples * correlation**4 > _limit(DRIFT_LEVEL) else None

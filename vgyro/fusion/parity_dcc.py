"""Which forecasts the noise of the gyros better: DCC, or the exponentially weighted mean of the parity squares."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vgyro import engine as engines
from vgyro.fusion.array import ArrayRates, FilterParameters
from vgyro.fusion.blocks import SampleWeights
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.parity import Variances
from vgyro.fusion.parity_blocks import block_moments
from vgyro.fusion.parity_changing import changing_variances, residual_means
from vgyro.fusion.parity_hat import constant_variances, parity_deviance
from vgyro.fusion.parity_memory import TIME_CONSTANTS_S, LowPass

BURN_IN = 16
"""Blocks that a mean must know before it is a forecast."""
FEWEST_BLOCKS = 100
MOST_BLOCKS = 1 << 18
"""No more are compared: the first three days of them at 1 Hz."""
SIGNIFICANT = 2.0


@dataclass(frozen=True)
class Score:
    """Forecasts compared by the mean deviance of the differences between the gyros (QLIKE of a vector); less is better.

    prefer    : DCC is better, by more than two standard errors
    t         : of Diebold & Mariano, above zero where DCC is better; NaN: they could not be compared
    dcc, ewma : mean losses;  blocks : how many
    """

    prefer: bool
    t: float
    dcc: float
    ewma: float
    blocks: int
    note: str


def prefer_dcc(
    array: ArrayRates, parameters: FilterParameters, variances: Variances, model: str = "dcc", mode: str = "causal",
    definition: str = "residual",
) -> Score:  # fmt: skip
    """Do the data support DCC against the EWMA? Test of Diebold & Mariano (1995, J. Bus. Econ. Stat. 13, 253-263).

    Both forecast the variances of the block means that DCC was made for. Judged is the likelihood of the differences
    between the gyros, less their slow part, at these variances: it knows no motion, and the true variances have the
    best on average, whatever was used to find the slow part (Patton 2011, J. Econometrics 160, 246-256). The forecast
    of EWMA for a block is the mean of the squares of the blocks before, with the time constant that is best for the
    gyro at these blocks. Standard error of the mean difference: Newey & West (1987), lag ∛M.
    variances : of the same array; their correlation is used
    """
    deviations = array.deviations.get((model, mode, definition))
    if deviations is None:
        return _nothing(f"there are no {mode} deviations of {model.upper()} for {definition}")
    blocks = _block_means(array, deviations, parameters.block_hz)
    if blocks is None:
        return _nothing(f"fewer than {FEWEST_BLOCKS} blocks")
    means, forecast = blocks
    moments = block_moments(means, 1)
    correlation = variances.correlation
    constant, outlier = constant_variances(moments, correlation)
    block_s = 1.0 / means.rate_hz
    found = changing_variances(moments, constant, outlier, correlation, block_s, parameters.engine)
    low_pass = engines.get(parameters.engine).kalman.low_pass
    columns = zip(found.square.T, found.freedom.T, strict=True)
    ewma = np.column_stack([_causal(*one, block_s, low_pass) for one in columns])
    used = found.freedom > 0
    residual = residual_means(moments, found.variance, used, correlation)
    missing = ~used & ~moments.excluded
    good = _positive(ewma) & _positive(forecast) & ~missing | moments.excluded
    rows = good.all(axis=1) & ((~moments.excluded).sum(axis=1) > 1)
    if rows.sum() < FEWEST_BLOCKS:
        return _nothing(f"fewer than {FEWEST_BLOCKS} blocks have a forecast of both")
    excluded = moments.excluded[rows]
    of_dcc, of_ewma = (
        parity_deviance(residual[rows], np.where(excluded, 1.0, one[rows]), excluded, correlation)
        for one in (forecast, ewma)
    )
    return _compared(of_dcc, of_ewma)


def _positive(variance: np.ndarray) -> np.ndarray:
    return np.isfinite(variance) & (variance > 0)


def _block_means(
    array: ArrayRates, deviations: SampleWeights, block_hz: float
) -> tuple[ArrayRates, np.ndarray] | None:  # fmt: skip
    """The block means as an array of their own, and the variances [M, N] that DCC gives each, (deg/s)²."""
    block = deviations.block
    edge = np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1])
    number = block[edge]
    inside = np.flatnonzero(number >= 0)[:MOST_BLOCKS]
    if len(inside) < FEWEST_BLOCKS:
        return None
    size = np.diff(np.append(edge, len(block)))[inside]
    sums = np.column_stack([np.add.reduceat(column, edge, dtype=float)[inside] for column in array.rate.T])
    edge, number = edge[inside], number[inside]
    broken = (np.diff(number) != 1) | (np.diff(array.segment[edge]) != 0)
    segment = np.concatenate([[0], np.cumsum(broken)])
    faults = tuple(_in_blocks(one, edge) for one in array.faults)
    means = ArrayRates(
        np.asfortranarray(sums / size[:, None]), block_hz, segment, array.at_rest[edge], array.noise, faults=faults
    )  # fmt: skip
    (rows,) = deviations.rows([slice(int(number[0]), int(number[-1]) + 1)])
    return means, rows[number - number[0]].astype(float) ** 2


def _in_blocks(fault: FaultEvent, edge: np.ndarray) -> FaultEvent:
    first = max(int(np.searchsorted(edge, fault.start, side="right")) - 1, 0)
    return replace(fault, start=first, stop=int(np.searchsorted(edge, fault.stop, side="left")))


def _causal(square: np.ndarray, freedom: np.ndarray, block_s: float, low_pass: LowPass) -> np.ndarray:
    """Mean [M] of the earlier squares [M], with the time constant that forecasts best."""
    times = [one for one in TIME_CONSTANTS_S if one >= block_s]
    tried = [_mean_before(square, freedom, math.exp(-block_s / one), low_pass) for one in (*times, math.inf)]
    used = freedom > 0
    return min(tried, key=lambda one: float(np.nansum(_loss(square, one)[used])))


def _mean_before(square: np.ndarray, freedom: np.ndarray, keep: float, low_pass: LowPass) -> np.ndarray:
    total, mass = (low_pass(np.append(0.0, one[:-1]), keep, 1.0, 0.0) for one in (freedom * square, freedom))
    known = (np.cumsum(freedom > 0) > BURN_IN) & (mass > 0) & (total > 0)
    return np.where(known, total, np.nan) / np.where(known, mass, 1.0)


def _loss(square: np.ndarray, forecast: np.ndarray) -> np.ndarray:
    good = _positive(forecast)
    h = np.where(good, forecast, 1.0)
    return np.where(good, square / h + np.log(h), np.nan)


def _compared(of_dcc: np.ndarray, of_ewma: np.ndarray) -> Score:
    better = of_ewma - of_dcc
    error = _standard_error(better)
    t = float(better.mean() / error) if error > 0 else 0.0
    text = (
        f"mean deviance {of_dcc.mean():.4f} of DCC, {of_ewma.mean():.4f} of EWMA, t = {t:.1f} over {len(better)} blocks"
    )
    return Score(t > SIGNIFICANT, t, float(of_dcc.mean()), float(of_ewma.mean()), len(better), text)


def _standard_error(series: np.ndarray) -> float:
    """Of the mean of a correlated series [M]: Newey & West (1987), Econometrica 55, 703-708, lag ∛M."""
    off = series - series.mean()
    lags = int(len(series) ** (1 / 3))
    total = float(off @ off)
    for lag in range(1, lags + 1):
        total += 2.0 * (1.0 - lag / (lags + 1)) * float(off[lag:] @ off[:-lag])
    return math.sqrt(max(total, 0.0)) / len(series)


def _nothing(note: str) -> Score:
    return Score(False, math.nan, math.nan, math.nan, 0, note)

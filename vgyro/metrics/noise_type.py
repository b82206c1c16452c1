"""Which power law governs a series at each averaging time: needed for the degrees of freedom of an Allan variance."""

from __future__ import annotations

import numpy as np

ENOUGH_FOR_AUTOCORRELATION = 30
ENOUGH_FOR_RATIO = 3
MOST_DIFFERENCES = 2
STEPS = (0, -1, -2)


def noise_exponents(pieces: list[np.ndarray], factors: np.ndarray) -> np.ndarray:
    """Exponent of the power spectrum at each averaging factor: 2 … -2, never rising with τ.

    pieces  : gap-free stretches, arrays [T_s]
    factors : array [M] int, ascending averaging factors
    returns : array [M] int
    With 30 block means or more: lag-1 autocorrelation (Riley & Greenhall, "Power law noise identification using the
    lag 1 autocorrelation", EFTF 2004). With fewer: the ratio of the sample variance to the Allan variance (B1, Barnes
    1969), white, flicker or random walk. With fewer than 3: the exponent of the τ before. In a sum of power laws the
    steeper one governs the longer τ, so the sequence is made monotone (isotonic regression, weight: block means):
    one chance result among many τ would else multiply its degrees of freedom by ten.
    """
    raw, weight = np.zeros(len(factors)), np.ones(len(factors))
    for index, factor in enumerate(factors):
        blocks = [block_means(piece, int(factor)) for piece in pieces if piece.size >= factor]
        long = [block for block in blocks if block.size >= ENOUGH_FOR_AUTOCORRELATION]
        short = [block for block in blocks if block.size >= ENOUGH_FOR_RATIO]
        weight[index] = max(sum(block.size for block in long or short), 1)
        if long:
            raw[index] = exponent_by_autocorrelation(long)
        elif short:
            raw[index] = exponent_by_ratio(short)
        elif index:
            raw[index] = raw[index - 1]
    return np.round(_falling(raw, weight)).astype(np.int64)


def _falling(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted least-squares fit of a sequence that never rises: pool adjacent violators."""
    pools: list[tuple[float, float, int]] = []
    for value, weight in zip(values, weights, strict=True):
        pool = (float(value), float(weight), 1)
        while pools and pools[-1][0] < pool[0]:
            mean, mass, count = pools.pop()
            total = mass + pool[1]
            pool = ((mean * mass + pool[0] * pool[1]) / total, total, count + pool[2])
        pools.append(pool)
    return np.concatenate([np.full(count, mean) for mean, _, count in pools])


def block_means(series: np.ndarray, length: int) -> np.ndarray:
    """Means of adjacent blocks of `length` samples; an incomplete last block is left out."""
    whole = series.size // length * length
    return series[:whole].reshape(-1, length).mean(axis=1)


def exponent_by_autocorrelation(blocks: list[np.ndarray]) -> float:
    """Exponent by the lag-1 autocorrelation of block means, differenced until it is small; between -4 and 2."""
    series = [_without_line(block) for block in blocks]
    for differences in range(MOST_DIFFERENCES + 1):
        series = [_centred(block) for block in series]
        squares = sum(float(block @ block) for block in series)
        if squares == 0:
            return 0.0
        lag_one = sum(float(block[1:] @ block[:-1]) for block in series) / squares
        rho = lag_one / (1 + lag_one) if lag_one > -1 else -1.0
        if rho < 0.25 or differences == MOST_DIFFERENCES:
            break
        series = [np.diff(block) for block in series]
    return float(np.clip(-2 * (rho + differences), -4, 2))


def _without_line(values: np.ndarray) -> np.ndarray:
    position = np.arange(values.size) - (values.size - 1) / 2
    centred = _centred(values)
    return centred - position * float(position @ centred) / float(position @ position)


def _centred(values: np.ndarray) -> np.ndarray:
    return values - values.mean()


def exponent_by_ratio(blocks: list[np.ndarray]) -> int:
    """0, -1 or -2 by the ratio of the sample variance to the Allan variance of block means."""
    squares = sum(float(np.sum(_centred(block) ** 2)) for block in blocks)
    steps = sum(float(np.sum(np.diff(block) ** 2)) for block in blocks)
    samples = sum(block.size for block in blocks)
    allan = steps / (2 * (samples - len(blocks)))
    if allan == 0:
        return 0
    measured = squares / (samples - len(blocks)) / allan
    mean_length = samples / len(blocks)
    expected = [_expected_ratio(mean_length, exponent) for exponent in STEPS]
    for exponent, here, beyond in zip(STEPS, expected, expected[1:], strict=False):
        if measured < np.sqrt(here * beyond):
            return exponent
    return STEPS[-1]


def _expected_ratio(count: float, exponent: int) -> float:
    """B1: expected sample variance of `count` adjacent means over the Allan variance."""
    if exponent == 0:
        return 1.0
    if exponent == -1:
        return count * np.log(count) / (2 * (count - 1) * np.log(2))
    return count / 2

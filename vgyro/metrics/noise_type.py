"""Which power law governs a series at each averaging time: needed for the degrees of freedom of an Allan variance."""

from __future__ import annotations

from types import ModuleType

import numpy as np

ENOUGH_FOR_AUTOCORRELATION = 30
ENOUGH_FOR_RATIO = 3
MOST_DIFFERENCES = 2
LARGEST_RHO = 0.25
STEPS = (0, -1, -2)


def noise_exponents(pieces: list[np.ndarray], factors: np.ndarray, allan: ModuleType) -> np.ndarray:
    """Exponent of the power spectrum at each averaging factor: 2 … -2, never rising with τ.

    pieces  : gap-free stretches, arrays [T_s]
    factors : array [M] int, ascending averaging factors;  allan : that module of an engine
    returns : array [M] int
    With 30 block means or more: lag-1 autocorrelation (Riley & Greenhall, "Power law noise identification using the
    lag 1 autocorrelation", EFTF 2004). With fewer: the ratio of the sample variance to the Allan variance (B1, Barnes
    1969), white, flicker or random walk. With fewer than 3: the exponent of the τ before. In a sum of power laws the
    steeper one governs the longer τ, so the sequence is made monotone (isotonic regression, weight: block means):
    one chance result among many τ would else multiply its degrees of freedom by ten.
    """
    raw, weight = np.zeros(len(factors)), np.zeros(len(factors))
    squares, products = np.zeros((len(factors), MOST_DIFFERENCES + 1)), np.zeros((len(factors), MOST_DIFFERENCES + 1))
    for piece in pieces:
        long = piece.size // factors >= ENOUGH_FOR_AUTOCORRELATION
        if long.any():
            of_piece = allan.lag_products(piece, factors[long])
            squares[long] += of_piece[0]
            products[long] += of_piece[1]
            weight[long] += piece.size // factors[long]
    for index, factor in enumerate(factors.tolist()):
        if weight[index]:
            raw[index] = exponent_by_autocorrelation(squares[index], products[index])
            continue
        short = [block_means(piece, factor) for piece in pieces if piece.size >= ENOUGH_FOR_RATIO * factor]
        weight[index] = max(sum(block.size for block in short), 1)
        if short:
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
    return series[:whole].reshape(-1, length).mean(axis=1, dtype=float)


def exponent_by_autocorrelation(squares: np.ndarray, products: np.ndarray) -> float:
    """Exponent by the lag-1 autocorrelation of block means, differenced until it is small; between -4 and 2.

    squares, products : arrays [3] by number of differences, as lag_products of the engines gives them
    """
    for differences in range(MOST_DIFFERENCES + 1):
        if squares[differences] == 0:
            return 0.0
        lag_one = float(products[differences] / squares[differences])
        rho = lag_one / (1 + lag_one) if lag_one > -1 else -1.0
        if rho < LARGEST_RHO:
            break
    return float(np.clip(-2 * (rho + differences), -4, 2))


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

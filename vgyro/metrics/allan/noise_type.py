"""Which power law governs a series at each averaging time: needed for the degrees of freedom of an Allan variance."""

from __future__ import annotations

import numpy as np

from vgyro.engine.protocols.noise import AllanEngine
from vgyro.metrics.allan.slots import SlotSums

ENOUGH_FOR_AUTOCORRELATION = 30
ENOUGH_FOR_RATIO = 3
MOST_DIFFERENCES = 2
LARGEST_RHO = 0.25
STEPS = (0, -1, -2)


def noise_exponents(
    rate: np.ndarray, edges: np.ndarray, factors: np.ndarray, allan: AllanEngine, sums: SlotSums | None = None
) -> np.ndarray:
    """Exponent of the power spectrum at each averaging factor: 2 … -4, never rising with τ.

    rate    : array [T];  edges : array [S + 1] int, first sample of each gap-free stretch, and T
    factors : array [M] int, ascending averaging factors;  allan : that module of an engine
    sums    : of rate, where samples are lost within the stretches: then edges are not needed, and a block of m slots
              counts where half of its samples are there
    returns : array [M] int
    With 30 block means or more: lag-1 autocorrelation (Riley & Greenhall, "Power law noise identification using the
    lag 1 autocorrelation", EFTF 2004). With fewer: the ratio of the sample variance to the Allan variance (B1, Barnes
    1969), white, flicker or random walk. With fewer than 3: the exponent of the τ before. In a sum of power laws the
    steeper one governs the longer τ, so the sequence is made monotone (isotonic regression, weight: block means):
    one chance result among many τ would else multiply its degrees of freedom by ten.
    """
    if sums is None:
        raw, weight = _of_whole(rate, edges, factors, allan)
    else:
        raw, weight = _over_losses(sums, factors, allan)
    return np.round(_falling(raw, weight)).astype(np.int64)


def _of_whole(
    rate: np.ndarray, edges: np.ndarray, factors: np.ndarray, allan: AllanEngine
) -> tuple[np.ndarray, np.ndarray]:
    """Exponent and weight at each factor, of gap-free stretches."""
    lengths = np.diff(edges)
    raw, weight = np.zeros(len(factors)), np.ones(len(factors))
    long = factors * ENOUGH_FOR_AUTOCORRELATION <= lengths.max()
    squares, products = allan.lag_products(rate, factors[long], edges, ENOUGH_FOR_AUTOCORRELATION)
    for index, factor in enumerate(factors.tolist()):
        means = lengths // factor
        if long[index]:
            raw[index] = exponent_by_autocorrelation(squares[index], products[index])
            weight[index] = means[means >= ENOUGH_FOR_AUTOCORRELATION].sum()
        elif means.max() >= ENOUGH_FOR_RATIO:
            used = means >= ENOUGH_FOR_RATIO
            raw[index] = exponent_by_ratio(block_means(rate, edges[:-1][used], means[used], factor), means[used])
            weight[index] = means[used].sum()
        elif index:
            raw[index] = raw[index - 1]
    return raw, weight


def _over_losses(sums: SlotSums, factors: np.ndarray, allan: AllanEngine) -> tuple[np.ndarray, np.ndarray]:
    """Exponent and weight at each factor, of runs of block means that have half of their samples."""
    raw, weight = np.zeros(len(factors)), np.ones(len(factors))
    for index, factor in enumerate(factors.tolist()):
        means, edges = sums.block_means(factor)
        lengths = np.diff(edges)
        longest = lengths.max(initial=0)
        if longest >= ENOUGH_FOR_AUTOCORRELATION:
            squares, products = allan.lag_products(means, np.ones(1, np.int64), edges, ENOUGH_FOR_AUTOCORRELATION)
            raw[index] = exponent_by_autocorrelation(squares[0], products[0])
            weight[index] = lengths[lengths >= ENOUGH_FOR_AUTOCORRELATION].sum()
        elif longest >= ENOUGH_FOR_RATIO:
            used = lengths >= ENOUGH_FOR_RATIO
            raw[index] = exponent_by_ratio(means[np.repeat(used, lengths)], lengths[used])
            weight[index] = lengths[used].sum()
        elif index:
            raw[index] = raw[index - 1]
    return raw, weight


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


def block_means(rate: np.ndarray, start: np.ndarray, number: np.ndarray, length: int) -> np.ndarray:
    """Means of adjacent blocks of `length` samples, number [S] of them from each start [S] on, one after another."""
    within = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
    first = np.repeat(start, number) + within * length
    # Sums from the begin of each block to its end, and from there to the next, which are not wanted.
    borders = np.stack([first, first + length], axis=1).ravel()
    inside = borders if borders[-1] < len(rate) else borders[:-1]
    return np.add.reduceat(rate, inside)[::2] / length


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


def exponent_by_ratio(means: np.ndarray, number: np.ndarray) -> int:
    """0, -1 or -2 by the ratio of the sample variance to the Allan variance of block means.

    means : array [Σ number], those of each stretch one after another;  number [S] : of each stretch
    """
    first = np.cumsum(number) - number
    centred = means - np.repeat(np.add.reduceat(means, first) / number, number)
    squares = float(np.sum(centred**2))
    within = np.ones(len(means) - 1, dtype=bool)
    within[first[1:] - 1] = False
    steps = float(np.sum(np.diff(means)[within] ** 2))
    samples, stretches = len(means), len(number)
    allan = steps / (2 * (samples - stretches))
    if allan == 0:
        return 0
    measured = squares / (samples - stretches) / allan
    expected = [_expected_ratio(samples / stretches, exponent) for exponent in STEPS]
    for exponent, here, beyond in zip(STEPS, expected, expected[1:], strict=False):
        if measured < np.sqrt(here * beyond):
            return exponent
    return STEPS[-1]


def _expected_ratio(count: float, exponent: int) -> float:
    """B1: expected sample variance of `count` adjacent means over the Allan variance."""
    if exponent == 0:
        return 1.0
    if exponent == -1:
        expected: float = count * np.log(count) / (2 * (count - 1) * np.log(2))
        return expected
    return count / 2

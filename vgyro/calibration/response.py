"""What a gyro answers to a table: one linear model from which every figure of the test is a combination.

    count = bias + slope · rate + bend(rate) + direction · loop(rate) / 2 + drift · time + error

bend : smooth (|r|, r³, r², r⁵, r⁴, as many as the rates allow) or, where repeated visits show that this is not enough,
       one number for every rate
loop : output reached from below minus from above: 1, r², r
The straight line is the least-squares line through bias + slope · rate + bend(rate) at the plateaus as they were
visited: what bends counts in it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro.arrays import Bools, Floats
from vgyro.calibration.wandering import Errors, LinearFit

SAME_RATE = 1e-4  # of the largest rate
RATES_PER_BEND = 3
MOST_BENDS = 5
FEWEST_FOR_LOOP = 3
FEWEST_FOR_LOOP_SHAPE = 8
FEWEST_FOR_DRIFT = 8
FEWEST_OF_A_HALF = 3
FEWEST_REPEATS = 4
NOT_SMOOTH = 0.01  # p value at which repeated visits refuse the smooth bend
APART = 0.05  # share of a column that the others must leave for it to be told from them


@dataclass(frozen=True)
class Visits:
    """Plateaus of one gyro in order of time, [P] each: rate deg/s, count, length s, middle s, direction 1, -1 or 0."""

    rate: np.ndarray
    count: np.ndarray
    seconds: np.ndarray
    time: np.ndarray
    direction: np.ndarray

    @property
    def largest(self) -> float:
        """Largest |rate|, deg/s."""
        return float(np.abs(self.rate).max())


@dataclass(frozen=True)
class ResponseModel:
    """Columns of the model: constant, rate, bend [J, q] by the number of the rate, then loop and drift [P, ...].

    rates [J] : the different ones, deg/s;  group [P] : number of each plateau's
    pairs [H] : numbers of the rates that were reached from both sides
    """

    visits: Visits
    rates: np.ndarray
    group: np.ndarray
    pairs: np.ndarray
    bend: np.ndarray
    loop: np.ndarray
    drift: np.ndarray

    @property
    def design(self) -> np.ndarray:
        """[P, p]"""
        return np.hstack([straight(self.visits.rate), self.bend[self.group], self.loop, self.drift])

    def fit(self, errors: Errors) -> LinearFit:
        """Of the counts."""
        return errors.fit(self.design, self.visits.count)


@dataclass(frozen=True)
class RateResponse:
    """The model fitted to P plateaus at J different rates, H of them reached from both sides; p coefficients.

    bias, slope [p] : combinations of the coefficients that are the straight line, counts, counts/(deg/s)
    transfer, bend [J, p] : output, and output minus the line, at each rate, without loop and drift; counts
    loop [H, p]     : up minus down at each rate reached both ways, counts
    seen_bend [J, P], seen_loop [H, P] : the same as read straight from the mean counts, noise included
    smooth          : False where every rate has a number of its own
    """

    model: ResponseModel
    fit: LinearFit
    bias: np.ndarray
    slope: np.ndarray
    transfer: np.ndarray
    bend: np.ndarray
    loop: np.ndarray
    seen_bend: np.ndarray
    seen_loop: np.ndarray
    smooth: bool

    @property
    def bends(self) -> int:
        """Coefficients of the bend; 0 with too few rates."""
        bends: int = self.model.bend.shape[1]
        return bends

    @property
    def drifts(self) -> bool:
        """Was a drift in time taken off?"""
        drifts: bool = self.model.drift.shape[1] > 0
        return drifts

    def half_slope(self, side: int) -> Floats | None:
        """Combination [p]: slope of the least-squares line through the plateaus from rate 0 up (1) or down (-1)."""
        visits, group = self.model.visits, self.model.group
        chosen = side * visits.rate >= -SAME_RATE * visits.largest
        if np.unique(group[chosen]).size < FEWEST_OF_A_HALF or not self.bends:
            return None
        rate = visits.rate[chosen] - visits.rate[chosen].mean()
        slope: Floats = rate @ self.transfer[group[chosen]] / (rate @ rate)
        return slope


def same_rates(rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Different rates [J] and the number of each plateau's [P]; rates closer than 1e-4 of the largest are one."""
    if not rate.size:
        return rate, np.empty(0, dtype=int)
    order = np.argsort(rate, kind="stable")
    step = np.diff(rate[order], prepend=rate[order[:1]]) > SAME_RATE * np.abs(rate).max()
    group = np.empty(len(rate), dtype=int)
    group[order] = np.cumsum(step)
    return np.bincount(group, weights=rate) / np.bincount(group), group


def fit_response(visits: Visits) -> RateResponse:
    """Fit the model to the plateaus of one gyro at 3 different rates or more.

    The white variance of a plateau goes with 1 / seconds; its slow noise is allowed for by `Errors`. A drift is fitted
    where there are 8 plateaus and the order of the rates allows to tell it from the rest; a loop,
    where 3 rates were reached from both sides.
    """
    rates, group = same_rates(visits.rate)
    sides = [set(visits.direction[group == number].tolist()) for number in range(len(rates))]
    pairs = np.flatnonzero([{1, -1} <= side for side in sides])
    loops = 0 if len(pairs) < FEWEST_FOR_LOOP else 1 if len(pairs) < FEWEST_FOR_LOOP_SHAPE else 3
    loop = visits.direction[:, None] / 2 * _loop_shape(visits.rate / visits.largest, loops)
    bend = _smooth_bend(rates)
    drift = _drift(visits, np.hstack([straight(visits.rate), bend[group], loop]))
    smooth = ResponseModel(visits, rates, group, pairs, bend, loop, drift)
    errors = Errors(len(visits.rate), 1 / visits.seconds, visits.time, visits.seconds)
    fit = smooth.fit(errors)
    free = ResponseModel(visits, rates, group, pairs, _free_bend(rates), loop, drift)
    if _refused(smooth, free, fit):
        return _response(free, free.fit(errors), smooth=False)
    return _response(smooth, fit, smooth=True)


def straight(rate: np.ndarray) -> np.ndarray:
    """Columns [P, 2] of a straight line."""
    return np.column_stack([np.ones_like(rate), rate])


def _response(model: ResponseModel, fit: LinearFit, smooth: bool) -> RateResponse:
    visits, rates, group, pairs = model.visits, model.rates, model.group, model.pairs
    loops, drifts = model.loop.shape[1], model.drift.shape[1]
    transfer = np.hstack([straight(rates), model.bend, np.zeros((len(rates), loops + drifts))])
    line = np.linalg.pinv(straight(visits.rate)) @ transfer[group]
    loop = np.zeros((len(pairs) if loops else 0, transfer.shape[1]))
    before = 2 + model.bend.shape[1]
    loop[:, before : before + loops] = _loop_shape(rates[pairs] / visits.largest, loops)[: len(loop)]
    at_rate = np.equal.outer(np.arange(len(rates)), group)
    up, down = (_averaging(at_rate[pairs] & (visits.direction == side)) for side in (1, -1))
    # As seen: what least squares finds for the other columns is taken off the counts.
    design, found = model.design, np.linalg.pinv(model.design)
    is_loop = np.arange(design.shape[1]) >= before
    is_loop[before + loops :] = False
    is_other = np.arange(design.shape[1]) >= before
    seen_bend = _averaging(at_rate) @ _left_by(straight(visits.rate)) @ _taken_off(design, found, is_other)
    seen_loop = (up - down) @ _taken_off(design, found, ~is_loop)
    return RateResponse(
        model, fit, line[0], line[1], transfer, transfer - straight(rates) @ line, loop, seen_bend, seen_loop, smooth
    )


def _refused(smooth: ResponseModel, free: ResponseModel, fit: LinearFit) -> bool:
    """Do repeated visits show that the response bends more than the smooth curve can? F test at 1 %."""
    from scipy.special import fdtrc

    repeats = len(free.design) - int(np.linalg.matrix_rank(free.design))
    more = free.design.shape[1] - smooth.design.shape[1]
    if repeats < FEWEST_REPEATS or more < 1:
        return False
    lower = np.linalg.cholesky(fit.noise)
    count = np.linalg.solve(lower, smooth.visits.count)
    without, within = (
        float(np.sum((_left_by(np.linalg.solve(lower, model.design)) @ count) ** 2)) for model in (smooth, free)
    )
    return float(fdtrc(more, repeats, (without - within) / more / (within / repeats))) < NOT_SMOOTH


def _drift(visits: Visits, others: np.ndarray) -> np.ndarray:
    """Column [P, 1] that rises in time, or none [P, 0] where it cannot be told from the others."""
    none = np.empty((len(visits.rate), 0))
    span = float(np.ptp(visits.time))
    if len(visits.rate) < FEWEST_FOR_DRIFT or span <= 0:
        return none
    drift = ((visits.time - visits.time.mean()) / span)[:, None]
    left = np.linalg.norm(_left_by(others) @ drift)
    return drift if left > APART * np.linalg.norm(drift) else none


def _smooth_bend(rates: Floats) -> Floats:
    """[J, q], without the straight line in it."""
    size = rates / np.abs(rates).max()
    terms = max(min(MOST_BENDS, (len(rates) - 2) // RATES_PER_BEND), 0)
    shapes = np.column_stack([np.abs(size), size**3, size**2, size**5, size**4])[:, :terms]
    bend: Floats = _left_by(straight(rates)) @ shapes
    return bend


def _free_bend(rates: np.ndarray) -> np.ndarray:
    """[J, J - 2]: all that is no straight line."""
    full, _ = np.linalg.qr(straight(rates), mode="complete")
    return full[:, 2:]


def _loop_shape(size: np.ndarray, terms: int) -> np.ndarray:
    return np.column_stack([np.ones_like(size), size**2, size])[:, :terms]


def _left_by(design: Floats) -> Floats:
    """What least squares on the design [P, p] leaves: [P, P]."""
    return np.eye(len(design)) - design @ np.linalg.pinv(design)


def _taken_off(design: Floats, found: Floats, columns: Bools) -> Floats:
    """The values less some columns [p] bool of the design [P, p] times what `found` [p, P] gives for them: [P, P]."""
    return np.eye(len(design)) - design[:, columns] @ found[columns]


def _averaging(chosen: Bools) -> Floats:
    """[J, P] bool → weights that average what each row has chosen."""
    weights: Floats = chosen / chosen.sum(axis=1, keepdims=True)
    return weights

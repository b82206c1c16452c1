"""What both engines filter and smooth: a scalar rate, a state space, and two filters that adapt themselves."""

from __future__ import annotations

from typing import Protocol

from vgyro.arrays import Floats, Ints
from vgyro.engine.linear import StateSpace


class KalmanEngine(Protocol):
    """Filters and smoother of a scalar rate that N gyros measure."""

    def kalman_filter(
        self, rate: Floats, transition: float, process: float | Floats, noise: Floats, start: float, variance: float
    ) -> tuple[Floats, Floats]:
        """The discrete Kalman filter of a scalar rate that N gyros measure: predict, then update, each sample.

        rate       : array [T, N], deg/s
        transition : F, from one sample to the next
        process    : variance of the step to each sample, (deg/s)²: one number, or an array [T]
        noise      : covariance of a sample, (deg/s)²: array [N, N], or one for each sample [T, N, N]
        start, variance : mean and variance before the first sample
        returns    : estimate [T], deg/s, and its variance [T], (deg/s)², after each update
        raises     : EngineError that names the first sample that is not finite or whose R is not positive definite
        Kalman (1960), J. Basic Eng. 82, 35-45.
        """

    def rts_smoother(
        self, estimate: Floats, variance: Floats, transition: float, process: float | Floats
    ) -> tuple[Floats, Floats]:
        """The Rauch-Tung-Striebel smoother of what kalman_filter returned.

        estimate, variance : arrays [T], deg/s and (deg/s)², after each update
        transition, process : those of the filter
        returns : smoothed estimate [T], deg/s, and its variance [T], (deg/s)²
        raises  : EngineError that names the first sample that is not finite
        Rauch, Tung & Striebel (1965), AIAA J. 3(8), 1445-1450.
        """

    def constant_gain_filter(self, rate: Floats, transition: float, gain: Floats, start: float) -> Floats:
        """x ← F·x, then x ← x + K(z - 1·x), with a fixed gain.

        rate    : array [T, N], deg/s;  transition : F;  gain : K [N];  start : x before the first sample, deg/s
        returns : x after each sample [T], deg/s
        raises  : EngineError that names the first sample that is not finite
        """

    def low_pass(self, signal: Floats, keep: float, gain: float, start: float) -> Floats:
        """First-order recursion y_k = keep·y_{k-1} + gain·signal_k, y_{-1} = start: [T] → [T].

        raises : EngineError that names the first sample that is not finite
        """

    def settling_filter(self, signal: Floats, keep: float, fading: float, start: float) -> Floats:
        """Random-walk filter with the analytic covariance of the time since its start: [T] → [T].

        y_k = φ_k·y_{k-1} + (1 - φ_k)·signal_k, φ_k = keep·(1 - f_k)/(1 - f_{k+1}), f_k = fading·keep^(2k),
        y_{-1} = start.
        keep : e^(-aT);  fading : c = (P0 - P∞)/(P0 + P∞)
        raises : EngineError that names the first sample that is not finite
        Xue et al. (2012), Measurement 45, 745-754; see vgyro.fusion.papers.rate_filters.xue_2012.
        """


class StateSpaceEngine(Protocol):
    """Likelihood and smoother of a linear Gaussian state space that one series measures (vgyro.engine.linear)."""

    def log_likelihood(
        self, z: Floats, r: float | Floats, model: StateSpace, skip: int = 0, regime: Ints | None = None
    ) -> tuple[float, int]:
        """Gaussian log-likelihood of a stretch by its innovations, and how many of them it is of.

        z      : array [T], deg/s;  r : variance of its noise, (deg/s)², one or [T]; infinite: z says nothing there
        skip   : first innovations that are not counted: with a wide start it is the likelihood given those samples
        regime : array [T]: which transition and process lead to each sample; None: the first
        returns : -½Σ(log 2π + log f + v²/f), and the number of terms
        raises : EngineError that names the first sample that cannot be used
        Schweppe (1965), IEEE Trans. Inf. Theory 11, 61-70.
        """

    def smooth(
        self, z: Floats, r: float | Floats, model: StateSpace, regime: Ints | None = None
    ) -> tuple[Floats, Floats]:
        """Mean [T] and variance [T] of c'x_t given all samples of the stretch.

        z, r, regime : as in log_likelihood
        raises       : EngineError that names the first sample that cannot be used
        """


class AdaptiveEngine(Protocol):
    """Filters that adapt themselves to the array: recursions over the samples of one gap-free stretch."""

    def scale_bias_filter(
        self,
        rate: Floats,
        period: float,
        noise: Floats,
        drive: Floats,
        walk: Floats,
        state: Floats,
        covariance: Floats,
    ) -> tuple[Floats, Floats, Floats]:
        """Extended Kalman filter of x = [w, ẇ, b_1..b_N, s_1..s_N] with y_i = (1 + s_i)·w + b_i + n_i, Σb = Σs = 0.

        rate       : array [T, N], deg/s, N >= 2;  period : of the samples, s
        noise      : covariance of a sample [N, N], (deg/s)²
        drive      : process noise of (w, ẇ) a sample [2, 2]; w follows from ẇ by w + period·ẇ
        walk       : variance of a sample's step of each bias [N], (deg/s)²; s is constant
        state, covariance : [2+2N], [2+2N, 2+2N], before the first sample. What they and `walk` hold along Σb and Σs is
                     dropped: these sums are zero, and known to be, for ever
        returns    : w after each sample [T], deg/s; state and covariance after the last
        raises     : EngineError that names the first sample that is not finite, or if `noise` is not positive definite
        Predict, then update. The row of H for y_i is [1 + s_i, 0, e_i, w·e_i] at the predicted state.
        """

    def filter_bank(
        self,
        rate: Floats,
        noise: Floats,
        process: Floats,
        start: float,
        variance: float,
        probability: Floats,
        least: float,
    ) -> tuple[Floats, Floats, Floats]:
        """Multiple-model estimate of a rate that is a random walk: a Kalman filter for each noise and process noise.

        rate     : array [T, N], deg/s, N >= 2
        noise    : covariances of a sample [J, N, N], (deg/s)²;  process : variances of the step to each sample [K]
        start, variance : mean and variance of every member before the first sample
        probability : [J, K], of the members, before the first sample;  least : below it none falls
        returns  : Σ p·x after each sample [T], deg/s; p after the last [J, K]; mean of p over the samples [J, K]
        raises   : EngineError that names the first sample that is not finite, or if a `noise` is not positive definite
        Each member predicts and updates with its own variance P(t). Then p ∝ p·|S|^-½·exp(-½e'S⁻¹e), e = y - 1·x,
        S = R + 1·P·1', is made to add up to 1, raised to `least` where it is below, and made to add up to 1 again.
        """

"""What both engines compute of volatility: GARCH, DCC, and the weights of least variance."""

from __future__ import annotations

from typing import Protocol

from vgyro.arrays import Floats, Ints
from vgyro.engine.models import ConditionalWeights, DccFit, DccWindows, GarchFit, GarchWindows


class GarchEngine(Protocol):
    """GARCH(1,1) by Gaussian quasi maximum likelihood, with the conventions of vgyro.volatility.fit_garch."""

    def fit_garch(self, r: Floats) -> GarchFit:
        """Fit GARCH(1,1) to each column of r [T, N], deg/s."""

    def fit_garch_windows(self, r: Floats) -> GarchWindows:
        """Fit GARCH(1,1) to each series of r [K, T, N], deg/s; a view of overlapping windows need not be copied.

        raises : MemoryError
        """


class DccEngine(Protocol):
    """DCC(1,1) of standardised residuals, with the conventions of vgyro.volatility.fit_dcc."""

    def fit_dcc(self, z: Floats, r: Floats | None = None, margins: GarchFit | None = None) -> DccFit:
        """Fit DCC(1,1) to z [T, N].

        r, margins : [T, N] deg/s and its GARCH fit, where z is from one: only then are there two-step standard errors
        """

    def fit_dcc_windows(
        self, r: Floats, omega: Floats, alpha: Floats, beta: Floats, status: Ints, lags: int = 1
    ) -> DccWindows:
        """Fit DCC(1,1) to each of K windows, with two-step standard errors and the test of constant correlation.

        r                  : [K, T, N] deg/s
        omega, alpha, beta : [K, N], ω in (deg/s)², all finite: the GARCH margins
        status             : [K, N] uint8, their codes (GARCH_STATUSES)
        lags               : of the test
        raises             : EngineError for more series than the engine takes
        """

    def fit_ccc(self, z: Floats) -> DccFit:
        """Constant conditional correlation (Bollerslev 1990): DCC with a = b = 0. z [T, N]; statuses as in fit_dcc."""


class WeightsEngine(Protocol):
    """Minimum-variance weights. Liu et al. (2015), eq. 1-6 and 15-16; they name an active-set method."""

    def min_variance_weights(self, H: Floats) -> Floats:
        """min w'Hw, Σw = 1, 0 ≤ w ≤ 1, for a stack of matrices.

        H       : array [M, N, N]
        returns : w [M, N]; NaN where H cannot be used (vgyro.engine.covariance.usable)
        raises  : EngineError for more gyros than the engine takes
        """

    def conditional_weights(
        self,
        r: Floats,
        inside: int,
        omega: Floats,
        alpha: Floats,
        beta: Floats,
        a: Floats,
        b: Floats,
        target: Floats,
        begin: int,
        end: int,
    ) -> ConditionalWeights:
        """Minimum-variance weights along the conditional covariance H_t = D_t R_t D_t of K windows.

        r                  : [K, L, N] deg/s; the models were fitted to the first `inside` samples, and start from
                             their mean(e²) and from Q_1 = S. Leading rows with a value that is not finite take the
                             first H
        omega, alpha, beta : [K, N], ω in (deg/s)²
        a, b, target       : [K], [K], [K, N, N] S; a = 0 is a constant correlation
        begin, end         : the samples to weigh, 0 ≤ begin ≤ end ≤ L; H_t uses r up to t - 1
        returns            : ConditionalWeights; equal weights where H_t cannot be used
        raises             : EngineError for more gyros than the engine takes
        """

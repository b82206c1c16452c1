"""DCC(1,1) of an array of gyros, CCC, and the test of constant correlation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vgyro import engine as engines
from vgyro.arrays import Floats
from vgyro.engine import recursions
from vgyro.engine.constant import constant_correlation
from vgyro.engine.models import DccFit, GarchFit
from vgyro.volatility.garch import _two_dimensional

dcc_correlation = recursions.dcc_correlation


def fit_dcc(z: Floats, engine: str = "native", r: Floats | None = None, margins: GarchFit | None = None) -> DccFit:
    """Fit Q_t = (1-a-b)S + a z_{t-1}z'_{t-1} + b Q_{t-1} by maximising the correlation likelihood.

    z       : [T, N] standardised residuals e/√h
    engine  : name of the engine (vgyro.engine)
    r       : [T, N] deg/s, the series before it was standardised, and
    margins : their GarchFit: with both, `stderr` holds the two-step robust standard errors; without, NaN
    returns : DccFit
    raises  : TooShort if there is no sample at all; EngineError if the engine is unknown

    Conventions. S = z'z/T scaled to unit diagonal (the mean is zero), Q_1 = S, 1/T throughout; a >= 0, b >= 0,
    a + b < 1. L_c has no constant: -½Σ(log|R| + z'R⁻¹z - z'z). The result is the greatest L_c of several starts, none
    of which depends on another window. Where it gains less than 1e-6 a sample over a constant correlation, b is not
    identified: a = b = 0, status `boundary: a = 0`. Standard errors are NaN unless the status is `converged`; the
    two-step ones (Engle & Sheppard 2001) hold S fixed; the inverse-Hessian ones take the margins as known and the
    likelihood as right, so that they also exist for `boundary margin`.
    S singular: status `not positive definite`, and the identity stands for S and for every R_t. A series that does not
    vary, or is NaN throughout because its margin found that: `no variance`, likewise, L_c NaN. N = 1: `one gyro`.
    Engle (2002); Liu et al. (2015), eq. 4-13.
    """
    return engines.get(engine).dcc.fit_dcc(_two_dimensional(z), r=r, margins=margins)


def fit_ccc(z: Floats, engine: str = "native") -> DccFit:
    """Constant conditional correlation: DCC with a = b = 0 (Bollerslev 1990). z [T, N]; statuses as in fit_dcc."""
    return engines.get(engine).dcc.fit_ccc(_two_dimensional(z))


@dataclass(frozen=True)
class Test:
    """statistic; dof = lags + 1; p_value under chi²(lags + 1), as published; p_value_s under chi²(lags).

    status : one of vgyro.engine.models.TEST_STATUSES; all figures are NaN unless it is `tested`
    """

    statistic: float
    dof: int
    p_value: float
    p_value_s: float
    status: str


# pytest would take a class of this name, imported into a test module, for a test.
Test.__test__ = False  # type: ignore[attr-defined]


def constant_correlation_test(z: np.ndarray, lags: int = 1) -> Test:
    """Test of constant against changing correlation.

    z       : [T, N] standardised residuals of the CCC fit
    lags    : s, lags of the regression
    returns : Test; NaN and the reason for one gyro, fewer than lags + 3 samples, a series that does not vary or is not
              finite, a singular correlation, or products without a regression: their lags depend on each other, or
              nothing is left over

    z is whitened by the symmetric root of the sample correlation; the products above the diagonal of z_t z_t', all
    pairs stacked, are regressed on a constant and s of their own lags; δ'X'Xδ/σ̂² with σ̂² the mean squared residual is
    chi²(s + 1) in the paper. Whitening by the SAMPLE correlation forces the constant to zero, so at T = 360, s = 1 a
    nominal 5 % test rejects 1.8 % under chi²(s + 1) and 5.5 % under chi²(s): both p-values are returned. Its power
    against (a, b) = (.03, .95) at T = 360 is about 40 %.
    pymgarch.dcc_test gives the same statistic and the first p-value only; it raises for one series.
    Engle & Sheppard (2001), NBER 8554, section 3.3; Liu et al. (2015), eq. 14.
    """
    from scipy.special import chdtrc

    statistic, status = constant_correlation(_two_dimensional(z), lags)
    return Test(statistic, lags + 1, float(chdtrc(lags + 1, statistic)), float(chdtrc(lags, statistic)), status)

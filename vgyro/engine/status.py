"""What a fit ended as: the same rules for every engine, so that their statuses can be compared."""

from __future__ import annotations

import numpy as np

from vgyro.engine.models import (
    A_ZERO,
    ALPHA_ZERO,
    B_ZERO,
    BETA_ZERO,
    BOUNDARY_MARGIN,
    CONVERGED,
    DCC_STATUSES,
    GARCH_STATUSES,
    OMEGA_ZERO,
    OUTLIER_DOMINATED,
    PERSISTENCE_MAX,
    PERSISTENCE_ONE,
    SUM_ONE,
)

MIN_SAMPLES = 20
"""A series with fewer samples is not fitted."""
FLAT = 1e-12
"""A series that varies by less than this share of its size has no variance."""
PIVOT_MIN = 1e-10
"""A test is degenerate where a smaller share of a regressor is its own, or is left over of what is explained."""
ALPHA_NEAR_ZERO = 1e-3
"""α (and a) below this has no usable standard error: β (b) is all but unidentified."""
BETA_NEAR_ZERO = 1e-6
PERSISTENCE_NEAR_ONE = 1 - 2 * (1 - PERSISTENCE_MAX)
OMEGA_MIN = 1e-8
"""Smallest ω that a fit may return, in units of mean(e²)."""
GAIN = 1e-6
"""Log-likelihood a sample by which a model must beat the simpler one (constant variance, constant correlation)."""
OUTLIER_SHARE = 0.2
OUTLIER_RATIO = 100.0
"""A sample that holds more than this share of Σe², and this many times the median of e², dominates the fit."""


def garch_code(status: str) -> int:
    """Place of a status in GARCH_STATUSES."""
    return GARCH_STATUSES.index(status)


def dcc_code(status: str) -> int:
    """Place of a status in DCC_STATUSES."""
    return DCC_STATUSES.index(status)


def outlier_dominated(r: np.ndarray) -> np.ndarray:
    """Does one sample dominate the sum of squares?  r [..., T, N] finite → bool [..., N]"""
    square = np.square(r)
    largest, total = square.max(axis=-2), square.sum(axis=-2)
    found = np.asarray(largest > OUTLIER_SHARE * total)
    if found.any():
        # The median costs more than all the rest, so only where it can decide.
        places = np.nonzero(found)
        columns = np.moveaxis(square, -2, -1)[places]
        found[places] = largest[places] > OUTLIER_RATIO * np.median(columns, axis=-1)
    return found


def garch_status_codes(omega: np.ndarray, alpha: np.ndarray, beta: np.ndarray, outlier: np.ndarray) -> np.ndarray:
    """uint8 codes of fits that ended at an optimum (ω, α, β), all of one shape; ω in units of mean(e²)."""
    codes = np.full(np.shape(alpha), garch_code(CONVERGED), dtype=np.uint8)
    codes[omega < 2 * OMEGA_MIN] = garch_code(OMEGA_ZERO)
    codes[beta < BETA_NEAR_ZERO] = garch_code(BETA_ZERO)
    codes[alpha + beta >= PERSISTENCE_NEAR_ONE] = garch_code(PERSISTENCE_ONE)
    codes[alpha < ALPHA_NEAR_ZERO] = garch_code(ALPHA_ZERO)
    codes[outlier] = garch_code(OUTLIER_DOMINATED)
    return codes


def dcc_status_codes(a: np.ndarray, b: np.ndarray, margins: np.ndarray) -> np.ndarray:
    """uint8 codes [K] of fits that ended at an optimum (a, b) [K]; margins [K, N] are the codes of the GARCH fits."""
    codes = np.full(np.shape(a), dcc_code(CONVERGED), dtype=np.uint8)
    codes[(margins != garch_code(CONVERGED)).any(axis=-1)] = dcc_code(BOUNDARY_MARGIN)
    codes[b < BETA_NEAR_ZERO] = dcc_code(B_ZERO)
    codes[a + b >= PERSISTENCE_NEAR_ONE] = dcc_code(SUM_ONE)
    codes[a < ALPHA_NEAR_ZERO] = dcc_code(A_ZERO)
    codes[(margins == garch_code(OUTLIER_DOMINATED)).any(axis=-1)] = dcc_code(OUTLIER_DOMINATED)
    return codes

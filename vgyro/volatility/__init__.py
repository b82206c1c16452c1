"""ARCH-LM, GARCH, DCC, the constant-correlation test, and what surrounds them: series, definitions of r_t, windows."""

from vgyro.engine.models import DccFit, GarchFit
from vgyro.volatility.arch_lm import ArchLm, arch_lm, kurtosis
from vgyro.volatility.dcc import Test, constant_correlation_test, dcc_correlation, fit_ccc, fit_dcc
from vgyro.volatility.garch import fit_garch, garch_variance
from vgyro.volatility.rolling import WindowModels, WindowWeights, weights_of_windows
from vgyro.volatility.series import Series, block_means, detrended, window_residuals
from vgyro.volatility.stretches import Window, stretches, windows

__all__ = [
    "ArchLm",
    "DccFit",
    "GarchFit",
    "Series",
    "Test",
    "Window",
    "WindowModels",
    "WindowWeights",
    "arch_lm",
    "block_means",
    "constant_correlation_test",
    "dcc_correlation",
    "detrended",
    "fit_ccc",
    "fit_dcc",
    "fit_garch",
    "garch_variance",
    "kurtosis",
    "stretches",
    "weights_of_windows",
    "window_residuals",
    "windows",
]

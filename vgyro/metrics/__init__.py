"""How good a rate is: Allan deviation, noise coefficients, spectra, dynamic errors, improvement factors, intervals.

Pure functions of arrays in deg/s. docs/metrics.md explains every figure and its convention.
"""

from vgyro.metrics.allan import AllanCurve, allan_deviation, averaging_factors, read_curve
from vgyro.metrics.bootstrap import Resampled, Units, block_length, make_units, resample
from vgyro.metrics.coefficients import Coefficient, NoiseCoefficients, model_deviation, noise_coefficients
from vgyro.metrics.correlation import Correlation, correlation_matrix
from vgyro.metrics.dynamic import DynamicErrors, dynamic_errors
from vgyro.metrics.figures import FIGURES, Figure, Reading
from vgyro.metrics.improvement import improvement_factor, improvement_of_deviation
from vgyro.metrics.readings import moments, paper_readings
from vgyro.metrics.spectrum import Density, Spectrum, flat_band, noise_density, spectral_density, thinned

__all__ = [
    "FIGURES",
    "AllanCurve",
    "Coefficient",
    "Correlation",
    "Density",
    "DynamicErrors",
    "Figure",
    "NoiseCoefficients",
    "Reading",
    "Resampled",
    "Spectrum",
    "Units",
    "allan_deviation",
    "averaging_factors",
    "block_length",
    "correlation_matrix",
    "dynamic_errors",
    "flat_band",
    "improvement_factor",
    "improvement_of_deviation",
    "make_units",
    "model_deviation",
    "moments",
    "noise_coefficients",
    "noise_density",
    "paper_readings",
    "read_curve",
    "resample",
    "spectral_density",
    "thinned",
]

"""How good a rate is: Allan deviation, noise coefficients, spectra, dynamic errors, improvement factors, intervals.

Pure functions of arrays in deg/s. docs/metrics.md explains every figure and its convention.
"""

from vgyro.metrics.allan import AllanCurve, allan_deviation, averaging_factors, read_curve, stretches
from vgyro.metrics.bootstrap import Resampled, Units, block_length, make_units, resample
from vgyro.metrics.coefficients import Coefficient, NoiseCoefficients, model_deviation, noise_coefficients
from vgyro.metrics.correlation import Correlation, correlation_matrix
from vgyro.metrics.cross_allan import CrossAllan, cross_allan
from vgyro.metrics.dynamic import DynamicErrors, dynamic_errors
from vgyro.metrics.dynamic_figures import dynamic_figures
from vgyro.metrics.equal_bandwidth import Equaliser, LowPass, common_bandwidth
from vgyro.metrics.figures import FIGURES, Figure, Reading
from vgyro.metrics.improvement import improvement_by_draws, improvement_factor, improvement_of_deviation
from vgyro.metrics.outliers import find_outliers
from vgyro.metrics.pairs import noise_from_differences
from vgyro.metrics.readings import counted, moments, paper_readings
from vgyro.metrics.sampling import Sampling
from vgyro.metrics.spectrum import Density, Spectrum, flat_band, noise_density, spectral_density, thinned
from vgyro.metrics.static_figures import StaticFigures, array_figures, static_figures
from vgyro.metrics.static_series import Measured, RestRecording, without_means, without_outliers
from vgyro.metrics.tones import Tone, find_tones, share_tones

__all__ = [
    "FIGURES",
    "AllanCurve",
    "Coefficient",
    "Correlation",
    "CrossAllan",
    "Density",
    "DynamicErrors",
    "Equaliser",
    "Figure",
    "LowPass",
    "Measured",
    "NoiseCoefficients",
    "Reading",
    "Resampled",
    "RestRecording",
    "Sampling",
    "Spectrum",
    "StaticFigures",
    "Tone",
    "Units",
    "allan_deviation",
    "array_figures",
    "averaging_factors",
    "block_length",
    "common_bandwidth",
    "correlation_matrix",
    "counted",
    "cross_allan",
    "dynamic_errors",
    "dynamic_figures",
    "find_outliers",
    "find_tones",
    "flat_band",
    "improvement_by_draws",
    "improvement_factor",
    "improvement_of_deviation",
    "make_units",
    "model_deviation",
    "moments",
    "noise_coefficients",
    "noise_density",
    "noise_from_differences",
    "paper_readings",
    "read_curve",
    "resample",
    "share_tones",
    "spectral_density",
    "static_figures",
    "stretches",
    "thinned",
    "without_means",
    "without_outliers",
]

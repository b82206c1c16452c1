"""How good a rate is: Allan deviation, noise coefficients, spectra, dynamic errors, improvement factors, intervals.

Pure functions of arrays in deg/s. docs/metrics.md explains every figure and its convention. All figures of a recording
at once: vgyro.metrics.static.figures and vgyro.metrics.dynamic.figures.
"""

from typing import TYPE_CHECKING

from vgyro.lazy import lazy_exports

if TYPE_CHECKING:
    from vgyro.figure import Figure
    from vgyro.metrics.allan.coefficients import Coefficient, NoiseCoefficients, model_deviation, noise_coefficients
    from vgyro.metrics.allan.covariance import CrossAllan, cross_allan
    from vgyro.metrics.allan.deviation import AllanCurve, allan_deviation, averaging_factors, read_curve, stretches
    from vgyro.metrics.allan.scales import Scales, allan_scales
    from vgyro.metrics.correlation import Correlation, correlation_matrix
    from vgyro.metrics.dynamic.errors import DynamicErrors, dynamic_errors
    from vgyro.metrics.equal_bandwidth import Equaliser, LowPass, common_bandwidth, run_back
    from vgyro.metrics.figures import FIGURES, Reading
    from vgyro.metrics.improvement import improvement_by_draws, improvement_factor, improvement_of_deviation
    from vgyro.metrics.intervals.bootstrap import Resampled, Units, block_length, make_units, resample
    from vgyro.metrics.outliers import find_outliers
    from vgyro.metrics.sampling import Sampling
    from vgyro.metrics.spectra.tones import Tone, find_tones, share_tones
    from vgyro.metrics.spectra.welch import Density, Spectrum, flat_band, noise_density, spectral_density, thinned
    from vgyro.metrics.static.figures import StaticFigures, array_figures
    from vgyro.metrics.static.lacking import cleaned_of, correlation_of, own_samples
    from vgyro.metrics.static.pairs import noise_from_differences
    from vgyro.metrics.static.readings import counted, moments, paper_readings
    from vgyro.metrics.static.series import Measured, RestRecording, without_means, without_outliers

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
    "Scales",
    "Spectrum",
    "StaticFigures",
    "Tone",
    "Units",
    "allan_deviation",
    "allan_scales",
    "array_figures",
    "averaging_factors",
    "block_length",
    "cleaned_of",
    "common_bandwidth",
    "correlation_matrix",
    "correlation_of",
    "counted",
    "cross_allan",
    "dynamic_errors",
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
    "own_samples",
    "paper_readings",
    "read_curve",
    "resample",
    "run_back",
    "share_tones",
    "spectral_density",
    "stretches",
    "thinned",
    "without_means",
    "without_outliers",
]

__getattr__ = lazy_exports(
    __name__,
    {
        **dict.fromkeys(
            ("AllanCurve", "allan_deviation", "averaging_factors", "read_curve", "stretches"), "allan.deviation"
        ),
        **dict.fromkeys(("Resampled", "Units", "block_length", "make_units", "resample"), "intervals.bootstrap"),
        **dict.fromkeys(
            ("Coefficient", "NoiseCoefficients", "model_deviation", "noise_coefficients"), "allan.coefficients"
        ),
        **dict.fromkeys(("Correlation", "correlation_matrix"), "correlation"),
        **dict.fromkeys(("CrossAllan", "cross_allan"), "allan.covariance"),
        **dict.fromkeys(("Scales", "allan_scales"), "allan.scales"),
        **dict.fromkeys(("DynamicErrors", "dynamic_errors"), "dynamic.errors"),
        **dict.fromkeys(("Equaliser", "LowPass", "common_bandwidth", "run_back"), "equal_bandwidth"),
        **dict.fromkeys(("FIGURES", "Figure", "Reading"), "figures"),
        **dict.fromkeys(("improvement_by_draws", "improvement_factor", "improvement_of_deviation"), "improvement"),
        "find_outliers": "outliers",
        "noise_from_differences": "static.pairs",
        **dict.fromkeys(("cleaned_of", "correlation_of", "own_samples"), "static.lacking"),
        **dict.fromkeys(("counted", "moments", "paper_readings"), "static.readings"),
        "Sampling": "sampling",
        **dict.fromkeys(
            ("Density", "Spectrum", "flat_band", "noise_density", "spectral_density", "thinned"), "spectra.welch"
        ),
        **dict.fromkeys(("StaticFigures", "array_figures"), "static.figures"),
        **dict.fromkeys(("Measured", "RestRecording", "without_means", "without_outliers"), "static.series"),
        **dict.fromkeys(("Tone", "find_tones", "share_tones"), "spectra.tones"),
    },
)

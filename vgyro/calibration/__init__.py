"""Scale factor, bias, conversion to deg/s, and where the board stands still. Pure functions of arrays."""

from vgyro.calibration.convert import clipped_samples, fit_phase, sinusoid, to_rates
from vgyro.calibration.figures import BELOW, FIGURES, MISSING, VALUE, Finding, figure_record, not_measured
from vgyro.calibration.moves import (
    GyroWindows,
    find_moves,
    gyro_windows,
    noise_level,
    seems_to_move,
    widened,
    window_length,
)
from vgyro.calibration.plateaus import DIRECTION_NAMES, PlateauMeans, average_plateaus, find_plateaus
from vgyro.calibration.repeatability import bias_repeatability, scale_repeatability
from vgyro.calibration.rest import find_rest
from vgyro.calibration.scale import GyroNominal, ScaleFit, cross_axis, fit_scale_factor, nominal_fit
from vgyro.calibration.temperature import Compensation, compensate, scale_temperature, smooth_temperature
from vgyro.calibration.thermal import (
    BiasTemperature,
    ThermalPoints,
    bias_temperature,
    fit_bias_temperature,
    self_heating,
    thermal_points,
)

__all__ = [
    "BELOW",
    "DIRECTION_NAMES",
    "FIGURES",
    "MISSING",
    "VALUE",
    "BiasTemperature",
    "Compensation",
    "Finding",
    "GyroNominal",
    "GyroWindows",
    "PlateauMeans",
    "ScaleFit",
    "ThermalPoints",
    "average_plateaus",
    "bias_repeatability",
    "bias_temperature",
    "clipped_samples",
    "compensate",
    "cross_axis",
    "figure_record",
    "find_moves",
    "find_plateaus",
    "find_rest",
    "fit_bias_temperature",
    "fit_phase",
    "fit_scale_factor",
    "gyro_windows",
    "noise_level",
    "nominal_fit",
    "not_measured",
    "scale_repeatability",
    "scale_temperature",
    "seems_to_move",
    "self_heating",
    "sinusoid",
    "smooth_temperature",
    "thermal_points",
    "to_rates",
    "widened",
    "window_length",
]

"""Scale factor, bias, conversion to deg/s, and where the board stands still. Pure functions of arrays."""

from vgyro.calibration.convert import clipped_samples, fit_phase, sinusoid, to_rates
from vgyro.calibration.plateaus import PlateauMeans, average_plateaus, find_plateaus
from vgyro.calibration.rest import find_rest
from vgyro.calibration.scale import GyroNominal, ScaleFit, fit_scale_factor, nominal_fit

__all__ = [
    "GyroNominal",
    "PlateauMeans",
    "ScaleFit",
    "average_plateaus",
    "clipped_samples",
    "find_plateaus",
    "find_rest",
    "fit_phase",
    "fit_scale_factor",
    "nominal_fit",
    "sinusoid",
    "to_rates",
]

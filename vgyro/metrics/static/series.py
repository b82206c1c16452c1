"""What is measured of one series at rest, one series in memory at a time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vgyro.config import MetricsOptions
from vgyro.metrics.allan.coefficients import noise_coefficients
from vgyro.metrics.allan.deviation import AllanCurve, allan_deviation, split_segments
from vgyro.metrics.angle import AngleGrid
from vgyro.metrics.equal_bandwidth import Equaliser, LowPass
from vgyro.metrics.figures import Reading
from vgyro.metrics.intervals.unit_grid import UnitGrid, Units, sampled_grid, unit_grid
from vgyro.metrics.outliers import find_outliers
from vgyro.metrics.sampling import Sampling
from vgyro.metrics.spectra.welch import Spectrum, spectral_density
from vgyro.metrics.static.readings import counted, paper_readings

NEIGHBOURS = 10
AT_ONCE = 1 << 14


@dataclass(frozen=True)
class Measured:
    """Of one series: Allan curves by kind, spectrum, figures so far, and the sums that the others need.

    sums, inside, equal : units of the samples; of the samples without the means of their poses; at the common bandwidth
                          (None: it cannot be brought there)
    seconds [B]         : means of the units that are 0.9 full, outliers replaced, deg/s
    """

    curves: dict[str, AllanCurve]
    spectrum: Spectrum
    readings: dict[str, Reading]
    low_pass: LowPass
    sums: Units
    inside: Units | None
    equal: Units | None
    seconds: np.ndarray

    @property
    def curve(self) -> AllanCurve:
        """The overlapping Allan curve."""
        return self.curves["overlapping"]


@dataclass(frozen=True)
class RestRecording:
    """What all series of one recording at rest share.

    sampling  : of the samples at rest;  segment [T] : of these, the gap-free runs;  missing : lost within stretches
    grid, places, seconds : units of 1 s; those of them that are 0.9 full, and when they were
    equaliser : to the common bandwidth; None: nothing limits the bandwidth
    equal     : units at the common bandwidth
    poses     : the stretches are different poses: 1σ is taken about each pose's own mean
    """

    sampling: Sampling
    segment: np.ndarray
    missing: int
    grid: UnitGrid
    places: np.ndarray
    seconds: Sampling
    angle: AngleGrid
    equaliser: Equaliser | None
    equal: UnitGrid | None
    poses: bool
    options: MetricsOptions
    engine: str = field(default="native")

    @classmethod
    def of(
        cls,
        sampling: Sampling,
        options: MetricsOptions,
        bandwidth_hz: float | None = None,
        engine: str = "native",
        poses: bool = False,
        back: bool = False,
    ) -> RestRecording:
        """bandwidth_hz : at which 1σ is compared, Hz; None: it is not;  back : a series was filtered backward"""
        segment, grid = sampling.segment, sampled_grid(sampling)
        places, seconds = grid.seconds()
        equaliser = equal = None
        if bandwidth_hz is not None:
            equaliser = Equaliser.of(bandwidth_hz, sampling.rate_hz, segment, engine, back)
            equal = unit_grid(equaliser.cuts, sampling.rate_hz)
        angle = AngleGrid.of(sampling, each=poses)
        missing = sampling.missing
        return cls(sampling, segment, missing, grid, places, seconds, angle, equaliser, equal, poses, options, engine)

    def measure(self, values: np.ndarray, low_pass: LowPass) -> Measured:
        """Figures of one series [T], deg/s.

        Samples that are outliers are left out of the Allan deviation, and with it of the coefficients. In the spectrum,
        which needs even steps, and in the integrated angle the mean of their neighbours stands for them: the power of
        one sample in a thousand is less than its error. Mean and 1σ keep them.
        """
        options, rate_hz = self.options, self.sampling.rate_hz
        cleaned, outliers = without_outliers(values, rate_hz, self.segment, options.outlier_threshold)
        any_out = bool(outliers.any())
        kept = values[~outliers] if any_out else values
        # Without any loss the stretches are gap-free, and the lean way is open.
        lossless = self.missing == 0 and not any_out
        sampling = None if lossless else self.sampling.without(outliers)
        segment = self.segment if lossless else None
        curves = {
            kind: allan_deviation(
                kept, rate_hz, None, segment, options.confidence, self.engine, options.taus_per_octave,
                sampling=sampling, kind=kind,
            )
            for kind in ("overlapping", *options.curves)
        }  # fmt: skip
        spectrum = spectral_density(cleaned, rate_hz, options.welch_s, self.segment)
        curve = curves["overlapping"]
        fitted = noise_coefficients(
            curve, low_pass.bandwidth_hz, low_pass.dc_gain, options.bootstrap, options.seed, passes=low_pass.passes
        )
        readings = paper_readings(curve, spectrum, fitted, rate_hz, low_pass)
        readings["missing"] = counted(self.missing)
        if options.outlier_threshold is not None:
            readings["outliers"] = counted(int(outliers.sum()))
        readings["angle_drift_60s"] = self.angle.drift(cleaned, options.confidence)
        readings["angle_bound_60s"] = self.angle.bound(fitted.N, fitted.B, fitted.K)
        sums = self.grid.units_of(values, cleaned if any_out else None)
        return Measured(
            curves, spectrum, readings, low_pass, sums, self._inside(values), self._equal(values, low_pass),
            self.grid.means_of(self.grid.sums_of(cleaned)[0], self.places),
        )  # fmt: skip

    def _inside(self, values: np.ndarray) -> Units | None:
        return self.grid.units_of(without_means(values, self.sampling.stretch)) if self.poses else None

    def _equal(self, values: np.ndarray, low_pass: LowPass) -> Units | None:
        if self.equaliser is None or self.equal is None or self.equal.samples == 0 or low_pass.other_shape:
            return None
        values = without_means(values, self.sampling.stretch) if self.poses else values
        return self.equal.units_of(self.equaliser.apply(values, low_pass))


def without_outliers(
    values: np.ndarray, rate_hz: float, segment: np.ndarray, threshold: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """A series [T] with its outliers replaced by what is around them, and which they are [T]; threshold None: none."""
    if threshold is None:
        return values, np.zeros(len(values), dtype=bool)
    found = find_outliers(values, rate_hz, segment, threshold)
    return (replaced(values, found, segment) if found.any() else values), found


def without_means(values: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """values [T] with the mean of each stretch taken off."""
    return np.concatenate([np.empty(0), *(piece - piece.mean() for piece in split_segments(values, segment))])


def replaced(values: np.ndarray, mask: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """values [T] where the samples marked by mask [T] are the mean of the ten on either side that are not.

    segment : array [T] int; only samples of the same stretch count. Without any the sample stays.
    """
    found = np.array(values, dtype=float)
    at = np.flatnonzero(mask)
    around = np.concatenate([np.arange(-NEIGHBOURS, 0), np.arange(1, NEIGHBOURS + 1)])
    for first in range(0, len(at), AT_ONCE):
        own = at[first : first + AT_ONCE]
        near = np.clip(own[:, None] + around, 0, len(values) - 1)
        good = ~mask[near] & (segment[near] == segment[own][:, None])
        count = good.sum(axis=1)
        mean = np.sum(np.where(good, values[near], 0.0), axis=1) / np.maximum(count, 1)
        found[own] = np.where(count > 0, mean, values[own])
    return found

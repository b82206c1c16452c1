"""What the fusion methods take and give: the rates of one array, its noise, the parameters, the fused rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar

import numpy as np

from vgyro.arrays import Floats
from vgyro.config import MOTION_MODELS, FusionOptions, MotionModel, Switch
from vgyro.errors import DataError
from vgyro.fusion.blocks import SampleWeights
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.parts import PARTS
from vgyro.runs import runs
from vgyro.units import arw_deg_s_rt_hz
from vgyro.validation import did_you_mean

T = TypeVar("T")
Family = Literal["baseline", "paper", "ours", "other"]

WeightKey = tuple[str, str, str]
"""model (dcc, ccc), mode (in_sample, causal), definition of r_t"""


class CannotRun(DataError):
    """A method cannot run on this array; the others go on, and the reason goes into the methods table."""


@contextmanager
def cannot_run() -> Iterator[None]:
    """What is a DataError in here is the reason why a method cannot run."""
    try:
        yield
    except CannotRun:
        raise
    except DataError as reason:
        raise CannotRun(reason.what, reason.where, reason.remedy) from None


@dataclass(frozen=True)
class AllanScales:
    """Allan covariances of N gyros at rest, at averaging times that double: 1, 2, 4, … samples.

    tau        : array [J], s, rising
    covariance : array [J, N, N], (deg/s)², C_ij(τ) = ½⟨d_i d_j⟩, d the difference of adjacent means over τ; NaN in the
                 row and column of a gyro that had too few values
    pairs      : array [J], how many pairs of adjacent means over τ the record has side by side: about the degrees of
                 freedom of each estimate
    own        : they are of the very recording that is fused
    """

    tau: np.ndarray
    covariance: np.ndarray
    pairs: np.ndarray
    own: bool = False

    def of(self, gyros: Sequence[int] | np.ndarray) -> AllanScales:
        """Those of some gyros, by their places."""
        places = np.asarray(gyros)
        return replace(self, covariance=self.covariance[:, places][:, :, places])


@dataclass(frozen=True)
class TemperatureAtRest:
    """Temperature coefficients of N gyros, from a record at rest.

    slope      : array [N], deg/s/K;  covariance : array [N, N] of them
    nulled     : temperature at which the mean of the biases is zero, °C;  nulled_sd : its s.d., K
    scales     : Allan covariances without what follows the temperature, from 1 s on; None: the board moved between
    """

    slope: np.ndarray
    covariance: np.ndarray
    nulled: float
    nulled_sd: float
    scales: AllanScales | None = None

    def of(self, gyros: Sequence[int] | np.ndarray) -> TemperatureAtRest:
        """Those of some gyros, by their places."""
        places = np.asarray(gyros)
        scales = None if self.scales is None else self.scales.of(places)
        covariance = self.covariance[np.ix_(places, places)]
        return replace(self, slope=self.slope[places], covariance=covariance, scales=scales)


@dataclass(frozen=True)
class ArrayNoise:
    """Noise of the gyros of one array.

    arw         : array [N], deg/s/√Hz two-sided; NaN where it was not measured
    rrw         : array [N], deg/s/√s; NaN where it was not measured, 0 where none was found
    correlation : array [N, N] of the noise, unit diagonal
    rrw_note    : what to know of the rate random walks
    scales      : Allan covariances over the averaging time; None: no record at rest was long enough
    temperature : temperature coefficients from another record at rest than the one that is fused; None: not known
    """

    arw: np.ndarray
    rrw: np.ndarray
    correlation: np.ndarray
    rrw_note: str = ""
    scales: AllanScales | None = None
    temperature: TemperatureAtRest | None = None

    @property
    def R(self) -> Floats:
        """Continuous noise covariance [N, N], (deg/s)²/Hz: arw_i · arw_j · correlation_ij."""
        R: Floats = np.outer(self.arw, self.arw) * self.correlation
        return R

    def of(self, gyros: Sequence[int]) -> ArrayNoise:
        """The noise of some gyros, by their places."""
        places = np.asarray(gyros)
        return replace(
            self,
            arw=self.arw[places],
            rrw=self.rrw[places],
            correlation=self.correlation[np.ix_(places, places)],
            scales=None if self.scales is None else self.scales.of(places),
            temperature=None if self.temperature is None else self.temperature.of(places),
        )

    def with_arw(self, arw: float | None) -> ArrayNoise:
        """The same array with one ARW for every gyro, deg/s/√Hz; None changes nothing."""
        return self if arw is None else replace(self, arw=np.full(len(self.arw), arw))


@dataclass(frozen=True)
class ArrayRates:
    """One recording of one array.

    rate    : array [T, N], deg/s, float32 or float64, best with contiguous columns;  rate_hz : sample rate, Hz
    segment : array [T], number of the gap-free stretch;  at_rest : array [T] of bool
    weights : (model, mode, definition) → weights of the samples
    no_weights : the same keys → why there are none
    deviations : (model, mode, definition) → conditional standard deviations of the gyros in deg/s, of the block means
                 that the weights were made from; NaN where there is no fit
    faults     : stretches in which one gyro is at fault
    temperature : [T] °C, of the board; None: not logged
    stretch_time : [S] s, time of the first sample of each gap-free stretch; None: they follow without time between
    missing    : [T, N] of bool, samples without a value, for which `rate` holds what is filled in
                 (vgyro.fusion.samples.missing); None: there are none
    lowpass_hz : [N] Hz, -3 dB frequency of each gyro's own first-order low-pass (data sheet); NaN or None: unknown
    """

    rate: np.ndarray
    rate_hz: float
    segment: np.ndarray
    at_rest: np.ndarray
    noise: ArrayNoise
    weights: Mapping[WeightKey, SampleWeights] = field(default_factory=dict)
    no_weights: Mapping[WeightKey, str] = field(default_factory=dict)
    deviations: Mapping[WeightKey, SampleWeights] = field(default_factory=dict)
    faults: tuple[FaultEvent, ...] = ()
    temperature: np.ndarray | None = None
    stretch_time: np.ndarray | None = None
    missing: np.ndarray | None = None
    lowpass_hz: np.ndarray | None = None
    _made: dict[Hashable, Any] = field(init=False, default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        samples = len(self.rate)
        if self.rate.ndim != 2 or samples == 0 or len(self.segment) != samples or len(self.at_rest) != samples:
            raise DataError(
                f"rate {self.rate.shape}, segment {self.segment.shape} and at_rest {self.at_rest.shape} do not fit",
                remedy="give [T, N], [T] and [T] with T >= 1",
            )

    @property
    def period(self) -> float:
        """Sample period T, s."""
        return 1.0 / self.rate_hz

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """What `make` returns, made once: for results that several methods need. A copy with other rates has none."""
        if key not in self._made:
            self._made[key] = make()
        made: T = self._made[key]
        return made

    def forget(self) -> None:
        """Drop what was made once: for whoever changes the rates in their place."""
        self._made.clear()

    def part(self, samples: slice) -> ArrayRates:
        """Some of the samples, first to last - 1."""
        weights = {key: one.part(samples) for key, one in self.weights.items()}
        deviations = {key: one.part(samples) for key, one in self.deviations.items()}
        columns = {name: getattr(self, name)[samples] for name in ("rate", "segment", "at_rest")}
        first, last, _ = samples.indices(len(self.rate))
        faults = tuple(one.within(first, last) for one in self.faults if one.start < last and one.stop > first)
        temperature = None if self.temperature is None else self.temperature[samples]
        stretch_time = None if self.stretch_time is None else self._stretch_times(first, last)
        missing = None if self.missing is None else self.missing[samples]
        return replace(
            self, **columns, weights=weights, deviations=deviations, faults=faults, temperature=temperature,
            stretch_time=stretch_time, missing=missing,
        )  # fmt: skip

    def _stretch_times(self, first: int, last: int) -> np.ndarray:
        """Times of the first samples of the stretches that samples [first, last) lie in, from sample `first` on."""
        assert self.stretch_time is not None
        parts = zip(self.stretches(), self.stretch_time.tolist(), strict=True)
        return np.array([
            time + (max(part.start, first) - part.start) * self.period
            for part, time in parts
            if part.start < last and part.stop > first
        ])  # fmt: skip

    def stretches(self) -> list[slice]:
        """The gap-free stretches, in order."""
        return [slice(start, stop) for start, stop in runs(self.segment).tolist()]


@dataclass(frozen=True)
class FilterParameters:
    """Parameters of the methods.

    bandwidth_hz    : -3 dB bandwidth that sets q where q is None
    q               : process noise of the rate, deg²/s³; None: from bandwidth_hz
    arw             : one ARW for all gyros in R of the filters, deg/s/√Hz; None: as measured
    tau_s           : time constant of the first-order Markov rate, s
    block_hz        : rate of the block means whose second moments make weights, Hz
    moment_window_s, ewma_time_s : memory of these moments, s
    motion_models   : models of the rate from which the smoother chooses
    anchors, temperature : "auto" or "off": pin the bias where the board is known to stand still; regress it on the
                      temperature
    scale_sd        : standard deviation of the gyros' scale factor errors, for the filter that estimates them
    bank_correlations, bank_bandwidths : of the filters of the adaptive bank; bandwidths as multiples of bandwidth_hz
    in_motion       : the board moves in this recording, at least in part
    engine          : who runs the recursions
    definition      : definition of r_t, for the methods that have one each
    without         : parts of `recommended` (vgyro.fusion.parts) that are left out
    """

    bandwidth_hz: float = 1.0
    q: float | None = None
    arw: float | None = None
    tau_s: float = 500.0
    block_hz: float = 1.0
    moment_window_s: float = 360.0
    ewma_time_s: float = 60.0
    motion_models: tuple[MotionModel, ...] = MOTION_MODELS
    anchors: Switch = "auto"
    temperature: Switch = "auto"
    scale_sd: float = 0.01
    bank_correlations: tuple[float, ...] = (0.0, 0.25, 0.5)
    bank_bandwidths: tuple[float, ...] = (0.2, 1.0, 5.0)
    in_motion: bool = False
    engine: str = "native"
    definition: str = ""
    without: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        unknown = self.without - set(PARTS)
        if unknown:
            raise DataError(f"recommended has no part {min(unknown)!r}{did_you_mean(min(unknown), list(PARTS))}")

    def has(self, part: str) -> bool:
        """Is this part of `recommended` in use?"""
        if part not in PARTS:
            raise KeyError(part)
        return part not in self.without

    @classmethod
    def of(
        cls, options: FusionOptions, in_motion: bool, block_hz: float = 1.0, engine: str = "native"
    ) -> FilterParameters:
        """The user's options, for a recording at rest or in motion."""
        arw = options.arw_deg_rt_h
        return cls(
            bandwidth_hz=options.bandwidth_dynamic_hz if in_motion else options.bandwidth_hz,
            q=options.q_dynamic if in_motion else options.q,
            arw=None if arw is None else arw_deg_s_rt_hz(arw),
            tau_s=options.tau_s,
            block_hz=block_hz,
            moment_window_s=options.moment_window_s,
            ewma_time_s=options.ewma_time_s,
            motion_models=options.motion_models,
            anchors=options.anchors,
            temperature=options.temperature,
            scale_sd=options.scale_sd,
            bank_correlations=options.bank_correlations,
            bank_bandwidths=options.bank_bandwidths,
            in_motion=in_motion,
            engine=engine,
        )


@dataclass(frozen=True)
class Fused:
    """A virtual gyroscope.

    rate               : array [T], deg/s
    weights            : array [N], or those of each sample; None where the method has none
    dc_gain            : gain for a constant rate; NaN: this and the next three are not known, and are to be measured
    bandwidth_hz       : -3 dB bandwidth, Hz; NaN: not limited by the method
    noise_bandwidth_hz : noise-equivalent bandwidth, one-sided, Hz; NaN: not limited
    delay_s            : delay at low frequency, s
    note               : what to know before using it
    passes             : how often a first-order low-pass of this bandwidth is run over it: 1, forward; 2, forward and
                         back, without delay; 0: it has another shape, or no limit of bandwidth
    sd                 : array [T], deg/s, posterior standard deviation of each sample; None: the method has none
    """

    rate: np.ndarray
    weights: np.ndarray | SampleWeights | None = None
    dc_gain: float = math.nan
    bandwidth_hz: float = math.nan
    noise_bandwidth_hz: float = math.nan
    delay_s: float = math.nan
    note: str = ""
    passes: int = 1
    sd: np.ndarray | None = None

    @classmethod
    def undelayed(cls, rate: np.ndarray, weights: np.ndarray | SampleWeights | None = None, note: str = "") -> Fused:
        """Of a method that passes a motion common to all gyros as it is: Σw = 1 at every sample, no memory of rates."""
        return cls(rate, weights, dc_gain=1.0, delay_s=0.0, note=note)


def _not_counted(gyros: int) -> float:  # noqa: ARG001
    return math.nan


@dataclass(frozen=True)
class Method:
    """One way to make one rate of many: an entry of vgyro.fusion.METHODS.

    causal : sample t uses nothing later than t; noise coefficients count as known beforehand
    needs  : what it takes beside the rates: "arw", "rrw" (of every gyro), "correlation", "scales" (Allan covariances
             at rest), "weights" (of vgyro.volatility), "faults" (of vgyro.fusion.faults)
    fuse   : (ArrayRates, FilterParameters) → Fused;  raises CannotRun, with the reason
    per_definition : it runs once for each definition of r_t
    same_at_any_rate : definition ("" of a method without) → why a constant rate, added to all gyros, adds itself to the
                       fused rate and changes nothing else. What is not in it is run again with such a rate
    family     : baseline, of a paper, ours, or of another package
    operations : N gyros → floating-point operations a sample, all passes; what is done once a recording is left out
    inferred   : what its paper does not say, or could not be read, and how it was filled in
    package    : name and version of the package that brings it (vgyro.fusion.packages); empty: it is of vgyro
    """

    name: str
    title: str
    source: str
    causal: bool
    needs: tuple[str, ...]
    fuse: Callable[[ArrayRates, FilterParameters], Fused]
    per_definition: bool = False
    same_at_any_rate: Mapping[str, str] = field(default_factory=dict)
    family: Family = "paper"
    operations: Callable[[int], float] = _not_counted
    inferred: str = ""
    package: str = ""

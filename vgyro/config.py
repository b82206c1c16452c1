"""The user's choices: config/config.yaml as a validated model. A manifest may override `analysis` for its data set."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Field, ValidationError, ValidationInfo, model_validator

from vgyro import complaints
from vgyro.validation import Problem, StrictModel, parse_model

Definition = Literal["level", "demeaned", "difference", "residual"]
Mode = Literal["in_sample", "causal"]
CorrelationModel = Literal["dcc", "ccc"]
Engine = Literal["native", "reference"]
Curve = Literal["modified", "hadamard", "robust"]
MotionModel = Literal["random_walk", "acceleration", "jerk", "oscillator", "markov"]
Switch = Literal["auto", "off"]

PARTIAL = "partial"

DEFINITIONS: tuple[Definition, ...] = get_args(Definition)
MODES: tuple[Mode, ...] = ("in_sample", "causal")
MOTION_MODELS: tuple[MotionModel, ...] = get_args(MotionModel)
MODELS: tuple[CorrelationModel, ...] = ("dcc", "ccc")


class IntegrityOptions(StrictModel):
    """When is a dump good enough to be analysed?"""

    min_good_share: float = Field(0.5, ge=0, le=1, description="refuse a recording below this share of good frames")
    max_rate_error: float = Field(0.02, gt=0, description="warn when measured and declared rate differ by more, ratio")
    stuck_s: float = Field(1.0, gt=0, description="a channel that repeats one count for longer than this is stuck, s")
    max_clipped_share: float = Field(0.01, ge=0, le=1, description="warn when a larger share of samples is clipped")
    refuse_clipped_share: float = Field(
        0.9, gt=0, le=1, description="refuse a recording of which a larger share is clipped on nearly all gyros"
    )


class RestOptions(StrictModel):
    """How rest stretches are found in a `free` recording."""

    window_s: float = Field(1.0, gt=0, description="length of the windows that are tested for motion, s")
    min_duration_s: float = Field(5.0, gt=0, description="a shorter stretch is not counted as rest, s")
    guard_s: float = Field(0.5, ge=0, description="cut from both ends of each stretch, s")
    threshold: float = Field(4.0, gt=0, description="motion begins at this multiple of the quiet level")


class CalibrationOptions(StrictModel):
    """Rate-table tests, and what the temperature does."""

    confidence: float = Field(0.95, gt=0.5, lt=1, description="confidence of every interval")
    temperature: Literal["auto", "off"] = Field(
        "auto", description="auto: compensate bias and scale where the recordings show a dependence; off: never"
    )
    settle_s: float = Field(1.0, ge=0, description="cut from the start of plateaus that are found in a log, s")
    whole_turns: bool = Field(True, description="average whole turns of the table where a plateau holds one")


class VolatilityOptions(StrictModel):
    """Rolling-window ARCH/GARCH/DCC analysis (Liu et al. 2015)."""

    rate_hz: float | Literal["full"] = Field(1.0, description="rate of the analysed series (block means), or full")
    window: int = Field(360, ge=50, description="samples in a window")
    step: int = Field(30, ge=1, description="samples between the starts of two windows")
    definitions: tuple[Definition, ...] = Field(
        DEFINITIONS, min_length=1, description="what r_t is: the rate, less its mean, its difference, its residual"
    )
    modes: tuple[Mode, ...] = Field(
        MODES, min_length=1, description="in_sample: variance of the window's own samples; causal: of later ones only"
    )
    models: tuple[CorrelationModel, ...] = Field(
        MODELS, min_length=1, description="dcc: correlation changes with time; ccc: it does not"
    )
    arch_lags: int = Field(1, ge=1, description="lags of the ARCH-LM test")
    residual_span: int = Field(15, ge=3, description="samples averaged for the rate that `residual` removes")
    detrend_span: int = Field(61, ge=5, description="samples of the running mean that `detrended` removes")

    @model_validator(mode="after")
    def _step_within_window(self, info: ValidationInfo) -> VolatilityOptions:
        # A manifest sets only some of the keys; they are checked once they lie over those of config.yaml.
        if self.step > self.window and not (info.context or {}).get(PARTIAL):
            raise ValueError(f"step = {self.step} is longer than window = {self.window}: samples would be left out")
        return self


class FusionOptions(StrictModel):
    """Methods to run, and the parameters of the Kalman filters. A null parameter is estimated from the data."""

    methods: tuple[str, ...] | Literal["all"] = Field(
        "all", description="names of methods (docs/file-formats.md), or all"
    )
    bandwidth_hz: float = Field(1.0, gt=0, description="bandwidth that sets q of the Kalman filters, Hz")
    bandwidth_dynamic_hz: float = Field(5.0, gt=0, description="the same for recordings in motion, Hz")
    q: float | None = Field(None, gt=0, description="process noise at rest, deg²/s³; null: from bandwidth_hz")
    q_dynamic: float | None = Field(None, gt=0, description="the same in motion; null: from bandwidth_dynamic_hz")
    arw_deg_rt_h: float | None = Field(None, gt=0, description="angle random walk of each gyro, deg/√h; null: measured")
    tau_s: float = Field(500.0, gt=0, description="time constant of the first-order Markov rate model, s")
    moment_window_s: float = Field(360.0, gt=0, description="window of the rolling second-moment weights, s")
    ewma_time_s: float = Field(60.0, gt=0, description="time constant of the exponentially weighted moments, s")
    motion_models: tuple[MotionModel, ...] = Field(
        MOTION_MODELS,
        min_length=1,
        description="models of the rate; the smoother takes that of the least estimated error",
    )
    anchors: Switch = Field("auto", description="auto: pin the bias where the board stands still between motion; off")
    temperature: Switch = Field("auto", description="auto: regress the bias on the logged temperature; off: never")
    scale_sd: float = Field(0.01, gt=0, lt=1, description="s.d. of the scale factors' errors, for stubberud_2008")
    bank_correlations: tuple[Annotated[float, Field(gt=-1, lt=1)], ...] = Field(
        (0.0, 0.25, 0.5), min_length=1, description="correlations of the filters of al_majed"
    )
    bank_bandwidths: tuple[Annotated[float, Field(gt=0)], ...] = Field(
        (0.2, 1.0, 5.0), min_length=1, description="their bandwidths, as multiples of bandwidth_hz"
    )
    most_gyros: int = Field(48, ge=2, le=1000, description="largest array of the analysis of more gyros")


class FaultOptions(StrictModel):
    """How faults of single gyros are found."""

    detect: Switch = Field("auto", description="auto: find faults, and leave the gyro out while they last; off")
    block_s: float = Field(1.0, gt=0, description="length of the means in which faults are looked for, s")
    threshold: float = Field(7.0, ge=4, description="least evidence of a fault, standard deviations")
    burst_s: float = Field(30.0, gt=0, description="more noise for a shorter time is a burst, s")


class MetricsOptions(StrictModel):
    """Allan deviation, spectra, intervals."""

    taus_per_octave: int = Field(3, ge=1, le=12, description="points of the Allan curve per octave of τ")
    confidence: float = Field(0.95, gt=0.5, lt=1, description="confidence of every interval")
    welch_s: float = Field(100.0, gt=0, description="length of a Welch segment, s")
    bootstrap: int = Field(500, ge=50, description="replicates of the bootstrap intervals")
    seed: int = Field(20120207, ge=0, description="seed of the bootstrap")
    curves: tuple[Curve, ...] = Field((), description="Allan deviations beside the overlapping one")
    most_lost_s: float = Field(0.5, ge=0, description="a shorter loss of samples does not break an average, s")
    outlier_threshold: float | None = Field(
        8.0, ge=5, description="a single sample so many standard deviations off is an outlier; null: none is"
    )
    equal_bandwidth_hz: float | None = Field(
        None, gt=0, description="bandwidth at which 1σ is compared, Hz; null: the narrowest of the methods"
    )
    injected_rate: float | None = Field(
        0.05, description="constant rate added to recordings at rest for a second table, deg/s; null: no such table"
    )


class CrossCheckOptions(StrictModel):
    """Random windows that are computed again by an independent route."""

    windows: int = Field(5, ge=0, description="windows a recording and axis")
    seed: int = Field(20150612, ge=0, description="seed of the sample")


class Analysis(StrictModel):
    """Everything that a manifest may override for its data set."""

    engine: Engine = Field(
        "native",
        description="who computes; native: C kernels; reference: arch, pymgarch, cvxpy, filterpy, allantools (slow)",
    )
    bekk: bool = Field(False, description="true: BEKK beside DCC on as many random windows as crosscheck.windows; slow")
    integrity: IntegrityOptions = IntegrityOptions()
    rest: RestOptions = RestOptions()
    calibration: CalibrationOptions = CalibrationOptions()
    volatility: VolatilityOptions = VolatilityOptions()
    faults: FaultOptions = FaultOptions()
    fusion: FusionOptions = FusionOptions()
    metrics: MetricsOptions = MetricsOptions()
    crosscheck: CrossCheckOptions = CrossCheckOptions()


class WorkflowOptions(StrictModel):
    """How the work is cut into jobs. The results do not depend on it."""

    chunk_windows: int = Field(20000, ge=1, description="rolling windows a job; a longer recording takes several jobs")


class Config(StrictModel):
    """config/config.yaml"""

    datasets: tuple[str, ...] | Literal["auto"] = Field(
        "auto", description="names of folders in raw/; auto: all of them"
    )
    workflow: WorkflowOptions = WorkflowOptions()
    analysis: Analysis = Analysis()


def parse_config(text: str, source: str = "config/config.yaml") -> Config:
    """Validate the text of config.yaml; an empty file means every default.  raises : InvalidFile"""
    return parse_model(text if text.strip() else "{}", Config, source)


def merge(base: dict[str, Any], override: dict[str, Any]) -> dict[str, Any]:
    """Return `base` with the keys of `override` put over it, mapping by mapping."""
    merged = dict(base)
    for key, value in override.items():
        nested = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = merge(merged[key], value) if nested else value
    return merged


def override_analysis(analysis: Analysis, override: Analysis | None) -> Analysis:
    """Return `analysis` with the keys that the manifest sets put over it."""
    if override is None:
        return analysis
    return Analysis.model_validate(merge(analysis.model_dump(), override.model_dump(exclude_unset=True)))


def override_problems(analysis: Analysis, override: Analysis | None, source: str) -> list[Problem]:
    """Mistakes that only show when the manifest's keys lie over those of config.yaml; lines are not known yet."""
    try:
        override_analysis(analysis, override)
    except ValidationError as error:
        merged = merge(analysis.model_dump(), override.model_dump(exclude_unset=True) if override else {})
        found = complaints.of_errors(error.errors(include_url=False), merged, Analysis)
        return [Problem(source, 1, ".".join(["analysis", *map(str, path)]), message) for path, message in found]
    return []

"""config/twins/<name>.yaml as a validated model: a board whose truth is known, and the recordings to make of it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from vgyro.complaints import did_you_mean
from vgyro.config import PARTIAL, Analysis, merge
from vgyro.dataset import RESERVED, Kind
from vgyro.errors import ConfigError
from vgyro.units import arw_deg_rt_h
from vgyro.validation import StrictModel, parse_model

EVERY_GYRO = "all"
FaultKind = Literal["drift", "step", "burst", "noise", "scale", "stuck", "dropout"]
SIZED: tuple[FaultKind, ...] = ("drift", "step", "burst", "noise", "scale")
Correlation = Annotated[float, Field(gt=-1, lt=1)] | tuple[tuple[float, ...], ...]


class TwinGarch(StrictModel):
    """Volatility of the white noise, second by second: h_t = omega + alpha · r²_{t-1} + beta · h_{t-1}."""

    alpha: float = Field(ge=0, lt=1)
    beta: float = Field(ge=0, lt=1)
    omega: float | None = Field(None, gt=0, description="(deg/s)²; null: from arw_deg_rt_h, N²·(1 - alpha - beta)")

    @model_validator(mode="after")
    def _stationary(self) -> TwinGarch:
        if self.alpha + self.beta >= 1:
            raise ValueError(f"alpha + beta = {self.alpha + self.beta:g} must be below 1: the variance has no mean")
        return self


class Dcc(StrictModel):
    """Correlation of the white noise, second by second: Q_t = (1-a-b)·S + a·εε' + b·Q_{t-1}; S is `correlation`."""

    a: float = Field(ge=0, lt=1)
    b: float = Field(ge=0, lt=1)

    @model_validator(mode="after")
    def _stationary(self) -> Dcc:
        if self.a + self.b >= 1:
            raise ValueError(f"a + b = {self.a + self.b:g} must be below 1")
        return self


class GyroTruth(StrictModel):
    """Errors of one gyro, referred to its input. Two-sided densities: see docs/twins.md."""

    arw_deg_rt_h: float | None = Field(None, ge=0, description="angle random walk (white noise N), deg/√h")
    bias_instability_deg_h: float = Field(0.0, ge=0, description="flicker coefficient B, deg/h; Allan floor 0.664·B")
    rrw_deg_h_rt_h: float = Field(0.0, ge=0, description="rate random walk K, deg/h/√h")
    bias_deg_s: float = Field(0.0, description="constant bias, deg/s")
    scale_error: float = Field(0.0, gt=-0.5, lt=0.5, description="true sensitivity over nominal, minus 1")
    temperature_coefficient: float = Field(0.0, description="bias per kelvin above temperature.reference_c, deg/s/K")
    temperature_quadratic: float = Field(0.0, description="the same, of the square, deg/s/K²")
    temperature_cubic: float = Field(0.0, description="the same, of the cube, deg/s/K³")
    scale_temperature_ppm_k: float = Field(0.0, description="sensitivity per kelvin above reference_c, ppm/K")
    nonlinearity_ppm: float = Field(0.0, description="largest deviation of the cubic part, ppm of full scale")
    asymmetry_ppm: float = Field(0.0, description="(S⁺ - S⁻) over mean sensitivity, ppm")
    hysteresis_ppm: float = Field(0.0, description="width of the loop at zero rate, ppm of full scale")
    cross_axis: float = Field(0.0, gt=-0.5, lt=0.5, description="share seen of a rate about another axis")
    garch: TwinGarch | None = None

    @property
    def arw(self) -> float:
        """Angle random walk, deg/√h, given or implied by omega."""
        if self.garch is not None and self.garch.omega is not None:
            found: float = arw_deg_rt_h((self.garch.omega / (1 - self.garch.alpha - self.garch.beta)) ** 0.5)
            return found
        return self.arw_deg_rt_h or 0.0

    @model_validator(mode="after")
    def _one_white_level(self) -> GyroTruth:
        if self.arw_deg_rt_h is not None and self.garch is not None and self.garch.omega is not None:
            raise ValueError("arw_deg_rt_h and garch.omega both set the white noise; leave one of them out")
        return self


class TemperatureTruth(StrictModel):
    """T(t) = start_c + rise_k · (1 - exp(-t / time_constant_s)), the same for every sensor; the rise is self-heating.

    points : a sweep of the chamber, (s, °C) each, straight in between, held at both ends; instead of start_c
    """

    start_c: float = 25.0
    points: tuple[tuple[float, float], ...] = ()
    rise_k: float = 0.0
    time_constant_s: float = Field(600.0, gt=0)
    noise_k: float = Field(0.0, ge=0, description="white noise of the thermometer, K per sample")
    reference_c: float = Field(25.0, description="temperature at which the temperature coefficients add nothing")

    @model_validator(mode="after")
    def _sweep(self) -> TemperatureTruth:
        if self.points and "start_c" in self.model_fields_set:
            raise ValueError("start_c and points both set the chamber's temperature; leave one of them out")
        times = [time for time, _ in self.points]
        if times != sorted(set(times)) or len(times) == 1:
            raise ValueError("points: at least two, (s, °C) each, in order of time")
        return self


class Fault(StrictModel):
    """Something wrong with one gyro from `start` to `stop` (s; null: the end of the recording).

    drift    the bias grows linearly from 0 at start to `size` deg/s at stop
    step     `size` deg/s is added
    burst    white noise of `size` deg/s a sample is added
    noise    the white noise is `size` times as large
    scale    the sensitivity changes by the ratio `size`
    stuck    the count before start is repeated
    dropout  the count is 0
    """

    kind: FaultKind
    gyro: str
    start: float = Field(ge=0)
    stop: float | None = None
    size: float | None = None

    @model_validator(mode="after")
    def _complete(self) -> Fault:
        if self.stop is not None and self.stop <= self.start:
            raise ValueError(f"stop = {self.stop} s is not after start = {self.start} s")
        if (self.kind in SIZED) != (self.size is not None):
            need = "needs a size" if self.kind in SIZED else "takes no size"
            raise ValueError(f"a fault of kind {self.kind} {need}")
        return self


class LineDamage(StrictModel):
    """What the serial line does to a dump."""

    leading_bytes: int = Field(0, ge=0, description="garbage before the first frame")
    flips: int = Field(0, ge=0, description="single bits that are inverted")
    drops: int = Field(0, ge=0, description="places where 1 to 4 bytes are lost")
    insertions: int = Field(0, ge=0, description="places where 1 to 4 bytes appear")
    missing: tuple[tuple[float, float], ...] = Field((), description="[start, stop] in s without any frame")
    cut_tail: int = Field(0, ge=0, description="bytes missing at the end of the last frame")

    @field_validator("missing")
    @classmethod
    def _after_the_first_frame(cls, value: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        for start, stop in value:
            if not 0 < start < stop:
                raise ValueError(f"[{start}, {stop}] must begin after 0 and end after its begin")
        return value


class Rest(StrictModel):
    kind: Literal["rest"] = "rest"


class ConstantRate(StrictModel):
    kind: Literal["constant"]
    rate: float = Field(description="deg/s")


class Sinusoid(StrictModel):
    """rate = amplitude · sin(2π·frequency·t + phase)"""

    kind: Literal["sinusoid"]
    amplitude: float = Field(gt=0, description="deg/s")
    frequency_hz: float = Field(gt=0)
    phase_rad: float = 0.0


class RandomRate(StrictModel):
    """Gaussian, its spectrum flat up to bandwidth_hz and zero above."""

    kind: Literal["random"]
    sd: float = Field(gt=0, description="deg/s")
    bandwidth_hz: float = Field(gt=0)


class RateTable(StrictModel):
    """One rate after another: the table moves smoothly for settle_s, then turns evenly for plateau_s."""

    kind: Literal["rate_table"]
    rates: tuple[float, ...] = Field(min_length=2, description="deg/s, in order")
    settle_s: float = Field(2.0, ge=0)
    plateau_s: float = Field(8.0, gt=0)


Motion = Annotated[Rest | ConstantRate | Sinusoid | RandomRate | RateTable, Field(discriminator="kind")]


class TwinRecording(StrictModel):
    """One recording to make. A key that is also a key of the twin overrides it here (`gyros` key by key)."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")
    kind: Kind
    duration_s: float | None = Field(None, gt=0, description="s; left out with a rate table, which gives it")
    rate_hz: float | None = Field(None, gt=0, description="null: the board's")
    motion: Motion = Rest()
    axis: str | None = Field(None, description="axis that turns; null: the board's only one")
    log_reference: bool = Field(False, description="true: the manifest points at the logged rate, not at its formula")
    counter_start: int = Field(0, ge=0, description="frame counter of the first frame")
    gyros: dict[str, GyroTruth] = Field(default={}, description="keys that differ here, as in the twin's `gyros`")
    faults: tuple[Fault, ...] = ()
    sensor_pole_hz: float | None = Field(None, gt=0)
    temperature: TemperatureTruth | None = None
    line: LineDamage | None = None

    @property
    def duration(self) -> float:
        """Length of the recording, s."""
        if isinstance(self.motion, RateTable):
            return len(self.motion.rates) * (self.motion.settle_s + self.motion.plateau_s)
        assert self.duration_s is not None
        return self.duration_s

    @model_validator(mode="after")
    def _one_length(self) -> TwinRecording:
        if isinstance(self.motion, RateTable) == (self.duration_s is not None):
            raise ValueError("give duration_s, except with a rate table, whose sequence has its own length")
        if isinstance(self.motion, RateTable) != (self.kind == "calibration"):
            raise ValueError("a calibration recording needs motion of kind rate_table, and no other kind takes it")
        if self.kind in {"static", "thermal"} and not isinstance(self.motion, Rest):
            raise ValueError(f"a {self.kind} recording stands still: leave motion out")
        return self


class Twin(StrictModel):
    """config/twins/<name>.yaml"""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")
    title: str = ""
    notes: str = Field("", description="where the figures come from; goes into the manifest")
    board: str = Field(description="name of a file in config/boards")
    seed: int = Field(ge=0)
    gyros: dict[str, GyroTruth] = Field(description="`all`, and single gyros: their keys go over those of `all`")
    correlation: Correlation = Field(0.0, description="of the white noise: one factor for every pair, or the matrix")
    slow_correlation: Correlation | None = Field(None, description="of flicker and random walk; null: the same")
    dcc: Dcc | None = None
    sensor_pole_hz: float | None = Field(None, gt=0, description="-3 dB frequency of a one-pole low-pass, Hz")
    temperature: TemperatureTruth = TemperatureTruth()
    line: LineDamage = LineDamage()
    latitude_deg: float | None = Field(
        None, ge=-90, le=90, description="the axis that turns is vertical; null: no Earth"
    )
    recordings: tuple[TwinRecording, ...] = Field(min_length=1)
    analysis: Analysis | None = Field(None, description="keys of config.yaml's `analysis` for the manifest")

    def recording(self, name: str) -> TwinRecording:
        """The recording of that name.  raises : ConfigError, with the names there are"""
        for recording in self.recordings:
            if recording.name == name:
                return recording
        known = [recording.name for recording in self.recordings]
        raise ConfigError(f"twin {self.name!r} has no recording {name!r}{did_you_mean(name, known)}")

    @model_validator(mode="after")
    def _consistent(self) -> Twin:
        names = [recording.name for recording in self.recordings]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two recordings are named {name!r}")
            if name in RESERVED:
                raise ValueError(f"no recording can be named {name!r}: results keep a folder of that name")
        for recording in self.recordings:
            for gyro in dict.fromkeys([*self.gyros, *recording.gyros]):
                _check_merged(self, recording, gyro)
        return self


def parse_twin(text: str, source: str) -> Twin:
    """Validate the text of a twin file.  raises : InvalidFile, with every mistake at once"""
    return parse_model(text, Twin, source, {PARTIAL: True})


def lasting(twin: Twin, hours: float) -> Twin:
    """The twin with recordings at rest (static, thermal) of so many hours.

    What happens in them keeps its place and its rate: faults, missing stretches and the sweep of the chamber are moved
    in proportion, and the line hits as many bytes an hour as before.
    """
    recordings = []
    for recording in twin.recordings:
        if recording.kind not in {"static", "thermal"}:
            recordings.append(recording)
            continue
        ratio = hours * 3600 / recording.duration
        line = line_of(twin, recording)
        hits = {name: round(getattr(line, name) * ratio) for name in ("flips", "drops", "insertions")}
        missing = tuple((start * ratio, stop * ratio) for start, stop in line.missing)
        faults = tuple(
            fault.model_copy(update={"start": fault.start * ratio, "stop": fault.stop and fault.stop * ratio})
            for fault in recording.faults
        )
        thermal = temperature_of(twin, recording)
        points = tuple((time * ratio, celsius) for time, celsius in thermal.points)
        changes = {
            "duration_s": hours * 3600,
            "faults": faults,
            "line": line.model_copy(update={**hits, "missing": missing}),
            "temperature": thermal.model_copy(update={"points": points}) if points else recording.temperature,
        }
        recordings.append(recording.model_copy(update=changes))
    return twin.model_copy(update={"recordings": tuple(recordings)})


def _check_merged(twin: Twin, recording: TwinRecording, gyro: str) -> None:
    """Each entry may be right, and what they say together wrong."""
    try:
        truth_of(twin, recording, gyro)
    except ValidationError as error:
        reason = str(error.errors()[0]["msg"]).removeprefix("Value error, ")
        raise ValueError(f"gyro {gyro!r} in recording {recording.name!r}: {reason}") from None


def truth_of(twin: Twin, recording: TwinRecording, gyro: str) -> GyroTruth:
    """The errors of one gyro in one recording: `all`, then the gyro, then the recording's own of both."""
    merged: dict[str, Any] = {}
    for gyros in (twin.gyros, recording.gyros):
        for name in (EVERY_GYRO, gyro):
            if name in gyros:
                merged = merge(merged, gyros[name].model_dump(exclude_unset=True))
    return GyroTruth.model_validate(merged)


def pole_of(twin: Twin, recording: TwinRecording) -> float | None:
    """The sensor's pole in this recording, Hz; None: none."""
    return recording.sensor_pole_hz if "sensor_pole_hz" in recording.model_fields_set else twin.sensor_pole_hz


def temperature_of(twin: Twin, recording: TwinRecording) -> TemperatureTruth:
    """The temperature in this recording."""
    return recording.temperature or twin.temperature


def line_of(twin: Twin, recording: TwinRecording) -> LineDamage:
    """What the line does to this recording."""
    return recording.line or twin.line

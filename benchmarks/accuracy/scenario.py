"""Scenarios as data: what is simulated, one YAML file each in scenarios/; `extends` names the one it differs from."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import Field, field_validator

from vgyro.validation import StrictModel, did_you_mean

FOLDER = Path(__file__).parent / "scenarios"
BASE = "base"
Part = Literal["motion", "rest"]
FaultSort = Literal["noise", "stuck", "burst", "zero", "constant", "adc_noise", "absurd", "copy"]


class Motion(StrictModel):
    """The true rate: first-order poles in a row, driven by white noise; a line beside it; or sparse.

    sd, pole_hz, poles : standard deviation deg/s, frequency Hz and number of the poles
    start_s, stop_s    : the board moves between these only, and rests before and after; None: throughout
    line_hz, line_rest, line : frequency of a vibration, Hz, and its amplitude at rest and in motion, deg/s
    """

    sd: float = Field(20.0, ge=0)
    pole_hz: float = Field(0.15, gt=0)
    poles: int = Field(3, ge=1, le=6)
    start_s: float | None = None
    stop_s: float | None = None
    line_hz: float = Field(5.0, gt=0)
    line_rest: float = Field(0.0, ge=0)
    line: float = Field(0.0, ge=0)


class Tails(StrictModel):
    """Noise that is not Gaussian, of the same variance but for the outliers.

    dof : degrees of freedom of Student's t; None: Gaussian;  share, factor : so many samples are so many times as large
    """

    dof: float | None = Field(None, gt=2)
    share: float = Field(0.0, ge=0, lt=1)
    factor: float = Field(10.0, ge=1)


class Group(StrictModel):
    """Gyros whose white noise has the correlation rho with one another."""

    gyros: tuple[int, ...]
    rho: float = Field(gt=-1, lt=1)


class Scale(StrictModel):
    """Scale factor errors, uniform between low and high, of random sign."""

    low: float = Field(0.01, ge=0, lt=1)
    high: float = Field(0.03, ge=0, lt=1)


class Bandwidth(StrictModel):
    """Low-passes and delays of the gyros.

    poles_hz   : one first-order pole a gyro, Hz;  late : samples by which each gyro is late
    motion     : the motion passes the pole, too; false: only the noise does
    oversample : samples made for one that is kept; 1: the pole is a filter at the output rate
    """

    poles_hz: tuple[float, ...]
    late: tuple[float, ...] = ()
    motion: bool = True
    oversample: int = Field(8, ge=1, le=64)


class Temperature(StrictModel):
    """A ramp over each recording, K, and what it does to the biases, deg/s/K, with a relative spread (1σ)."""

    ramp_k: float = 30.0
    per_k: float = 0.01
    spread: float = Field(0.1, ge=0)
    logged: bool = True


class Tilt(StrictModel):
    """Slow tilts in motion, two poles, degrees r.m.s., and the g-sensitivity, deg/s/g, with a relative spread (1σ)."""

    degrees: float = 30.0
    pole_hz: float = 0.02
    per_g: float = 0.1
    spread: float = Field(0.1, ge=0)


class Fault(StrictModel):
    """A fault of one gyro.

    gyro : from 0;  sort : noise (grows by `factor` over the stretch), stuck (repeats its last value), burst (`count`
    stretches of `seconds`, noise × factor), zero, constant (the value `size`, deg/s), adc_noise (noise of `size` deg/s
    a sample and no rate), absurd (one sample of `size`), copy (the same channel as gyro `of`)
    start_s, stop_s : stretch; None: from the beginning, to the end;  rest : also in the rest recording
    """

    gyro: int = Field(ge=0)
    sort: FaultSort
    start_s: float | None = None
    stop_s: float | None = None
    size: float = 0.0
    factor: float = 5.0
    count: int = Field(1, ge=1)
    seconds: float = 5.0
    of: int = 0
    rest: bool = False


class Gaps(StrictModel):
    """Stretches without samples, of lengths even in their logarithm, s."""

    count: int = Field(20, ge=1)
    shortest_s: float = 0.02
    longest_s: float = 5.0


class Volatility(StrictModel):
    """Noise whose covariance changes from second to second: DCC(1,1) with GARCH(1,1) margins of mean 1."""

    alpha: float = 0.1
    beta: float = 0.85
    a: float = 0.05
    b: float = 0.9
    rho: float = 0.2
    block_s: float = 1.0


class Fading(StrictModel):
    """Biases that wander faster at first: the walk's K is factor × as large, fading with the time constant, s."""

    factor: float = 10.0
    time_s: float = 100.0


class WarmUp(StrictModel):
    """A transient of each bias, s.d. deg/s, that dies out with the time constant, s."""

    sd: float = 0.2
    time_s: float = 200.0


class Scenario(StrictModel):
    """One scenario: all sizes of a simulated array, its rest recording and its motion.

    title       : what differs from the base;  extends : the scenario that it differs from
    arw, rrw    : white noise deg/s/√Hz (two-sided) and random walk deg/s/√s of each gyro;  bias_sd : deg/s
    rest_s      : length of the rest recording, s; 0: there is none;  motion_s : of the motion
    quantum     : step of the values, deg/s; 0: none;  from_zero : zero is a count in every gyro, else anything may be
    full_scale : range of each gyro, deg/s
    jitter      : the moments of the samples are off by as much as this share of the period, even
    declared_hz : pole that a data sheet gives for all gyros, Hz; None: nothing is declared
    score       : the recordings whose fused rate is judged
    oracle      : exact, where all that the oracle takes for granted holds; bound: it also knows what cannot be known
    kind        : of the motion recording, as a manifest would declare it
    excused     : gyros that may be called faulty without being so by these rules
    """

    name: str = ""
    title: str = ""
    extends: str = ""
    rate_hz: float = Field(50.0, gt=0)
    rest_s: float = Field(600.0, ge=0)
    motion_s: float = Field(900.0, gt=30)
    arw: tuple[float, ...] = (0.02, 0.03, 0.03, 0.035, 0.04, 0.025)
    rrw: float = Field(5e-4, ge=0)
    bias_sd: float = Field(0.05, ge=0)
    motion: Motion = Motion()
    tails: Tails | None = None
    groups: tuple[Group, ...] = ()
    scale: Scale | None = None
    bandwidth: Bandwidth | None = None
    temperature: Temperature | None = None
    tilt: Tilt | None = None
    quantum: float = Field(0.0, ge=0)
    from_zero: bool = False
    full_scale: tuple[float, ...] = ()
    faults: tuple[Fault, ...] = ()
    gaps: Gaps | None = None
    jitter: float = Field(0.0, ge=0, lt=0.5)
    volatility: Volatility | None = None
    fading: Fading | None = None
    warm_up: WarmUp | None = None
    declared_hz: float | None = Field(None, gt=0)
    score: tuple[Part, ...] = ("motion",)
    oracle: Literal["exact", "bound"] = "exact"
    kind: Literal["random", "free"] = "random"
    excused: tuple[int, ...] = ()

    @field_validator("arw")
    @classmethod
    def _two_or_more(cls, value: tuple[float, ...]) -> tuple[float, ...]:
        if len(value) < 2 or min(value) <= 0:
            raise ValueError("give two or more gyros, each with noise")
        return value

    @property
    def gyros(self) -> int:
        """N"""
        return len(self.arw)

    @property
    def oversample(self) -> int:
        """Samples that are made for one that is kept."""
        return self.bandwidth.oversample if self.bandwidth else 8 if self.jitter else 1

    def shorter(self, rest_s: float, motion_s: float) -> Scenario:
        """The same with recordings no longer than these, s; faults and gaps shrink with them."""
        rest, length = min(self.rest_s, rest_s), min(self.motion_s, motion_s)
        share = length / self.motion_s

        def scaled(seconds: float | None) -> float | None:
            return None if seconds is None else seconds * share

        faults = tuple(
            one.model_copy(
                update={
                    "start_s": scaled(one.start_s),
                    "stop_s": scaled(one.stop_s),
                    "count": math.ceil(one.count * share),
                }
            )
            for one in self.faults
        )
        motion = self.motion.model_copy(
            update={"start_s": scaled(self.motion.start_s), "stop_s": scaled(self.motion.stop_s)}
        )
        gaps = self.gaps and self.gaps.model_copy(update={"count": math.ceil(self.gaps.count * share)})
        short = {"rest_s": rest, "motion_s": length, "faults": faults, "motion": motion, "gaps": gaps}
        return self.model_copy(update=short)


def names() -> list[str]:
    """All scenarios but the base, in the order of scenarios/order.yaml."""
    return list(yaml.safe_load((FOLDER / "order.yaml").read_text(encoding="utf-8")))


def load(name: str) -> Scenario:
    """A scenario by name.  raises : KeyError, with the nearest name; pydantic's error for a wrong file"""
    if not (FOLDER / f"{name}.yaml").is_file():
        raise KeyError(f"no scenario {name!r}{did_you_mean(name, names())}")
    return Scenario.model_validate({**_merged(name), "name": name})


def _merged(name: str) -> dict[str, Any]:
    """The keys of a file over those of what it extends; of a nested group, too."""
    own = yaml.safe_load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8")) or {}
    parent = own.get("extends")
    return _over(_merged(parent), own) if parent else own


def _over(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    merged = dict(below)
    for key, value in above.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _over(merged[key], value) if both else value
    return merged

"""The registry: a fusion method is one entry here."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vgyro.errors import ConfigError, VgyroError
from vgyro.fusion import operation_counts
from vgyro.fusion.baselines import fixed, moments
from vgyro.fusion.ours import frequency_weights, parity_weights, recommended, smoothed
from vgyro.fusion.packages import methods_of_packages
from vgyro.fusion.papers import (
    al_majed,
    bayard_ploen,
    chang_2008,
    rate_filters,
    scale_wise,
    stubberud,
    vaccaro_zaki,
    waegli_guerrier,
)
from vgyro.fusion.papers.conditional import SAME_AT_ANY_RATE, conditional
from vgyro.fusion.types import ArrayRates, CannotRun, FilterParameters, Fused, Method
from vgyro.fusion.unusable import on_usable
from vgyro.validation import did_you_mean

LIU = "Liu et al. (2015), eq. 15-17"
JIANG = "Jiang et al. (2012), eq. 11-14"
XUE = "Xue et al. (2012), Measurement 45, 745-754"
CHANG = "Chang et al. (2012), IEEE Trans. Instrum. Meas. 61, 3084-3093"
STUBBERUD = "Stubberud & Stubberud (2008), 19th Int. Conf. Systems Engineering, 13-18"
AL_MAJED = "Al-Majed & Alsuwaidan (2009), IEEE/ASME Conf. Advanced Intelligent Mechatronics, 1318-1323"
OWN = "vgyro, docs/fusion.md"


def _conditional(model: str, mode: str, source: str) -> Method:
    """The entry of CCC or DCC weights; in-sample weights know the rest of their window."""
    title = f"{model.upper()} weights, {mode.replace('_', '-')}"
    causal = mode == "causal"
    return Method(
        f"{model}_{mode}", title, source, causal, ("weights",), conditional(model, mode),
        per_definition=True, same_at_any_rate=SAME_AT_ANY_RATE, operations=operation_counts.weighted,
    )  # fmt: skip


_FIXED = {"": "Σw = 1, fixed weights"}
_UNIT_GAIN = {"": "Σw = 1, fixed weights, DC gain 1"}
_BANK = {"": "all members start at the mean; p depends on innovations only; Σp = 1"}
_MEDIAN = {"": "the median moves with the gyros"}
_PARITY = {"": "Σw = 1, and only differences between the gyros are looked at"}
_SMOOTHED = {"": "Σw = 1, only differences between the gyros are looked at, and the smoother's DC gain is 1"}

# fmt: off
_BASELINES = (
    Method("average", "Average", "baseline", True, (), fixed.average, same_at_any_rate=_FIXED,
           family="baseline", operations=operation_counts.weighted),
    Method("median", "Median", "baseline", True, (), fixed.median, same_at_any_rate=_MEDIAN,
           family="baseline", operations=operation_counts.sorted_median),
    Method("inverse_variance_arw", "Inverse variance, ARW", "w ∝ 1/N²", True, ("arw",),
           on_usable(fixed.inverse_variance_arw),
           same_at_any_rate=_FIXED, family="baseline", operations=operation_counts.weighted),
    Method("inverse_variance_rrw", "Inverse variance, RRW", "w ∝ 1/K²", True, ("rrw",),
           on_usable(fixed.inverse_variance_rrw, needs_arw=False),
           same_at_any_rate=_FIXED, family="baseline", operations=operation_counts.weighted),
    Method("rolling_moment", "Rolling second moment", "w ∝ 1/m²", True, (), moments.rolling_moment,
           family="baseline", operations=operation_counts.moments),
    Method("ewma_causal", "EWMA second moment, causal", "w ∝ 1/m²", True, (), moments.ewma_causal,
           family="baseline", operations=operation_counts.moments),
    Method("ewma_two_sided", "EWMA second moment, two-sided", "w ∝ 1/m²", False, (), moments.ewma_two_sided,
           family="baseline", operations=operation_counts.moments),
    Method("average_smoothed", "Average, smoothed", OWN, False, (), smoothed.average_smoothed,
           same_at_any_rate=_SMOOTHED, family="baseline", operations=operation_counts.smoothed_average),
    Method("median_smoothed", "Median, smoothed", OWN, False, (), smoothed.median_smoothed,
           same_at_any_rate=_SMOOTHED, family="baseline", operations=operation_counts.smoothed_median),
)
_PAPERS = (
    Method("bayard_ploen", "Bayard & Ploen 2003, parity form", bayard_ploen.SOURCE, True, ("arw", "rrw", "correlation"),
           on_usable(bayard_ploen.bayard_ploen), same_at_any_rate=bayard_ploen.SAME_AT_ANY_RATE,
           operations=bayard_ploen.operations, inferred=bayard_ploen.INFERRED),
    Method("chang_2008", "Chang 2008, level 1", chang_2008.SOURCE, True, ("arw", "rrw", "correlation"),
           on_usable(chang_2008.chang_2008), operations=chang_2008.operations, inferred=chang_2008.INFERRED),
    Method("stubberud_2008", "Stubberud 2008, EKF of scale and bias", STUBBERUD, True, ("arw", "rrw"),
           on_usable(stubberud.stubberud_2008), operations=stubberud.operations, inferred=stubberud.INFERRED),
    Method("al_majed", "Al-Majed 2009, adaptive bank", AL_MAJED, True, ("arw",), on_usable(al_majed.al_majed),
           same_at_any_rate=_BANK, operations=al_majed.operations, inferred=al_majed.INFERRED),
    Method("jiang_markov", "Jiang 2012, Markov rate", JIANG, True, ("arw",), on_usable(rate_filters.jiang_markov),
           operations=operation_counts.low_passed),
    Method("jiang_random_walk", "Jiang 2012, random walk", f"{JIANG}, 1/τ → 0", True, ("arw",),
           on_usable(rate_filters.jiang_random_walk), same_at_any_rate=_UNIT_GAIN,
           operations=operation_counts.low_passed),
    Method("xue_2012", "Xue 2012, analytic covariance", XUE, True, ("arw",), on_usable(rate_filters.xue_2012),
           same_at_any_rate=_UNIT_GAIN, operations=operation_counts.settling, inferred="P0 = 1/(D·T)"),
    Method("chang_2012", "Chang 2012, q from bandwidth", CHANG, True, ("arw",), on_usable(rate_filters.chang_2012),
           same_at_any_rate=_UNIT_GAIN, operations=operation_counts.low_passed),
    _conditional("ccc", "in_sample", f"{LIU}, a = b = 0"),
    _conditional("ccc", "causal", f"{LIU}, a = b = 0, carried forward"),
    _conditional("dcc", "in_sample", LIU),
    _conditional("dcc", "causal", f"{LIU}, carried forward"),
    Method("waegli_guerrier", "Waegli/Guerrier, ARMA-GARCH of the residual", waegli_guerrier.SOURCE, False, (),
           waegli_guerrier.waegli_guerrier, same_at_any_rate=waegli_guerrier.SAME_AT_ANY_RATE,
           operations=waegli_guerrier.operations, inferred=waegli_guerrier.INFERRED),
    Method("vaccaro_zaki", "Vaccaro & Zaki 2017, least drift", vaccaro_zaki.SOURCE, True, ("scales",),
           on_usable(vaccaro_zaki.vaccaro_zaki, needs_arw=False), same_at_any_rate=_FIXED,
           operations=operation_counts.weighted, inferred=vaccaro_zaki.INFERRED),
    Method("scale_wise_all", "Zhang 2022, all scales alike", scale_wise.SOURCE, True, ("scales",),
           on_usable(scale_wise.scale_wise_all, needs_arw=False), same_at_any_rate=_FIXED,
           operations=operation_counts.weighted, inferred=scale_wise.INFERRED_ALL),
    Method("scale_wise_large", "Zhang 2022, large scales", scale_wise.SOURCE, True, ("scales",),
           on_usable(scale_wise.scale_wise_large, needs_arw=False), same_at_any_rate=_FIXED,
           operations=operation_counts.weighted, inferred=scale_wise.INFERRED_LARGE),
)
_OURS = (
    Method("parity_weights", "Parity variances", OWN, False, (), parity_weights.parity_weights,
           same_at_any_rate=_PARITY, family="ours", operations=operation_counts.residuals),
    Method("residual_weights", "Changing parity variances", OWN, False, (), parity_weights.residual_weights,
           same_at_any_rate=_PARITY, family="ours", operations=operation_counts.changing_residuals),
    Method("frequency_weights", "Weights of each frequency", OWN, False, ("arw",),
           on_usable(frequency_weights.frequency_weights),
           same_at_any_rate=_PARITY, family="ours", operations=operation_counts.without_slow),
    Method("parity_smoothed", "Parity variances, smoothed", OWN, False, (), smoothed.parity_smoothed,
           same_at_any_rate=_SMOOTHED, family="ours", operations=operation_counts.smoothed_average),
    Method("residual_smoothed", "Changing parity variances, smoothed", OWN, False, (), smoothed.residual_smoothed,
           same_at_any_rate=_SMOOTHED, family="ours", operations=operation_counts.smoothed_residuals),
    Method("dcc_smoothed", "DCC of the residual, smoothed", f"{OWN}; {LIU}", False, ("weights",),
           smoothed.dcc_smoothed, same_at_any_rate=_SMOOTHED, family="ours",
           operations=operation_counts.smoothed_average),
    Method("recommended_unsmoothed", "Recommended, not smoothed", OWN, False, (), recommended.recommended_unsmoothed,
           same_at_any_rate=_PARITY, family="ours", operations=operation_counts.everything),
    Method("recommended", "Recommended", OWN, False, (), recommended.recommended,
           same_at_any_rate=_SMOOTHED, family="ours", operations=operation_counts.everything_smoothed),
)
_ALL = (*_BASELINES, *_PAPERS, *_OURS)
# fmt: on

METHODS: dict[str, Method] = {method.name: method for method in _ALL}

LEFT_OUT: list[str] = []
"""What other packages bring and cannot be used, and why: a line each."""


State = Literal["ran", "cannot run", "failed"]
LONGEST_REASON = 300


@dataclass(frozen=True)
class Outcome:
    """One method, for one definition of r_t where it has them: what came out, or why nothing did.

    column : name of its column, dcc_causal[level]; empty where it could not run
    failed : it ended with an error, and did not find by itself that it cannot run
    """

    method: Method
    definition: str
    column: str
    fused: Fused | None
    note: str
    failed: bool = False

    @property
    def state(self) -> State:
        """What became of it."""
        return "ran" if self.fused is not None else "failed" if self.failed else "cannot run"


def select(names: Sequence[str] | Literal["all"]) -> list[Method]:
    """Methods by name, in the registry's order.  raises : ConfigError, with the nearest name"""
    if names == "all":
        return list(METHODS.values())
    for name in names:
        if name not in METHODS:
            raise ConfigError(f"unknown method {name!r}{did_you_mean(name, list(METHODS))}", "analysis.fusion.methods")
    return [method for method in METHODS.values() if method.name in names]


def run_methods(
    array: ArrayRates,
    parameters: FilterParameters,
    methods: Sequence[Method],
    definitions: Sequence[str],
    moved: bool = False,
) -> Iterator[Outcome]:
    """Run `methods`, those with weights once for each definition of r_t, one after the other.

    A method that cannot run, fails, or whose rate is not finite gives an Outcome without a rate and with the reason;
    the others go on. Why it failed is in the log, with the traceback. A method cannot write into the rates.
    An array of one gyro has nothing to fuse: no method runs.
    moved : a constant rate was added; only what may answer to that is run
    """
    reason = _reason_against_all(array)
    for method in methods:
        for definition in definitions if method.per_definition else ("",):
            if moved and definition in method.same_at_any_rate:
                continue
            if reason:
                yield Outcome(method, definition, "", None, reason)
            else:
                yield _run(array, replace(parameters, definition=definition), method)


def _reason_against_all(array: ArrayRates) -> str:
    """Why no method can run on these rates; empty if some can."""
    if array.rate.shape[1] < 2:
        return "one gyro: there is nothing to fuse"
    finite = np.ones(len(array.rate), dtype=bool)
    for column in array.rate.T:
        finite &= np.isfinite(column)
    return _not_finite(finite)


def _not_finite(finite: np.ndarray) -> str:
    return "" if finite.all() else f"{int((~finite).sum())} of {len(finite)} samples are not finite"


def _run(array: ArrayRates, parameters: FilterParameters, method: Method) -> Outcome:
    definition = parameters.definition
    try:
        with _read_only(array.rate):
            fused = _checked(method.fuse(array, parameters), len(array.rate))
    except CannotRun as reason:
        return Outcome(method, definition, "", None, str(reason))
    except (Exception, SystemExit) as error:
        # A bug, of ours or of another package, or data nobody thought of: that ends this method, never the job.
        logging.exception("%s failed", method.name)
        return Outcome(method, definition, "", None, failure(method, error), failed=True)
    broken = _not_finite(np.isfinite(fused.rate))
    if broken:
        note = f"failed: of its rate {broken}"
        logging.error("%s %s", method.name, note)
        return Outcome(method, definition, "", None, note, failed=True)
    column = f"{method.name}[{definition}]" if definition else method.name
    return Outcome(method, definition, column, fused, fused.note)


def failure(method: Method, error: BaseException) -> str:
    """That a method failed, and why, in one line. An error of another kind than VgyroError is a bug, and called so."""
    reason = str(error).partition("\n")[0][:LONGEST_REASON].rstrip(". ")
    if isinstance(error, VgyroError) and not method.package:
        return f"failed: {reason}"
    whose = f"package {method.package}" if method.package else "vgyro"
    said = f"{type(error).__name__}: {reason}" if reason else type(error).__name__
    return f"failed: {said} (a bug in {whose}; the traceback is in the log)"


def _checked(fused: Fused, samples: int) -> Fused:
    """What a method returned, if it is a rate [samples].  raises : TypeError, ValueError if not"""
    if not isinstance(fused, Fused):
        raise TypeError(f"it returned {type(fused).__name__}, not Fused")
    for name, values in (("rate", fused.rate), ("sd", fused.sd)):
        if values is None and name == "sd":
            continue
        if not isinstance(values, np.ndarray) or values.shape != (samples,) or values.dtype.kind != "f":
            raise ValueError(f"its {name} is no array [{samples}] of real numbers")
    return fused


@contextmanager
def _read_only(rate: np.ndarray) -> Iterator[None]:
    """The methods share the rates: while one runs it cannot change them for the others."""
    writeable = rate.flags.writeable
    rate.flags.writeable = False
    try:
        yield
    finally:
        rate.flags.writeable = writeable


def _join_packages() -> None:
    """Methods of other packages, after our own; one line a package that cannot be used."""
    found, problems = methods_of_packages(METHODS)
    METHODS.update({method.name: method for method in found})
    LEFT_OUT.extend(problems)
    for problem in problems:
        logging.getLogger(__name__).warning(problem)


_join_packages()

"""The registry: a fusion method is one entry here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vgyro.errors import ConfigError
from vgyro.fusion import filters, fixed, moments
from vgyro.fusion.array import ArrayRates, CannotRun, FilterParameters, Fused, Method
from vgyro.fusion.conditional import SAME_AT_ANY_RATE, conditional
from vgyro.validation import did_you_mean

LIU = "Liu et al. (2015), eq. 15-17"
JIANG = "Jiang et al. (2012), eq. 11-14"
XUE = "Xue et al. (2012), Measurement 45, 745-754"
CHANG = "Chang et al. (2012), IEEE Trans. Instrum. Meas. 61, 3084-3093"


def _conditional(model: str, mode: str, source: str) -> Method:
    """The entry of CCC or DCC weights; in-sample weights know the rest of their window."""
    title = f"{model.upper()} weights, {mode.replace('_', '-')}"
    causal = mode == "causal"
    return Method(
        f"{model}_{mode}", title, source, causal, ("weights",), conditional(model, mode),
        per_definition=True, same_at_any_rate=SAME_AT_ANY_RATE,
    )  # fmt: skip


_FIXED = {"": "Σw = 1, fixed weights"}
_UNIT_GAIN = {"": "Σw = 1, fixed weights, DC gain 1"}
_MEDIAN = {"": "the median moves with the gyros"}

# fmt: off
_ALL = (
    Method("average", "Average", "baseline", True, (), fixed.average, same_at_any_rate=_FIXED),
    Method("median", "Median", "baseline", True, (), fixed.median, same_at_any_rate=_MEDIAN),
    Method("inverse_variance_arw", "Inverse variance, ARW", "w ∝ 1/N²", True, ("arw",), fixed.inverse_variance_arw,
           same_at_any_rate=_FIXED),
    Method("inverse_variance_rrw", "Inverse variance, RRW", "w ∝ 1/K²", True, ("rrw",), fixed.inverse_variance_rrw,
           same_at_any_rate=_FIXED),
    Method("rolling_moment", "Rolling second moment", "w ∝ 1/m²", True, (), moments.rolling_moment),
    Method("ewma_causal", "EWMA second moment, causal", "w ∝ 1/m²", True, (), moments.ewma_causal),
    Method("ewma_two_sided", "EWMA second moment, two-sided", "w ∝ 1/m²", False, (), moments.ewma_two_sided),
    Method("jiang_markov", "Jiang 2012, Markov rate", JIANG, True, ("arw",), filters.jiang_markov),
    Method("jiang_random_walk", "Jiang 2012, random walk", f"{JIANG}, 1/τ → 0", True, ("arw",),
           filters.jiang_random_walk, same_at_any_rate=_UNIT_GAIN),
    Method("xue_2012", "Xue 2012, analytic covariance", XUE, True, ("arw",), filters.xue_2012,
           same_at_any_rate=_UNIT_GAIN),
    Method("chang_2012", "Chang 2012, q from bandwidth", CHANG, True, ("arw",), filters.chang_2012,
           same_at_any_rate=_UNIT_GAIN),
    _conditional("ccc", "in_sample", f"{LIU}, a = b = 0"),
    _conditional("ccc", "causal", f"{LIU}, a = b = 0, carried forward"),
    _conditional("dcc", "in_sample", LIU),
    _conditional("dcc", "causal", f"{LIU}, carried forward"),
)
# fmt: on

METHODS: dict[str, Method] = {method.name: method for method in _ALL}


@dataclass(frozen=True)
class Outcome:
    """One method, for one definition of r_t where it has them: what came out, or why nothing did.

    column : name of its column, dcc_causal[level]; empty where it could not run
    """

    method: Method
    definition: str
    column: str
    fused: Fused | None
    note: str


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

    A method that cannot run, or whose rate is not finite, gives an Outcome without a rate and with the reason.
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
        fused = method.fuse(array, parameters)
    except CannotRun as reason:
        return Outcome(method, definition, "", None, str(reason))
    broken = _not_finite(np.isfinite(fused.rate))
    if broken:
        return Outcome(method, definition, "", None, broken)
    column = f"{method.name}[{definition}]" if definition else method.name
    return Outcome(method, definition, column, fused, fused.note)

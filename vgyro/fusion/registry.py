"""The registry: a fusion method is one entry here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vgyro.errors import ConfigError
from vgyro.fusion import filters, fixed, moments
from vgyro.fusion.array import ArrayRates, CannotRun, FilterParameters, Fused, Method
from vgyro.fusion.conditional import conditional
from vgyro.validation import did_you_mean

LIU = "Liu et al. (2015), eq. 15-17"
JIANG = "Jiang et al. (2012), eq. 11-14"
WEIGHTS = ("weights",)

_ALL = (
    Method("average", "Average", "baseline", True, (), fixed.average),
    Method("median", "Median", "baseline", True, (), fixed.median),
    Method(
        "inverse_variance_arw", "Inverse variance, angle random walk", "baseline: w ∝ 1/N²", False, ("arw",),
        fixed.inverse_variance_arw,
    ),
    Method(
        "inverse_variance_rrw", "Inverse variance, rate random walk", "baseline: w ∝ 1/K²", False, ("rrw",),
        fixed.inverse_variance_rrw,
    ),
    Method("rolling_moment", "Rolling second moment", "baseline: w ∝ 1/m²", True, (), moments.rolling_moment),
    Method("ewma_causal", "EWMA second moment, causal", "baseline: w ∝ 1/m²", True, (), moments.ewma_causal),
    Method("ewma_two_sided", "EWMA second moment, two-sided", "baseline: w ∝ 1/m²", False, (), moments.ewma_two_sided),
    Method("jiang_markov", "Jiang 2012, Markov rate", JIANG, True, ("arw",), filters.jiang_markov),
    Method(
        "jiang_random_walk", "Jiang 2012, random-walk rate", f"{JIANG} with 1/τ → 0", True, ("arw",),
        filters.jiang_random_walk,
    ),
    Method(
        "xue_2012", "Xue 2012, analytic covariance", "Xue et al. (2012), Measurement 45, 745-754", True, ("arw",),
        filters.xue_2012,
    ),
    Method(
        "chang_2012", "Chang 2012, q from the bandwidth", "Chang et al. (2012), IEEE Trans. Instrum. Meas. 61, 3084-3093",
        True, ("arw",), filters.chang_2012,
    ),
    Method("ccc_in_sample", "CCC weights, in-sample", f"{LIU}, with a = b = 0", False, WEIGHTS, conditional("ccc", "in_sample"), True),
    Method("ccc_causal", "CCC weights, causal", f"{LIU}, with a = b = 0, carried forward", True, WEIGHTS, conditional("ccc", "causal"), True),
    Method("dcc_in_sample", "DCC weights, in-sample", LIU, False, WEIGHTS, conditional("dcc", "in_sample"), True),
    Method("dcc_causal", "DCC weights, causal", f"{LIU}, carried forward", True, WEIGHTS, conditional("dcc", "causal"), True),
)  # fmt: skip

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
    array: ArrayRates, parameters: FilterParameters, methods: Sequence[Method], definitions: Sequence[str]
) -> Iterator[Outcome]:
    """Run `methods`, those with weights once for each definition of r_t, one after the other.

    A method that cannot run, or whose rate is not finite, gives an Outcome without a rate and with the reason.
    An array of one gyro has nothing to fuse: no method runs.
    """
    for method in methods:
        for definition in definitions if method.per_definition else ("",):
            yield _run(array, replace(parameters, definition=definition), method)


def _run(array: ArrayRates, parameters: FilterParameters, method: Method) -> Outcome:
    definition = parameters.definition
    if array.rate.shape[1] < 2:
        return Outcome(method, definition, "", None, "one gyro: there is nothing to fuse")
    try:
        fused = method.fuse(array, parameters)
    except CannotRun as reason:
        return Outcome(method, definition, "", None, str(reason))
    broken = int((~np.isfinite(fused.rate)).sum())
    if broken:
        return Outcome(method, definition, "", None, f"{broken} of {len(fused.rate)} samples are not finite")
    column = f"{method.name}[{definition}]" if definition else method.name
    return Outcome(method, definition, column, fused, fused.note)

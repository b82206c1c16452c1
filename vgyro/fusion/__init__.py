"""Fusion of an array into one rate: weights, filters, and the registry of methods."""

from typing import TYPE_CHECKING

from vgyro.lazy import lazy_exports

if TYPE_CHECKING:
    from vgyro.fusion.blocks import SampleWeights, block_of_sample
    from vgyro.fusion.registry import METHODS, Outcome, run_methods, select
    from vgyro.fusion.response import Response, measured_response
    from vgyro.fusion.types import ArrayNoise, ArrayRates, CannotRun, FilterParameters, Fused, Method
    from vgyro.fusion.weights import min_variance_weights, usable

__all__ = [
    "METHODS",
    "ArrayNoise",
    "ArrayRates",
    "CannotRun",
    "FilterParameters",
    "Fused",
    "Method",
    "Outcome",
    "Response",
    "SampleWeights",
    "block_of_sample",
    "measured_response",
    "min_variance_weights",
    "run_methods",
    "select",
    "usable",
]

_ARRAY = ("ArrayNoise", "ArrayRates", "CannotRun", "FilterParameters", "Fused", "Method")
_REGISTRY = ("METHODS", "Outcome", "run_methods", "select")
_BLOCKS = ("SampleWeights", "block_of_sample")
_RESPONSE = ("Response", "measured_response")
_WEIGHTS = ("min_variance_weights", "usable")

__getattr__ = lazy_exports(
    __name__,
    {
        **dict.fromkeys(_ARRAY, "types"),
        **dict.fromkeys(_BLOCKS, "blocks"),
        **dict.fromkeys(_REGISTRY, "registry"),
        **dict.fromkeys(_RESPONSE, "response"),
        **dict.fromkeys(_WEIGHTS, "weights"),
    },
)

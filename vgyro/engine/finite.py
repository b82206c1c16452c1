"""What every engine refuses alike: values that are not finite."""

from __future__ import annotations

import numpy as np

from vgyro.errors import EngineError


def refuse_broken(name: str, values: np.ndarray) -> None:
    """raises : EngineError that names the first sample of values [T, ...] that is not finite"""
    broken = ~np.isfinite(values).all(axis=tuple(range(1, np.ndim(values))))
    if broken.any():
        raise EngineError(
            f"the {name} is not finite",
            f"sample {int(np.argmax(broken))}",
            "leave out such samples, or start anew there",
        )


def not_positive_definite(sample: int) -> EngineError:
    """The error for a noise covariance that no filter can use."""
    return EngineError(
        "the noise covariance R is not positive definite",
        f"sample {sample}",
        "look for gyros that are copies of each other, or for a variance of zero",
    )

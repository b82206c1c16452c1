"""Types of arrays, by their elements: `np.ndarray` in an annotation leaves these open."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

# Of any width: rates are stored in float32 or float64; NumPy's own places are intp, counts of samples are int64.
Floats: TypeAlias = NDArray[np.floating[Any]]
Ints: TypeAlias = NDArray[np.integer[Any]]
Bools: TypeAlias = NDArray[np.bool_]

"""What one core can do at most: the yardstick beside every time. The counting is in docs/performance.md.

The core is a plain x86-64 one with AVX2: two operations on vectors of four doubles a cycle, without fused
multiply-add (which would change the bits), a division of such a vector in five cycles, at 3 GHz; 10 GB/s of memory.
"""

from __future__ import annotations

HERTZ = 3e9
FLOPS = 8 * HERTZ
DIVISIONS = 4 / 5 * HERTZ
BYTES = 10e9


def arithmetic(flops: float = 0.0, divisions: float = 0.0, transferred: float = 0.0) -> float:
    """Seconds that so many operations and bytes take at least; units of the core work side by side."""
    return max(flops / FLOPS, divisions / DIVISIONS, transferred / BYTES)

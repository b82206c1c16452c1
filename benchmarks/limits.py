"""What one core can do at most: the yardstick beside every time. The counting is in docs/performance.md.

A generous core of today's x86-64 with AVX2, which none surpasses without fused multiply-add (that would change the
bits) or wider vectors: two additions and two multiplications of vectors of four doubles a cycle, a division of such a
vector in four cycles, at 4 GHz; 20 GB/s of memory.
"""

from __future__ import annotations

HERTZ = 4e9
FLOPS = 16 * HERTZ
DIVISIONS = HERTZ
BYTES = 20e9


def arithmetic(flops: float = 0.0, divisions: float = 0.0, transferred: float = 0.0) -> float:
    """Seconds that so many operations and bytes take at least; units of the core work side by side."""
    return max(flops / FLOPS, divisions / DIVISIONS, transferred / BYTES)

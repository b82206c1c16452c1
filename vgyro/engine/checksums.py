"""A CRC as tables: what every byte at every place of a message adds to it.

A CRC is affine over GF(2): the CRC of a message is that of as many zeros, XOR the contribution of each byte at its
place. With one table of 256 a place, the loop over the bytes has no step that waits for the one before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vgyro.arrays import Ints

if TYPE_CHECKING:
    from vgyro.board import Checksum

WIDTHS = {8: np.uint8, 16: np.uint16, 32: np.uint32}


def crc_tables(rule: Checksum, length: int) -> tuple[int, np.ndarray]:
    """CRC of `length` zeros, and the contribution of every byte value at every place: uint [length, 256].

    Padding, initial value and final XOR of the rule are in them.
    """
    table = _byte_table(rule)
    padding = -length % rule.pad_to
    register = _reversed_bits(rule.init, rule.width) if rule.reflected else rule.init
    for _ in range(length + padding):
        register = int(_advance(np.array([register], dtype=np.uint64), table, rule)[0])
    current = table
    for _ in range(padding):
        current = _advance(current, table, rule)
    tables = np.empty((length, 256), dtype=WIDTHS[rule.width])
    for place in range(length - 1, -1, -1):
        tables[place] = current
        current = _advance(current, table, rule)
    return register ^ rule.xor_out, tables


def mask(width: int) -> int:
    """So many ones."""
    return (1 << width) - 1


def _byte_table(rule: Checksum) -> np.ndarray:
    """CRC register after one byte from a register of zero, uint64 [256]."""
    ones, top = mask(rule.width), 1 << (rule.width - 1)
    polynomial = _reversed_bits(rule.polynomial, rule.width) if rule.reflected else rule.polynomial
    table = []
    for byte in range(256):
        register = byte if rule.reflected else byte << (rule.width - 8)
        for _ in range(8):
            if rule.reflected:
                register = (register >> 1) ^ (polynomial if register & 1 else 0)
            else:
                register = ((register << 1) & ones) ^ (polynomial if register & top else 0)
        table.append(register)
    return np.array(table, dtype=np.uint64)


def _advance(register: Ints, table: Ints, rule: Checksum) -> Ints:
    """Registers after one more zero byte, uint64 [n]."""
    if rule.reflected:
        return (register >> np.uint64(8)) ^ table[(register & np.uint64(0xFF)).astype(np.intp)]
    rest = (register << np.uint64(8)) & np.uint64(mask(rule.width))
    return rest ^ table[(register >> np.uint64(rule.width - 8)).astype(np.intp)]


def _reversed_bits(value: int, width: int) -> int:
    return int(format(value, f"0{width}b")[::-1], 2)

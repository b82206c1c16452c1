"""Checksums of many frames at once: CRC of any width and byte sums over the rows of a byte matrix."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vgyro.board import BinaryFrame, ByteOrder, Checksum

Verifier = Callable[[np.ndarray, np.ndarray], np.ndarray]


def checksum(data: np.ndarray, rule: Checksum) -> np.ndarray:
    """Checksum of each row of `data`.

    data    : uint8 [n, m], the covered bytes alone; the rule's padding is added here
    returns : uint64 [n]
    A CRC is affine over GF(2): the CRC of a message is that of as many zeros, XOR the contribution of each byte at its
    place. One table of 256 a place turns the loop over bytes into m look-ups of whole columns.
    """
    if rule.family == "sum":
        return data.sum(axis=1, dtype=np.uint64) & np.uint64(_mask(rule.width))
    if rule.family != "crc":
        raise ValueError(f"a {rule.family} checksum is not one of binary frames")
    zeros, tables = _crc_tables(rule, data.shape[1])
    result = np.full(len(data), zeros, tables.dtype)
    for place, table in enumerate(tables):
        result ^= table[data[:, place]]
    return result.astype(np.uint64)


def verifier(frame: BinaryFrame) -> Verifier:
    """Return a function: buffer uint8 [m], places int64 [n] → bool [n], true where a frame that begins there is right.

    Nothing is copied out of the buffer, so that a stretch that is all sync bytes costs no memory.
    """
    rule = frame.checksum
    if rule.family == "none" or rule.span is None:
        return lambda _buffer, places: np.ones(len(places), dtype=bool)
    first, last = rule.span
    order = rule.byte_order or frame.byte_order
    if rule.family == "crc":
        # Made once: building the tables for every chunk would cost more than using them.
        zeros, tables = _crc_tables(rule, last - first)

    def verify(buffer: np.ndarray, places: np.ndarray) -> np.ndarray:
        if rule.family == "crc":
            found = np.full(len(places), zeros, tables.dtype)
            for offset, table in enumerate(tables, first):
                found ^= table[buffer[places + offset]]
        else:
            total = np.insert(np.cumsum(buffer, dtype=np.uint64), 0, np.uint64(0))
            found = (total[places + last] - total[places + first]) & np.uint64(_mask(rule.width))
        if rule.at is None:
            return found == rule.equals
        return found == stored_value(buffer, places + rule.at, rule.width // 8, order)

    return verify


def stored_value(buffer: np.ndarray, places: np.ndarray, size: int, order: ByteOrder) -> np.ndarray:
    """Unsigned integer of `size` bytes that begins at each place of the buffer, uint64 [n]."""
    value = np.zeros(len(places), dtype=np.uint64)
    for offset in range(size) if order == "big" else range(size - 1, -1, -1):
        value = (value << np.uint64(8)) | buffer[places + offset]
    return value


def _mask(width: int) -> int:
    return (1 << width) - 1


def _crc_tables(rule: Checksum, length: int) -> tuple[int, np.ndarray]:
    """CRC of `length` zeros, and the contribution of every byte value at every place: uint [length, 256]."""
    dtype = {8: np.uint8, 16: np.uint16, 32: np.uint32}[rule.width]
    table = _byte_table(rule)
    padding = -length % rule.pad_to
    register = _reversed_bits(rule.init, rule.width) if rule.reflected else rule.init
    for _ in range(length + padding):
        register = int(_advance(np.array([register], dtype=np.uint64), table, rule)[0])
    current = table
    for _ in range(padding):
        current = _advance(current, table, rule)
    tables = np.empty((length, 256), dtype=dtype)
    for place in range(length - 1, -1, -1):
        tables[place] = current
        current = _advance(current, table, rule)
    return register ^ rule.xor_out, tables


def _byte_table(rule: Checksum) -> np.ndarray:
    """CRC register after one byte from a register of zero, uint64 [256]."""
    mask, top = _mask(rule.width), 1 << (rule.width - 1)
    polynomial = _reversed_bits(rule.polynomial, rule.width) if rule.reflected else rule.polynomial
    table = []
    for byte in range(256):
        register = byte if rule.reflected else byte << (rule.width - 8)
        for _ in range(8):
            if rule.reflected:
                register = (register >> 1) ^ (polynomial if register & 1 else 0)
            else:
                register = ((register << 1) & mask) ^ (polynomial if register & top else 0)
        table.append(register)
    return np.array(table, dtype=np.uint64)


def _advance(register: np.ndarray, table: np.ndarray, rule: Checksum) -> np.ndarray:
    """Registers after one more zero byte, uint64 [n]."""
    if rule.reflected:
        return (register >> np.uint64(8)) ^ table[(register & np.uint64(0xFF)).astype(np.intp)]
    rest = (register << np.uint64(8)) & np.uint64(_mask(rule.width))
    return rest ^ table[(register >> np.uint64(rule.width - 8)).astype(np.intp)]


def _reversed_bits(value: int, width: int) -> int:
    return int(format(value, f"0{width}b")[::-1], 2)

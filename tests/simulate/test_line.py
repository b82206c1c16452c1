"""Damage: exactly what was asked for, named one by one, and the first frame whole."""

import numpy as np

from vgyro.simulate.serial.line import damage
from vgyro.simulate.twin import LineDamage

FRAME, FRAMES = 30, 400
DATA = np.random.default_rng(5).bytes(FRAME * FRAMES)
STARTS = np.arange(FRAMES) * FRAME


def run(seed: int = 1, **keys):
    return damage(DATA, LineDamage(**keys), np.random.default_rng(seed), STARTS)


def test_nothing_asked_nothing_done() -> None:
    assert run() == (DATA, [])


def test_flips_change_one_bit_each_where_they_say() -> None:
    data, done = run(flips=50)
    changed = np.unpackbits(np.frombuffer(data, np.uint8) ^ np.frombuffer(DATA, np.uint8))
    assert len(data) == len(DATA)
    assert changed.sum() == 50
    assert sorted(item.offset for item in done) == (np.flatnonzero(changed) // 8).tolist()
    assert all(item.kind == "flip" and item.frame == item.offset // FRAME for item in done)


def test_the_list_rebuilds_the_damage() -> None:
    data, done = run(leading_bytes=10, flips=20, drops=20, insertions=20, cut_tail=7)
    rebuilt, position = bytearray(), 0
    for item in done:
        if item.kind == "leading":
            rebuilt += bytes.fromhex(item.detail)
        elif item.kind != "cut_tail":
            old, _, new = item.detail.partition(">")
            rebuilt += DATA[position : item.offset] + bytes.fromhex(new)
            position = item.offset + len(old) // 2
            assert DATA[item.offset : position].hex() == old
    assert data == bytes(rebuilt + DATA[position:-7])
    assert [item.kind for item in done].count("drop") == 20


def test_first_frame_stays_whole() -> None:
    data, done = run(leading_bytes=5, flips=1000, drops=500, insertions=500)
    assert data[5 : 5 + FRAME] == DATA[:FRAME]
    assert len({item.offset for item in done}) == len(done)


def test_seeded() -> None:
    assert run(7, flips=9, drops=9) == run(7, flips=9, drops=9)
    assert run(7, flips=9, drops=9) != run(8, flips=9, drops=9)

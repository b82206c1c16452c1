"""Run every kernel on ordinary and on awkward data and print a hash of what each returned.

`python exercise.py`: one line a kernel, "name hash". Other tests run it in processes of their own: with and without
AVX2, with one thread and with several, and built with sanitizers.
"""

import hashlib
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

from vgyro.board import BinaryFrame, parse_board
from vgyro.engine.frames import FrameColumn
from vgyro.engine.native import adaptive, allan, dcc, frames, garch, kalman, text, weights
from vgyro.engine.text import PAD, Field, LineForm

BOARDS = Path(__file__).parents[3] / "config/boards"
SEED = 20150612
WINDOWS, SAMPLES, GYROS = 37, 120, 6


def awkward_windows(rng: np.random.Generator) -> np.ndarray:
    """Windows [K, T, N]: white noise, bursts, steps, outliers, trends, heavy tails, other scales, quantised, stuck."""
    r = rng.normal(0, 0.1, (WINDOWS, SAMPLES, GYROS))
    r[1] *= np.exp(rng.normal(0, 1, SAMPLES).cumsum()[:, None] / 10)
    r[2, 60:] += 3.0
    r[3, 50, 2] = 1e3
    r[4] += np.linspace(0, 5, SAMPLES)[:, None]
    r[5] = rng.standard_t(2, (SAMPLES, GYROS))
    r[6] *= 1e-4
    r[7] = np.round(r[7] / 0.2) * 0.2
    r[8, :, 0] = 0.0
    r[9, :, 1] = 0.7
    r[10, 5, 3] = np.nan
    r[11, 5, 3] = np.inf
    r[12, :, 4] = r[12, :, 5]
    r[13] *= 1e12
    r[14] *= 1e-150
    return r


def covariances(rng: np.random.Generator, count: int, size: int) -> np.ndarray:
    """Positive definite matrices [count, size, size], some of them badly scaled or nearly singular."""
    root = rng.normal(size=(count, size, size)) * 10.0 ** rng.uniform(-2, 2, (count, size, 1))
    matrices = root @ root.transpose(0, 2, 1)
    matrices += 1e-6 * np.eye(size) * np.trace(matrices, axis1=1, axis2=2)[:, None, None]
    return matrices


def results() -> dict[str, object]:
    """Name → what the kernel returned."""
    rng = np.random.default_rng(SEED)
    r = awkward_windows(rng)
    found: dict[str, object] = {"garch": (fits := garch.fit_garch_windows(r))}
    for shape in ((0, SAMPLES, 2), (1, 10, 3), (5, 20, 1), (3, 21, 2)):
        found[f"garch {shape}"] = garch.fit_garch_windows(rng.normal(size=shape))
    whole = np.isfinite(fits.omega).all(axis=1)
    e = r[whole]
    margins = (fits.omega[whole], fits.alpha[whole], fits.beta[whole])
    found["dcc"] = (fitted := dcc.fit_dcc_windows(e, *margins, fits.status[whole]))
    found["dcc 2"] = dcc.fit_dcc_windows(
        np.ascontiguousarray(e[:, :, :2]), *(np.ascontiguousarray(m[:, :2]) for m in margins), fits.status[whole][:, :2]
    )
    found["path"] = weights.conditional_weights(
        e, SAMPLES - 20, *margins, fitted.a, fitted.b, fitted.target, SAMPLES - 40, SAMPLES
    )
    for size in (1, 2, 3, 6, 9):
        found[f"weights {size}"] = weights.min_variance_weights(covariances(rng, 203, size))
    rate = np.cumsum(rng.normal(size=(3001, GYROS)), axis=0) * 0.01 + rng.normal(size=(3001, GYROS))
    noise = covariances(rng, 3001, GYROS)
    estimate, variance = kalman.kalman_filter(rate, 0.99, 0.01, noise, 0.0, 1.0)
    found["kalman"] = (estimate, variance)
    found["rts"] = kalman.rts_smoother(estimate, variance, 0.99, 0.01)
    for size in (2, 3, 4, 5, 6, 9):
        several, states = covariances(rng, 3, size), np.eye(2 + 2 * size)
        drive = 1e-3 * np.array([[3e-8, 1e-5], [1e-5, 5e-3]])
        some = rate[:, rng.integers(0, GYROS, size)] + 1e-3 * rng.normal(size=(3001, size))
        found[f"adaptive {size}"] = adaptive.scale_bias_filter(
            some, 0.005, several[0], drive, np.full(size, 1e-6), states[0], states
        )
        for steps in (1, 3, 4, 5):
            found[f"adaptive bank {size} {steps}"] = adaptive.filter_bank(
                some, several, np.geomspace(1e-6, 1e2, steps), 0.0, 1e4, np.full((3, steps), 1 / (3 * steps)), 1e-4
            )
    factors = np.unique(np.geomspace(1, 1000, 20).astype(np.int64))
    found["allan"] = allan.differences(rate[:, 0].copy(), factors)
    found["allan 3"] = allan.differences(rate[:3, 0].copy(), np.array([1]))
    edges = np.array([0, 5, 1000, 1003, 3001])
    found["allan stretches"] = allan.differences(rate[:, 1].copy(), factors, edges)
    slot = np.delete(np.arange(3062), np.arange(50, 3050, 50))[:3001]
    sums = allan.slot_sums(rate[:, 3].copy(), slot, np.array([0, 20, 3062]))
    found["allan slots"] = sums
    for kind in ("overlapping", "modified", "hadamard"):
        found[f"allan {kind}"] = allan.differences(rate[:, 1].copy(), factors, edges, 3, kind)
        found[f"allan losses {kind}"] = allan.differences_over_losses(*sums, np.array([0, 20, 3062]), factors, 3, kind)
    found["lag products"] = allan.lag_products(rate[:, 2].copy(), factors, edges)
    found["frames"] = frames_results(rng)
    found["text"] = text_results(rng)
    return found


def frames_results(rng: np.random.Generator) -> list[object]:
    """Candidates, columns, breaks and runs of a damaged stream of each checksum family."""
    found: list[object] = []
    layouts = [parse_board(path.read_text(encoding="utf-8"), path.name).frame for path in sorted(BOARDS.glob("*.yaml"))]
    for frame in (layout for layout in layouts if isinstance(layout, BinaryFrame)):
        stream = rng.integers(0, 256, 20_011).astype(np.uint8)
        stream[rng.integers(0, len(stream) - 1, 900)] = bytes.fromhex(frame.sync)[0]
        stream[3000:3200] = bytes.fromhex(frame.sync)[0]
        candidates = frames.Finder(frame).find(stream)
        places = np.arange(0, len(stream) - frame.length, frame.length)
        wanted = [FrameColumn(field.type, field.at, field.byte_order or frame.byte_order) for field in frame.fields]
        columns = frames.read_columns(stream, places, frame.length, wanted)
        counter = stream[places].astype(np.int64)
        found += [candidates, columns, frames.breaks(places, frame.length, counter, 1, 256)]
    time = np.arange(500) / 200
    found.append(frames.longest_run(np.repeat(np.arange(50, dtype=np.int16), 10), time, 0.0, 0.01))
    found.append(frames.Finder(frame).find(np.empty(0, dtype=np.uint8)))
    return found


def text_results(rng: np.random.Generator) -> list[object]:
    """Rows of lines of every kind of cell, as they are and with bytes changed at random."""
    fields = (Field("date"), Field("number"), Field("words"), Field("number", b"gx:"), Field("integer"), Field("hex"))
    lines = b'2026-02-28 23:59:55.123Z,1.25e3,"a b",gx:-0.5,1700000000123456789,0xFF\n' * 50
    damaged = np.frombuffer(lines * 20, dtype=np.uint8).copy()
    at = rng.integers(0, len(damaged) - 1, 2000)
    damaged[at] = rng.choice(np.frombuffer(b'\n\n,,"\r \t*-+.eE:019xgT\xff\x00', dtype=np.uint8), len(at))
    found: list[object] = []
    for form in (
        LineForm(fields), LineForm((Field("number"),) * 3, b" "), LineForm((Field("day"), Field("skip")), lead=b",1"),
        LineForm((Field("skip"), Field("number", b"gx:")), word=b"2026", checksum=True), LineForm(fields, eol=b"\r"),
    ):  # fmt: skip
        for content in (np.frombuffer(lines, dtype=np.uint8), damaged, damaged[-7:], damaged[-1:]):
            # Exactly as many bytes as may be read.
            data = np.concatenate([content, np.full(1 + PAD, ord("7"), dtype=np.uint8)])
            data[len(content)] = form.eol[0]
            found.append(tuple(text.Parser(form).parse(data, len(content) + 1, 500)))
    return found


def digest(value: object) -> str:
    """SHA-256 over the bytes of arrays, in dataclasses and tuples too."""
    sha = hashlib.sha256()
    pending = [value]
    while pending:
        item = pending.pop()
        if is_dataclass(item):
            pending += [getattr(item, field.name) for field in fields(item)]
        elif isinstance(item, tuple | list):
            pending += list(item)
        elif item is not None:
            array = np.ascontiguousarray(item)
            sha.update(
                str(array.shape).encode() + (str(array.tolist()).encode() if array.dtype == object else array.tobytes())
            )
    return sha.hexdigest()[:16]


if __name__ == "__main__":
    for name, value in results().items():
        print(name, digest(value))

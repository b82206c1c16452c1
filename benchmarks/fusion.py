"""Every fusion method on one recording, against the plain average: what a row of the tables costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.contest import Accuracy, Contest, Rival, Side
from benchmarks.limits import arithmetic
from benchmarks.series import GYROS
from vgyro.fusion import METHODS, ArrayNoise, ArrayRates, FilterParameters, Method, SampleWeights
from vgyro.fusion.events import FaultEvent
from vgyro.fusion.types import CannotRun

RATE_HZ, ARW, RRW, CORRELATION = 200.0, 0.1, 1e-3, 0.1
MOTION_DEG_S, MOTION_HZ = 20.0, 0.5
DEFINITION = "residual"
WORST = 0.5
"""r.m.s. error of a method over that of a gyro that says zero; more, and its run counts as broken."""
SLOW = ("smoothed", "recommended")
"""Not in a quick run: the search for a motion model takes seconds, however short the recording is."""
Run = Callable[[], np.ndarray]


def contests(quick: bool) -> list[Contest]:
    """One contest: `average` against every other method that runs on a moving board. Their figure is their CPU time
    over that of the average; no target, for what a row costs is shown and not judged."""
    samples = 40_000 if quick else 1_000_000
    array, truth = recording(samples), motion(samples)
    runs: dict[str, Run] = {}
    errors: dict[str, float] = {}
    for name, method in METHODS.items():
        if quick and name.endswith(SLOW):
            continue
        run = runner(method, array)
        try:
            errors[name] = float(np.std(run() - truth))
        except CannotRun:
            continue
        runs[name] = run
    average = runs.pop("average")
    rivals = tuple(Rival(Side(name, run, samples)) for name, run in runs.items())

    def accuracy() -> list[Accuracy]:
        plain = average()
        mean = array.rate.mean(axis=1)
        return [
            Accuracy("average, largest difference to NumPy's", float(np.max(np.abs(plain - mean))), 1e-10),
            Accuracy("worst 1σ of an error, over 1σ of the motion", max(errors.values()) / float(truth.std()), WORST),
        ]

    size = f"{samples:,} samples".replace(",", " ")
    missing = sorted(set(METHODS) - set(runs) - {"average"})
    note = "the figure is the method's CPU time over that of `average`; weights of DCC and CCC are read, not fitted"
    note += f"; not run: {', '.join(missing)}" if missing else ""
    return [
        Contest(
            "fusion", f"fusion of 6 gyros, {size}", "sample", Side("average", average, samples), rivals,
            arithmetic(GYROS + 1, 0, 8 * (GYROS + 1)), accuracy, note,
        )
    ]  # fmt: skip


def runner(method: Method, array: ArrayRates) -> Run:
    """A run of one method on rates that nothing is known of yet."""
    parameters = FilterParameters(bandwidth_hz=5.0, in_motion=True, definition=DEFINITION)

    def run() -> np.ndarray:
        # A copy: what an array has found out once for all of its methods must be found out again.
        return method.fuse(replace(array), parameters).rate

    return run


def recording(samples: int) -> ArrayRates:
    """Six gyros on a moving board at 200 Hz: white noise, random walk, a gyro with thrice the noise, one fault."""
    rng = np.random.default_rng(16)
    size = ARW * np.sqrt(RATE_HZ) * np.array([1, 1, 1, 3, 1, 1])
    rate = np.empty((samples, GYROS), order="F")
    for column, sd in zip(rate.T, size, strict=True):
        walk = np.cumsum(rng.standard_normal(samples)) * (RRW / np.sqrt(RATE_HZ))
        column[:] = motion(samples) + walk + sd * rng.standard_normal(samples)
    correlation = np.full((GYROS, GYROS), CORRELATION)
    np.fill_diagonal(correlation, 1.0)
    noise = ArrayNoise(size / np.sqrt(RATE_HZ), np.full(GYROS, RRW), correlation)
    block = (np.arange(samples) // int(RATE_HZ)).astype(np.int32)
    count = int(block[-1]) + 1
    weights = SampleWeights.of(rng.dirichlet(np.ones(GYROS), count), block)
    deviation = SampleWeights.of(np.tile(size / np.sqrt(RATE_HZ), (count, 1)), block)
    keys = [(model, mode, DEFINITION) for model in ("dcc", "ccc") for mode in ("in_sample", "causal")]
    fault = FaultEvent(4, "noise", samples // 3, samples // 2, 20.0, 5.0, "1")
    return ArrayRates(
        rate, RATE_HZ, np.zeros(samples, dtype=np.int32), np.zeros(samples, dtype=bool), noise,
        dict.fromkeys(keys, weights), deviations=dict.fromkeys(keys, deviation), faults=(fault,),
    )  # fmt: skip


def motion(samples: int) -> np.ndarray:
    """A sinusoid, deg/s."""
    return MOTION_DEG_S * np.sin(2 * np.pi * MOTION_HZ * np.arange(samples) / RATE_HZ)

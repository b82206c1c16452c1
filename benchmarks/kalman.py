"""Kalman filter with a noise covariance that changes, and the smoother behind it, against filterpy."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version

import numpy as np

from benchmarks.contest import Accuracy, Contest, Rival, Side
from benchmarks.limits import arithmetic
from benchmarks.series import GYROS, covariance_path, rates
from vgyro import engine

TRANSITION, PROCESS, START, VARIANCE = 0.999, 1e-4, 0.0, 1.0
RELATIVE = 1e-9
# Filter: Cholesky of R (n³/3), R⁻¹1 and R⁻¹z (2·2n²), two sums, a division for the gain; R is read.
FILTER_FLOPS, FILTER_DIVISIONS = GYROS**3 / 3 + 4 * GYROS**2 + 4 * GYROS + 8, GYROS + 1
# Smoother: gain FP/P⁻, estimate and variance: 9 operations, a division; two series in, two out.
SMOOTHER_FLOPS, SMOOTHER_DIVISIONS = 9, 1


def contests(quick: bool) -> list[Contest]:
    """Ours runs over all samples; filterpy over the first of them, timed a sample."""
    samples, slow = (20_000, 2000) if quick else (720_000, 20_000)
    rate = rates(samples, seed=14, gyros=GYROS)
    R = np.repeat(covariance_path(-(-samples // 200), seed=15), 200, axis=0)[:samples]
    native = engine.get("native").kalman

    def filtered() -> tuple[np.ndarray, np.ndarray]:
        found = native.kalman_filter(rate, TRANSITION, PROCESS, R, START, VARIANCE)
        return found[0], found[1]

    estimate, variance = filtered()
    part = f"filterpy {version('filterpy')}, {slow} samples"
    theirs = run_filterpy(rate[:slow], R[:slow])
    smooth = filterpy_smoother(estimate[:slow], variance[:slow])

    def filter_accuracy() -> list[Accuracy]:
        x, P = theirs
        return [
            relative("estimate, largest difference", estimate[:slow], x),
            relative("variance, largest difference", variance[:slow], P),
        ]

    def smoother_accuracy() -> list[Accuracy]:
        mine, spread = native.rts_smoother(estimate[:slow], variance[:slow], TRANSITION, PROCESS)
        x, P = smooth()
        return [
            relative("smoothed, largest difference", mine, x),
            relative("variance, largest difference", spread, P),
        ]

    size = f"{samples:,} samples".replace(",", " ")
    filter_limit = arithmetic(FILTER_FLOPS, FILTER_DIVISIONS, 8 * (GYROS * GYROS + GYROS + 2))
    return [
        Contest(
            "kalman", f"Kalman filter, R_t of 6 gyros, {size}", "sample", Side("vgyro", filtered, samples),
            (Rival(Side(part, lambda: run_filterpy(rate[:slow], R[:slow]), slow), 150),), filter_limit, filter_accuracy,
        ),
        Contest(
            "rts", f"RTS smoother, {size}", "sample",
            Side("vgyro", lambda: native.rts_smoother(estimate, variance, TRANSITION, PROCESS), samples),
            (Rival(Side(part, smooth, slow), 2000),),
            arithmetic(SMOOTHER_FLOPS, SMOOTHER_DIVISIONS, 32), smoother_accuracy,
        ),
    ]  # fmt: skip


def relative(name: str, ours: np.ndarray, theirs: np.ndarray) -> Accuracy:
    """Largest difference over the largest value."""
    return Accuracy(f"{name}, relative", float(np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs))), RELATIVE)


def run_filterpy(rate: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """predict and update in a loop, as its manual shows."""
    from filterpy.kalman import KalmanFilter

    filter_ = KalmanFilter(dim_x=1, dim_z=rate.shape[1])
    filter_.x[:], filter_.F[:], filter_.P[:], filter_.Q[:] = START, TRANSITION, VARIANCE, PROCESS
    filter_.H = np.ones((rate.shape[1], 1))
    estimate, variance = np.empty(len(rate)), np.empty(len(rate))
    for t, (z, noise) in enumerate(zip(rate[:, :, None], R, strict=True)):
        filter_.predict()
        filter_.update(z, noise)
        estimate[t], variance[t] = filter_.x[0, 0], filter_.P[0, 0]
    return estimate, variance


def filterpy_smoother(estimate: np.ndarray, variance: np.ndarray) -> Callable[[], tuple[np.ndarray, np.ndarray]]:
    """filterpy's own smoother over the given estimates."""
    from filterpy.kalman import KalmanFilter

    filter_ = KalmanFilter(dim_x=1, dim_z=1)
    filter_.F[:], filter_.Q[:] = TRANSITION, PROCESS
    x, P = estimate[:, None, None].copy(), variance[:, None, None].copy()

    def smooth() -> tuple[np.ndarray, np.ndarray]:
        found = filter_.rts_smoother(x, P)
        return found[0][:, 0, 0], found[1][:, 0, 0]

    return smooth

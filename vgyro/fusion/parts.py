"""The parts of `recommended`, by name: each can be left out, so that the benchmark shows what it brings."""

from __future__ import annotations

PARTS: dict[str, str] = {
    "faults": "leave a gyro out while it is at fault",
    "clipped": "samples at the end of a gyro's range count as missing",
    "tails": "samples far off count for less (Student's t)",
    "quantised": "no gyro is better than its step allows",
    "response": "scale factors, delays and poles relative to the array, from the motion",
    "pole": "the sensor's low-pass is undone where it is declared or the motion shows it",
    "motion": "noise that comes with the motion, in all gyros alike",
    "quiet": "correlations of the noise from the frequencies at which the motion is small",
    "changing": "variances that change with time",
    "changing_correlation": "correlations that change with time",
    "slow": "slow errors of the gyros, from their differences",
    "slow_walk": "random walks by likelihood instead of those of the noise record",
    "slow_common": "what all gyros drift together at rest goes into the deviation",
    "temperature": "slow errors that follow the temperature",
    "warm_up": "slow errors that settle, as in a warm-up",
    "anchors": "standstill pins the common bias",
    "band": "variances of the band that passes",
    "lines": "vibrations are motion",
    "activity": "motion that comes and goes",
    "guard": "equal variances, where the differences do not show that one gyro is better than another",
}

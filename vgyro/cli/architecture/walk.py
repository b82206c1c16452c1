"""The way of one array of rates through the method `recommended`, file by file. Written by hand; a test checks it."""

from __future__ import annotations

WALK: tuple[tuple[str, str], ...] = (
    (
        "vgyro/tasks/fusion/fuse.py",
        "`main`: the job; for each method a column of fused.parquet and a row of methods.parquet",
    ),
    (
        "vgyro/tasks/fusion/array_inputs.py",
        "`open_array`: rates.parquet, noise, faults and weights become one `ArrayRates`, with rates [T, N] in deg/s",
    ),
    ("vgyro/fusion/registry.py", "`METHODS`, the table of all methods; `run_methods` runs them, each on its own"),
    ("vgyro/fusion/ours/recommended.py", "`recommended`: the whole method on one page, in five steps"),
    (
        "vgyro/fusion/ours/prepared.py",
        "`prepared`: rates with clipped samples, heavy tails and steps mended, scale factors and delays taken off",
    ),
    (
        "vgyro/fusion/ours/array_estimate.py",
        "`analysed`: what the differences between the gyros say, made once for all rows",
    ),
    ("vgyro/fusion/noise/parity.py", "`shared_variances`: R_t, variances of the white noise and their correlation"),
    ("vgyro/fusion/bias/estimate.py", "`slow_errors`: b(t), biases that walk and follow, and their covariance"),
    ("vgyro/fusion/weights.py", "`min_variance_weights`: u of least variance for R_t, Σu = 1; z = u'(y - b)"),
    (
        "vgyro/fusion/motion/choice.py",
        "`choose_motion`: which model of the rate, with which parameters, from the spectrum of z",
    ),
    (
        "vgyro/fusion/motion/smoother.py",
        "`smooth`: the two-sided smoother of z with that model; a variance for each sample",
    ),
    (
        "vgyro/fusion/ours/smoothed.py",
        "`smoothed`: rate, standard deviation, bandwidth and delay go back as one `Fused`",
    ),
)

"""The small data set of the report tests: rates, methods and figures of an array."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from bench_records import GYROS, NOISE, PROVENANCE
from bench_volatility import write_bekk, write_effects, write_volatility

from vgyro.fusion import ArrayNoise, FilterParameters
from vgyro.more_gyros import MeanCorrelation, analyse
from vgyro.storage.tables import write_table

METHODS = (
    ("average", "", "Average", True),
    ("median", "", "Median", True),
    ("inverse_variance_arw", "", "Inverse variance, ARW", True),
    ("inverse_variance_rrw", "", "Inverse variance, RRW", True),
    ("jiang_random_walk", "", "Jiang 2012, random walk", True),
    ("dcc_in_sample", "level", "DCC weights, in-sample", False),
    ("dcc_causal", "level", "DCC weights, causal", True),
    ("dcc_causal", "residual", "DCC weights, causal", True),
    ("recommended", "", "Recommended", False),
)
MOVED = "dcc_causal[level]"
ADDED_RATE = 0.05
GAIN = {
    "average": 1.9,
    "median": 2.4,
    "inverse_variance_arw": 2.8,
    "jiang_random_walk": 3.4,
    "dcc_in_sample": 3.1,
    "dcc_causal": 2.9,
}


def write_rates(path: Path, recording: str) -> None:
    rng = np.random.default_rng(7)
    time = np.arange(12_000) / 10
    moving = recording == "sine"
    truth = 60 * np.sin(2 * np.pi * 0.1 * time) * ((time > 300) & (time < 900)) if moving else np.zeros(len(time))
    columns: dict[str, Any] = {
        "time": time,
        "segment": np.zeros(len(time), dtype=np.int32),
        "at_rest": (truth == 0) if moving else np.ones(len(time), dtype=bool),
        "reference": truth if moving else np.full(len(time), np.nan),
        "temp_board": 25 + 5 * (1 - np.exp(-time / 300)),
    }
    for name in (*GYROS, "solo"):
        drift = 0.0004 * np.cumsum(rng.normal(size=len(time)))
        columns[name] = truth + drift + NOISE.get(name, 0.05) * rng.normal(size=len(time))
    write_table(path, columns, "rates", PROVENANCE, {"rate_hz": 10.0, "delays": {}})


def write_array(folder: Path, recording: str, axis: str, gyros: tuple[str, ...], failed_check: bool) -> None:
    fused = METHODS if len(gyros) > 1 else ()
    columns = [f"{name}[{definition}]" if definition else name for name, definition, _, _ in fused]
    level = {name: NOISE.get(name, 0.05) for name in gyros}
    level |= {column: 0.05 / GAIN.get(column.split("[")[0], 2.0) for column in columns}
    _write_curves(folder, level)
    _write_metrics(folder, recording, axis, gyros, fused, level)
    words = (
        "method", "definition", "column", "title", "source", "family", "needs", "inferred", "causal", "note",
        "response", "moved",
    )  # fmt: skip
    methods: dict[str, Any] = {name: [] for name in words}
    for (name, definition, title, causal), column in zip(fused, columns, strict=True):
        lost = name == "inverse_variance_rrw"
        note = "no RRW was found for g1" if lost else ""
        moved = "" if lost else column if column == MOVED else "the same at any constant rate: weights add up to one"
        family = {"recommended": "ours", "average": "baseline", "median": "baseline"}.get(name, "paper")
        inferred = "one of <two> equations" if "jiang" in name else ""
        row = (
            name, definition, "" if lost else column, title, "paper <eq. 1>", family, "arw, rrw" if lost else "weights",
            inferred, causal, note, "analytic", moved,
        )  # fmt: skip
        for key, value in zip(words, row, strict=True):
            methods[key].append(value)
    filtered = np.array([name == "jiang_random_walk" for name, *_ in fused], dtype=bool)
    figures = {"dc_gain": 1.0, "bandwidth_hz": 1.05, "noise_bandwidth_hz": 1.65, "delay_s": 0.15, "operations": 1234.0}
    for key, value in figures.items():
        plain = 1.0 if key == "dc_gain" else 0.0 if key == "delay_s" else np.nan
        methods[key] = np.where(filtered, value, plain)
    if not fused:
        methods = {
            key: np.array([], dtype=bool if key == "causal" else float if key in figures else str) for key in methods
        }
    write_table(folder / "methods.parquet", methods, "methods", PROVENANCE)
    pairs = [(a, b) for a in gyros for b in gyros]
    value = np.array([1.0 if a == b else 0.12 if {a, b} == {"g1", "g2"} else -0.03 for a, b in pairs])
    correlation = {"gyro": [a for a, _ in pairs], "other": [b for _, b in pairs], "correlation": value}
    write_table(
        folder / "correlation.parquet",
        {**correlation, "low": value - 0.02, "high": value + 0.02},
        "correlation",
        PROVENANCE,
    )
    checks = 3
    write_table(folder / "crosscheck.parquet", {
        "check": ["GARCH α", "DCC a", "Allan σ(1 s)"], "against": ["arch", "pymgarch", "allantools"],
        "window": [3, 3, -1], "series": [gyros[0], "array", gyros[0]], "ours": [0.05, 0.02, 0.04],
        "theirs": [0.05, 0.02, 0.05 if failed_check else 0.04],
        "difference": [1e-7, 0.0, -0.01 if failed_check else 0.0],
        "tolerance": [1e-4] * checks, "unit": ["1", "1", "deg/s"], "passed": [True, True, not failed_check],
    }, "crosscheck", PROVENANCE)  # fmt: skip
    _write_noise_in_common(folder, gyros)
    if recording == "rest":
        _write_more_gyros(folder, gyros, value.reshape(len(gyros), -1))
        write_effects(folder, gyros)
        write_bekk(folder)
        for definition in ("level", "residual"):
            write_volatility(folder / definition, gyros)


def _write_more_gyros(folder: Path, gyros: tuple[str, ...], correlation: np.ndarray) -> None:
    arw = np.array([NOISE.get(name, 0.05) for name in gyros])
    mean = MeanCorrelation.of(correlation, correlation - 0.02, correlation + 0.02)
    found = analyse(ArrayNoise(arw, arw, np.eye(len(arw))), mean, FilterParameters(), 20)
    write_table(folder / "more_gyros.parquet", found.columns, "more_gyros", PROVENANCE, {"summary": found.summary})


def _write_curves(folder: Path, level: dict[str, float]) -> None:
    tau = 0.02 * 2.0 ** (np.arange(42) / 3)
    frequency = np.geomspace(0.01, 25, 800)
    rows: dict[str, list[Any]] = {name: [] for name in ("series", "kind", "tau", "deviation", "low", "high", "edf")}
    spectra: dict[str, list[Any]] = {name: [] for name in ("series", "frequency", "density")}
    for name, n in level.items():
        sigma = np.sqrt(n**2 / tau * 0.02 + (0.001 + 0.02 * n) ** 2 + (0.0001) ** 2 * tau / 3)
        spread = 0.01 + 0.5 * tau / tau[-1]
        for kind in ("overlapping", "robust") if name in GYROS else ("overlapping",):
            words = (np.full(len(tau), name), np.full(len(tau), kind))
            values = (*words, tau, sigma, sigma / (1 + spread), sigma * (1 + spread), 2 / spread**2)
            for key, value in zip(rows, values, strict=True):
                rows[key].extend(value.tolist())
        density = n * np.sqrt(0.04) * np.sqrt(1 + 0.1 / frequency)
        for key, value in zip(spectra, (np.full(len(frequency), name), frequency, density), strict=True):
            spectra[key].extend(value.tolist())
    write_table(folder / "allan.parquet", rows, "allan", PROVENANCE)
    write_table(folder / "spectrum.parquet", spectra, "spectrum", PROVENANCE)


FLAGGED = {"band-limited": "band_limited", "the curve still falls": "upper_limit", "not shown": "not_shown",
           "not significant": "not_significant"}  # fmt: skip


def _write_metrics(
    folder: Path, recording: str, axis: str, gyros: tuple[str, ...], methods: Any, level: dict[str, float]
) -> None:
    rows: list[tuple[Any, ...]] = []

    def add(
        method: str, definition: str, metric: str, value: float, unit: str, note: str = "", spread: float = 0.03,
        true_rate: float = 0.0,
    ) -> None:  # fmt: skip
        limits = (value, value * (1 - spread), value * (1 + spread))
        rows.append((recording, axis, method, definition, true_rate, metric, *limits, unit, note))

    series = [(name, "", name) for name in gyros]
    series += [(name, d, f"{name}[{d}]" if d else name) for name, d, *_ in methods if name != "inverse_variance_rrw"]
    for method, definition, column in series:
        n = level[column]
        filtered = "jiang" in method
        for name, value in (("missing", 25.0), ("outliers", 3.0 if method == "g1" else 0.0), ("clipped", 0.0)):
            add(method, definition, name, value, "1", "", 0.0)
        add(method, definition, "mean", 0.001, "deg/s")
        add(method, definition, "sigma", n, "deg/s", "bootstrap of blocks of 20 s")
        add(method, definition, "sigma_equal", 0.2 * n, "deg/s", "low-passed to 1.05 Hz")
        add(method, definition, "noise_density", n * 0.14, "deg/s/√Hz", "two-sided, 1 to 20 Hz")
        add(method, definition, "arw", 60 * n * 0.14, "deg/√h")
        add(method, definition, "density_ratio", 1.002, "1", "", 0.004)
        add(method, definition, "arw_1s", 60 * n * 0.14, "deg/√h", "band-limited: 0.88" if filtered else "")
        drift = "the curve still falls at its end: an upper limit of the floor" if method in {"g1", "g2"} else ""
        add(method, definition, "bias_drift", 360 * n, "deg/h", drift, 0.2)
        rows.append(
            (recording, axis, method, definition, 0.0, "rrw", 5.0, 0.0, 31.2, "deg/h/√h", "not shown to exist: < 31.2")
        )
        add(method, definition, "angle_drift_60s", 3 * n, "deg")
        add(method, definition, "angle_bound_60s", 3.1 * n, "deg")
        if method not in gyros:
            unsure = method == "median"
            factor = 0.0775 / n
            note = "not significant" if unsure else ""
            add(method, definition, "if_sigma_equal", factor * (0.7 if filtered else 1), "1", "", 0.02)
            add(method, definition, "if_sigma", factor, "1", "", 0.02)
            add(method, definition, "if_bias_drift", 1.1 if unsure else factor, "1", note, 0.3)
        if recording == "rest" and column == MOVED:
            for metric, value, unit in (
                ("mean", -0.024, "deg/s"),
                ("sigma", 1.1 * n, "deg/s"),
                ("arw", 9 * n, "deg/√h"),
            ):
                add(method, definition, metric, value, unit, true_rate=ADDED_RATE)
            add(method, definition, "bias_drift", 1800 * n, "deg/h", "", 0.2, ADDED_RATE)
        if recording == "sine":
            add(method, definition, "error_sigma", n, "deg/s")
            nothing = (np.nan, np.nan, np.nan)
            rows.append(
                (recording, axis, method, definition, 0.0, "delay", *nothing, "s", "the reference does not change")
            )
    names = (
        "recording", "axis", "method", "definition", "true_rate", "metric", "value", "low", "high", "unit", "note",
    )  # fmt: skip
    columns = {name: [row[i] for row in rows] for i, name in enumerate(names)}
    columns["flags"] = [next((flag for note, flag in FLAGGED.items() if row[-1].startswith(note)), "") for row in rows]
    write_table(
        folder / "metrics.parquet",
        columns,
        "metrics",
        PROVENANCE,
    )


def _write_noise_in_common(folder: Path, gyros: tuple[str, ...]) -> None:
    """A tone that g1 and g3 share, one of g2; Allan correlation that only g1 and g2 have."""
    tones = [
        (6.5, "g1", "g1, g3"), (6.5, "g3", "g1, g3"), (12.25, "g2", "g2"),
    ]  # fmt: skip
    tones = [row for row in tones if row[1] in gyros]
    amplitude = np.array([0.01 * (place + 1) for place in range(len(tones))])
    write_table(folder / "tones.parquet", {
        "gyro": np.array([gyro for _, gyro, _ in tones], dtype=str),
        "frequency": np.array([frequency for frequency, _, _ in tones], dtype=float),
        "amplitude": amplitude, "low": 0.9 * amplitude, "high": 1.1 * amplitude,
        "probability": np.full(len(tones), 1e-5),
        "shared": np.array([shared for _, _, shared in tones], dtype=str),
    }, "tones", PROVENANCE)  # fmt: skip
    tau = np.geomspace(1, 300, 12)
    pairs = [(first, second) for place, first in enumerate(gyros) for second in gyros[place:]]
    value = [1.0 if a == b else 0.4 if {a, b} == {"g1", "g2"} else 0.0 for a, b in pairs]
    correlation = np.repeat(value, len(tau))
    width = np.tile(np.linspace(0.02, 0.3, len(tau)), len(pairs))
    write_table(folder / "cross_allan.parquet", {
        "gyro": np.repeat([a for a, _ in pairs], len(tau)), "other": np.repeat([b for _, b in pairs], len(tau)),
        "tau": np.tile(tau, len(pairs)), "covariance": 1e-4 * correlation, "correlation": correlation,
        "low": correlation - width, "high": correlation + width,
    }, "cross_allan", PROVENANCE)  # fmt: skip

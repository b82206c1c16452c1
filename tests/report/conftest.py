"""A small data set of artefacts with plausible figures, made without the pipeline: what the pages are tested on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vgyro.fusion import ArrayNoise, FilterParameters
from vgyro.fusion.more_gyros import MeanCorrelation, analyse
from vgyro.storage.schemas import SCHEMAS
from vgyro.storage.tables import Provenance, TableWriter, write_json, write_table
from vgyro.tasks.common import Task

GYROS = ("g1", "g2", "g3", "g4")
DATASET = "bench"
PROVENANCE = Provenance({"rates": "ab" * 32}, "cd" * 32, "ef" * 32)
NOISE = {"g1": 0.05, "g2": 0.052, "g3": 0.048, "g4": 0.16}
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


def board() -> dict[str, Any]:
    names = (*GYROS, "solo")
    fields = [{"name": name, "type": "i16", "at": 2 + 2 * index} for index, name in enumerate(names)]
    gyros = [
        {"name": name, "field": name, "axis": "z" if name == "solo" else "x", "scale": 0.01, "range_deg_s": 300.0}
        for name in names
    ]
    frame = {"kind": "binary", "sync": "EB90", "length": 12, "fields": fields, "checksum": {"family": "none"}}
    return {"name": "bench", "title": "Bench board <A&B>", "rate_hz": 50.0, "frame": frame, "gyros": gyros}


def manifest(simulated: bool = True) -> dict[str, Any]:
    plateaus = [{"start": 10.0 * k, "stop": 10.0 * k + 8, "rate": rate} for k, rate in enumerate((-100.0, 0.0, 100.0))]
    recordings = [
        {"name": "cal", "kind": "calibration", "files": ["cal.bin"], "axis": "x",
         "reference": {"kind": "plateaus", "plateaus": plateaus}},
        {"name": "rest", "kind": "static", "files": ["rest.bin"]},
        {"name": "sine", "kind": "sinusoid", "files": ["sine.bin"], "axis": "x",
         "reference": {"kind": "sinusoid", "amplitude": 60.0, "frequency_hz": 0.1}},
        {"name": "broken", "kind": "static", "files": ["broken.bin"]},
    ]  # fmt: skip
    return {"board": "bench", "title": "Bench test", "simulated": simulated, "twin": "demo", "recordings": recordings}


def integrity(name: str) -> dict[str, Any]:
    refused = name == "broken"
    held = name == "rest"
    gaps = (
        [{"time": 100.0, "duration": 0.5, "frames_lost": 25, "cause": "damaged bytes", "ambiguous": False}]
        if held
        else []
    )
    damage = (
        [{"file": "rest.bin", "start": 1200, "stop": 1260, "frames_lost": 25, "cause": "checksum <&>"}] if held else []
    )
    channel = {"clipped": 0, "clipped_share": 0.0, "stuck_start": 0.0, "stuck_duration": 0.02}
    odd = {
        "g2": {**channel, "clipped": 17, "clipped_share": 0.0003},
        "g3": {**channel, "stuck_start": 8.0, "stuck_duration": 2.5},
    }
    return {
        "board": "bench",
        "status": "refused" if refused else "suspect" if held else "good",
        "reasons": ["only 12 % of its frames are good"] if refused else ["gyro g3 repeats one value"] if held else [],
        "warnings": ["the counter stood still in 3 frames"] if held else [],
        "values": "counts",
        "files": [
            {
                "name": f"{name}.bin",
                "bytes": 123456,
                "sha256": "12" * 32,
                "compression": "none",
                "content_bytes": 123456,
            }
        ],
        "frames": {
            "good": 60_000,
            "bad": 3,
            "lost": 25 if held else 0,
            "repeated": 0,
            "good_share": 0.9951 if held else 0.9999,
        },
        "duration_s": 1200.0,
        "rate_hz": 50.0,
        "declared_rate_hz": 50.0,
        "measured_rate_hz": 49.987,
        "rate_note": "measured 49.987 Hz, declared 50 Hz (-0.026 %)",
        "segments": 1 + len(gaps),
        "restarts": 0,
        "gaps": gaps,
        "gaps_not_listed": {"entries": 0, "frames_lost": 0},
        "damage": damage,
        "damage_not_listed": {"entries": 2 if held else 0, "bytes": 80, "frames_lost": 2},
        "channels": {"g1": channel, **(odd if held else {})},
    }


def figure(value: float | None, spread: float, unit: str, floor: float | None = None, note: str = "") -> dict[str, Any]:
    """A figure of calibration.json. value None: below the floor"""
    if value is None:
        return {"value": None, "low": 0.0, "high": spread, "unit": unit, "floor": floor, "state": "below the floor",
                "note": note}  # fmt: skip
    limits = {"value": value, "low": value - spread, "high": value + spread}
    return {**limits, "unit": unit, "floor": floor, "state": "value", "note": note}


def missing(unit: str, note: str) -> dict[str, Any]:
    """A figure that was not measured."""
    return {**dict.fromkeys(("value", "low", "high", "floor")), "unit": unit, "state": "not measured", "note": note}


def calibration() -> dict[str, Any]:
    points = [
        {"rate": 50.0 * k, "mean_count": 5000.0 * k + 20, "residual_deg_s": 0.002 * (-1) ** k + (0.001 if up else 0),
         "recording": "cal", "direction": "up" if up else "down", "temperature_c": 25.0,
         "standard_error_deg_s": 0.0008}
        for up in (True, False) for k in range(-6, 7)
    ]  # fmt: skip
    temperature = {
        "sensor": "board", "reference_c": 25.0, "low_c": 15.0, "high_c": 45.0, "scale_slope": -4e-4,
        "bias": [20.1, 0.8, 0.01, -0.0002], "bias_covariance": np.eye(4).tolist(), "applied": True, "note": "",
        "points": [{"temperature_c": t, "bias": 20 + 0.8 * (t - 25), "recording": "warm"} for t in (15.0, 30.0, 45.0)],
    }  # fmt: skip
    figures = {
        "nonlinearity_full_scale": figure(210.0, 30.0, "ppm", 160.0),
        "nonlinearity_reading": figure(None, 720.0, "ppm", 640.0),
        "asymmetry": figure(None, 95.0, "ppm", 80.0) | {"low": -15.0},
        "repeatability": figure(31.0, 12.0, "ppm", 9.0, "of 3 power cycles only"),
        "scale_temperature": figure(-400.0, 12.0, "ppm/K"),
        "self_heating": missing("deg/h", "no recording begins at switch-on"),
        "cross_axis": missing("%", "no calibration about another axis"),
    }
    measured = {
        "source": "measured", "recording": "cal", "scale": 0.0100123, "scale_low": 0.0100119,
        "scale_high": 0.0100127, "bias": 20.1, "bias_low": 19.8, "bias_high": 20.4, "note": "",
        "nonlinearity_ppm": 210.0, "floor_ppm": 160.0, "points": points, "figures": figures, "temperature": temperature,
    }  # fmt: skip
    nominal = {
        "source": "nominal", "scale": 0.01, "scale_low": None, "scale_high": None, "bias": 0.0, "bias_low": None,
        "bias_high": None, "nonlinearity_ppm": None, "floor_ppm": None, "points": [], "figures": {},
        "temperature": None, "note": "nominal scale: no calibration recording",
    }  # fmt: skip
    cold = {**measured, "temperature": None, "figures": {
        **figures, "repeatability": missing("ppm", "one recording only"),
        "scale_temperature": missing("ppm/K", "one temperature only"),
    }}  # fmt: skip
    test = {
        "recordings": ["cal"], "rates": 26, "full_scale": 300.0, "seconds_a_point": 20.0, "whole_turns": True,
        "earth_rate_deg_s": 0.0029, "temperature_c": [15.0, 45.0], "standard": "IEEE Std 1431-2004",
    }  # fmt: skip
    return {"gyros": {**dict.fromkeys(GYROS, measured), "g4": cold, "solo": nominal}, "test": {"x": test}}


def build(folder: Path, failed_check: bool = False, simulated: bool = True) -> Task:
    """Write the artefacts under folder/results; return the report task that reads them."""
    root = folder / "results" / DATASET
    write_json(root / "calibration.json", calibration())
    names = [recording["name"] for recording in manifest()["recordings"]]
    for name in names:
        write_json(root / name / "integrity.json", integrity(name))
    for recording in ("rest", "sine"):
        _write_rates(root / recording / "rates.parquet", recording)
        for axis, gyros in (("x", GYROS), ("z", ("solo",))):
            _write_array(root / recording / axis, recording, axis, gyros, failed_check)
    noise = {"gyros": list(GYROS), "arw": NOISE, "rrw": NOISE, "correlation": np.eye(4).tolist()}
    write_json(root / "noise" / "x.json", noise)
    inputs = {
        "calibration": [root / "calibration.json"],
        "integrity": [root / name / "integrity.json" for name in names],
        "noise": [root / "noise" / "x.json"],
        "artefacts": sorted(root.rglob("*.parquet")),
    }
    outputs = {"page": folder / "reports" / f"{DATASET}.html", "headline": root / "headline.json"}
    options = {
        "dataset": DATASET,
        "manifest": manifest(simulated),
        "board": board(),
        "analysis": {"metrics": {"welch_s": 100.0, "confidence": 0.95}, "calibration": {"confidence": 0.95}},
    }
    return Task(inputs, outputs, options, "code")


def _write_rates(path: Path, recording: str) -> None:
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
    write_table(path, columns, "rates", PROVENANCE, {"rate_hz": 10.0})


def _write_array(folder: Path, recording: str, axis: str, gyros: tuple[str, ...], failed_check: bool) -> None:
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
        _write_effects(folder, gyros)
        _write_bekk(folder)
        for definition in ("level", "residual"):
            _write_volatility(folder / definition, gyros)


def _write_more_gyros(folder: Path, gyros: tuple[str, ...], correlation: np.ndarray) -> None:
    arw = np.array([NOISE.get(name, 0.05) for name in gyros])
    mean = MeanCorrelation.of(correlation, correlation - 0.02, correlation + 0.02)
    found = analyse(ArrayNoise(arw, arw, np.eye(len(arw))), mean, FilterParameters(), 20)
    write_table(folder / "more_gyros.parquet", found.columns, "more_gyros", PROVENANCE, {"summary": found.summary})


def _write_bekk(folder: Path) -> None:
    """Two definitions, three windows each: DCC's log-likelihood is 1000, its 1σ 0.05 deg/s."""
    parameters = {"ccc": 18, "dcc": 20, "bekk_scalar": 12, "bekk_diagonal": 18}
    gain = {
        "ccc": (-3.0, -3.0, -20.0),
        "dcc": (0.0, 0.0, 0.0),
        "bekk_scalar": (-30.0,) * 3,
        "bekk_diagonal": (-9.0,) * 3,
    }
    share = {
        "ccc": (1.1, 0.9, 1.1),
        "dcc": (1.0, 1.0, 1.0),
        "bekk_scalar": (1.2,) * 3,
        "bekk_diagonal": (0.9, 0.8, 1.01),
    }
    rows = [
        {
            "window": window, "start": 30 * window, "stop": 30 * window + 360, "time_start": 30.0 * window,
            "time_stop": 30.0 * window + 359, "definition": definition, "model": model, "parameters": number,
            "log_likelihood": 1000 + gain[model][window], "sigma": 0.05 * share[model][window], "status": "converged",
            "bic": number * np.log(360) - 2 * (1000 + gain[model][window]),
        }
        for definition in ("level", "residual")
        for window in range(3)
        for model, number in parameters.items()
    ]  # fmt: skip
    names = [column.name for column in SCHEMAS["bekk"].columns]
    write_table(folder / "bekk.parquet", {name: [row[name] for row in rows] for name in names}, "bekk", PROVENANCE)


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
    write_table(
        folder / "metrics.parquet",
        {name: [row[i] for row in rows] for i, name in enumerate(names)},
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


def _write_effects(folder: Path, gyros: tuple[str, ...]) -> None:
    known = {
        "g1": "tone at 6.5 Hz", "g2": "drift + disturbance at t = 12 s", "g3": "tone at 6.5 Hz", "g4": "no variance",
    }  # fmt: skip
    verdict = [known.get(gyro, "nothing") for gyro in gyros]
    empty = np.full(len(gyros), np.nan)
    tone = np.where(np.isin(verdict, "tone at 6.5 Hz"), 6.5, np.nan)
    write_table(folder / "effects.parquet", {
        "gyro": gyros, "verdict": verdict, "sentence": [f"{word}: made up <here>" for word in verdict],
        "p_level": np.zeros(len(gyros)), "p_detrended": empty, "p_whitened": empty, "p_standardised": empty,
        "kurtosis": np.full(len(gyros), 3.1), "tone_frequency": tone, "tone_amplitude": 0.001 * tone,
        "tone_seen_at": tone % 1,
    }, "effects", PROVENANCE)  # fmt: skip


def _write_volatility(folder: Path, gyros: tuple[str, ...]) -> None:
    count = 28
    start = np.append(np.arange(count) * 30, 0)
    place = {
        "window": np.append(np.arange(count), -1), "start": start, "stop": start + 360,
        "time_start": start + 0.5, "time_stop": start + 359.5,
    }  # fmt: skip
    arch: dict[str, list[Any]] = {
        k: [] for k in ("gyro", "series", "lags", "samples", "statistic", "p_value", "kurtosis", "status")
    }
    for gyro in gyros:
        for series, statistic, p in (
            ("level", 420.0, 0.0),
            ("detrended", 1.2, 0.27),
            ("whitened", 0.7, 0.4),
            ("standardised", 0.4, 0.53),
        ):
            flat = gyro == "g3" and series == "standardised"
            row = (
                gyro,
                series,
                1,
                1200,
                np.nan if flat else statistic,
                np.nan if flat else p,
                3.1,
                "no variance" if flat else "ok",
            )
            for key, value in zip(arch, row, strict=True):
                arch[key].append(value)
    write_table(folder / "arch_lm.parquet", arch, "arch_lm", PROVENANCE)
    garch = {name: np.tile(values, len(gyros)) for name, values in place.items()}
    rows = (count + 1) * len(gyros)
    wave = np.sin(np.arange(rows))
    garch |= {
        "gyro": np.repeat(gyros, count + 1), "omega": 1e-5 + 0 * wave, "alpha": 0.05 + 0.02 * wave,
        "beta": 0.9 - 0.03 * wave,
        "se_omega": 1e-6 + 0 * wave, "se_alpha": 0.02 + 0 * wave, "se_beta": 0.05 + 0 * wave,
        "log_likelihood": -500 + wave,
        "status": np.where(wave < -0.8, "boundary: α = 0", "converged"),
    }  # fmt: skip
    write_table(folder / "garch.parquet", garch, "garch", PROVENANCE)
    single = len(gyros) == 1
    wave = np.sin(np.arange(count + 1)) * 0.01 + (np.nan if single else 0)
    dcc: dict[str, Any] = {
        **place, "a": 0.03 + wave, "b": 0.9 - wave, "se_a": 0.01 + 0 * wave, "se_b": 0.05 + 0 * wave,
        "se_a_hessian": 0.006 + 0 * wave, "se_b_hessian": 0.03 + 0 * wave, "log_likelihood": wave,
        "log_likelihood_ccc": wave,
        "target": [[0.1] * (len(gyros) * (len(gyros) - 1) // 2)] * (count + 1), "statistic": 4 + wave,
        "p_value": 0.1 + 6 * wave,
        "p_value_s": 0.08 + 6 * wave, "status": ["one gyro" if single else "converged"] * (count + 1),
    }  # fmt: skip
    write_table(folder / "dcc.parquet", dcc, "dcc", PROVENANCE)
    time = np.arange(1200) + 0.5
    fading = 0.3 - 0.2 * (time > 600) if not single else np.ones(len(time))
    blocks = [["dcc", "in_sample"], ["dcc", "causal"]]
    extra = {"blocks": blocks, "samples": len(time)}
    with TableWriter(folder / "weights.parquet", "weights", PROVENANCE, extra) as writer:
        for model, mode in blocks:
            part: dict[str, Any] = {"time": time, "segment": np.zeros(len(time), dtype=int)}
            part |= {"model": [model] * len(time), "mode": [mode] * len(time), "sigma": 0.02 + 0 * time}
            for index, gyro in enumerate(gyros):
                part[f"w_{gyro}"] = fading if index == 3 or single else (1 - fading) / 3
                part[f"sd_{gyro}"] = NOISE.get(gyro, 0.05) * (1 + 0.1 * np.sin(time / 100))
            waiting = time < 360 if mode == "causal" else np.zeros(len(time), dtype=bool)
            part["status"] = np.where(waiting, "no model yet", "ok")
            writer.append(part)
    _write_fits(folder, gyros)


def _write_fits(folder: Path, gyros: tuple[str, ...]) -> None:
    """Three bins of time, ten windows each; the last gyro is stuck in the middle one."""
    rows = []
    for start in (0.0, 400.0, 800.0):
        for gyro in gyros:
            stuck = gyro == gyros[-1] and start == 400.0
            ended = {"no variance": 10} if stuck else {"converged": 8, "boundary: α = 0": 2}
            rows += [(start, start + 400.0, gyro, status, windows) for status, windows in ended.items()]
        ended = {"one gyro": 10} if len(gyros) == 1 else {"converged": 7, "boundary: a = 0": 1, "boundary margin": 2}
        rows += [(start, start + 400.0, "dcc", status, windows) for status, windows in ended.items()]
    names = ("time_start", "time_stop", "subject", "status", "windows")
    columns = {name: [row[place] for row in rows] for place, name in enumerate(names)}
    write_table(folder / "fits.parquet", columns, "fits", PROVENANCE)


@pytest.fixture(scope="session")
def report_task(tmp_path_factory: pytest.TempPathFactory) -> Task:
    """The report task over the small data set."""
    return build(tmp_path_factory.mktemp("bench"))

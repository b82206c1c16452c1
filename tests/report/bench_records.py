"""The small data set of the report tests: names, and the records that stages leave as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from vgyro.storage.tables import Provenance

GYROS = ("g1", "g2", "g3", "g4")
DATASET = "bench"
PROVENANCE = Provenance({"rates": "ab" * 32}, "cd" * 32, "ef" * 32)
NOISE = {"g1": 0.05, "g2": 0.052, "g3": 0.048, "g4": 0.16}


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
    channel = {"clipped": 0, "clipped_share": 0.0, "stuck_start": 0.0, "stuck_duration": 0.02, "missing": 0}
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
        "clocks": [],
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

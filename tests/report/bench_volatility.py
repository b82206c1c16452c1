"""The small data set of the report tests: what volatility models leave."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from bench_records import NOISE, PROVENANCE

from vgyro.storage.schemas import SCHEMAS
from vgyro.storage.tables import TableWriter, write_table


def write_effects(folder: Path, gyros: tuple[str, ...]) -> None:
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


def write_volatility(folder: Path, gyros: tuple[str, ...]) -> None:
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


def write_bekk(folder: Path) -> None:
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

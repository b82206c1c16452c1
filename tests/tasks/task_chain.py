"""The tasks from frames to figures, on a small simulated array, one after the other."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from task_options import complete

from vgyro.dataset import Manifest
from vgyro.storage.tables import Provenance, read_columns, read_json, read_metadata, write_json, write_table
from vgyro.tasks.common import Task
from vgyro.tasks.figures import crosscheck, measure
from vgyro.tasks.fusion import faults, fuse, noise
from vgyro.tasks.rates import convert
from vgyro.tasks.volatility import assemble, series

RATE_HZ, SIGMA = 100.0, 0.05
DEFINITIONS = ("level", "residual")
TABLES = ("allan", "spectrum", "metrics", "correlation", "cross_allan", "tones")


@dataclass(frozen=True)
class Chain:
    """A folder, its board of gyros g1, g2, … about z, and the options of the tasks."""

    folder: Path
    gyros: tuple[str, ...]
    kind: str = "static"
    volatility: bool = False
    temperature: bool = False

    @property
    def board(self) -> dict:
        channels = [*self.gyros, *(["t"] if self.temperature else [])]
        fields = [{"name": name, "type": "f32", "at": 2 + 4 * place} for place, name in enumerate(channels)]
        frame = {"kind": "binary", "sync": "EB90", "length": 2 + 4 * len(channels), "fields": fields,
                 "checksum": {"family": "none"}}  # fmt: skip
        rows = [{"name": gyro, "field": gyro, "axis": "z", "scale": 1.0} for gyro in self.gyros]
        temperatures = [{"name": "t", "field": "t", "scale": 1.0, "offset": 0.0}] if self.temperature else []
        return {"name": "b", "title": "b", "rate_hz": RATE_HZ, "frame": frame, "gyros": rows,
                "temperatures": temperatures}  # fmt: skip

    def run(self, task: object, inputs: dict[str, str | list[str]], outputs: tuple[str, ...], **more: object) -> None:
        record = {"name": "r", "kind": self.kind, "files": "x.bin", "rest": "auto"}
        analysis = {"metrics": {"bootstrap": 60, "welch_s": 10.0}, "crosscheck": {"windows": 3},
                    "volatility": {"window": 50, "step": 10, "rate_hz": 5.0, "definitions": DEFINITIONS}}  # fmt: skip
        manifest = Manifest.model_validate({"board": "b", "recordings": [record]}).model_dump(mode="json")
        options = {
            "board": self.board, "manifest": manifest, "axis": "z", "recording": "r", "kind": self.kind,
            "injected_rate": None, "analysis": complete(analysis), **more,
        }  # fmt: skip
        named = {name: [paths] if isinstance(paths, str) else paths for name, paths in inputs.items()}
        task.main(Task(
            {name: [self.folder / path for path in paths] for name, paths in named.items()},
            {Path(name).stem: self.folder / (name if "." in name else f"{name}.parquet") for name in outputs},
            json.loads(json.dumps(options)), "code",
        ))  # fmt: skip

    def frames(self, rate: np.ndarray, celsius: np.ndarray | None = None, segment: np.ndarray | None = None) -> None:
        """Write frames.parquet and a nominal calibration."""
        samples = len(rate)
        segment = np.zeros(samples, np.int32) if segment is None else segment.astype(np.int32)
        columns = {"counter": np.arange(samples), "time": np.arange(samples) / RATE_HZ, "segment": segment}
        columns |= {gyro: rate[:, place].astype(np.float32) for place, gyro in enumerate(self.gyros)}
        columns |= {} if celsius is None else {"t": celsius.astype(np.float32)}
        write_table(self.folder / "frames.parquet", columns, "frames", Provenance({}, "", ""))
        row = {"source": "nominal", "scale": 1.0, "bias": 0.0, "temperature": None}
        write_json(self.folder / "integrity.json", {"rate_hz": RATE_HZ, "clocks": []})
        write_json(self.folder / "calibration.json", {"gyros": dict.fromkeys(self.gyros, row)})

    def convert(self) -> None:
        """rates.parquet from frames.parquet."""
        inputs = {"frames": "frames.parquet", "integrity": "integrity.json", "calibration": "calibration.json"}
        self.run(convert, {**inputs, "reference": []}, ("rates",))

    def all(self) -> None:
        """Everything from frames.parquet on."""
        self.convert()
        self.run(noise, {"rates": "rates.parquet"}, ("noise.json",))
        weights = self.weights() if self.volatility else {"weights": [], "moved": []}
        self.run(faults, {"rates": "rates.parquet", "calibration": "calibration.json"}, ("faults",))
        self.run(
            fuse, {"rates": "rates.parquet", "noise": "noise.json", "faults": "faults.parquet", **weights},
            ("fused", "methods", "moved"), injected_rate=0.05,
        )  # fmt: skip
        self.run(measure, {name: f"{name}.parquet" for name in ("rates", "fused", "methods", "moved")}, TABLES)

    def weights(self) -> dict[str, list[str]]:
        self.run(series, {"rates": "rates.parquet"}, ("series",))
        for definition in (*DEFINITIONS, "moved"):
            (self.folder / definition).mkdir(exist_ok=True)
            outputs = tuple(f"{definition}/{name}.parquet" for name in ("garch", "dcc", "arch_lm", "weights", "fits"))
            added = 0.05 if definition == "moved" else None
            self.run(assemble, {"series": "series.parquet"}, outputs, definition=definition, injected_rate=added)
        return {"weights": [f"{name}/weights.parquet" for name in DEFINITIONS], "moved": ["moved/weights.parquet"]}

    def crosscheck(self) -> dict[str, np.ndarray]:
        inputs = {name: f"{name}.parquet" for name in ("rates", "fused", "methods", "allan", "series")}
        tables = {name: [f"{one}/{name}.parquet" for one in DEFINITIONS] for name in ("garch", "dcc", "weights")}
        self.run(crosscheck, {**inputs, "noise": "noise.json", **tables}, ("crosscheck",))
        return self.table("crosscheck")

    def table(self, name: str) -> dict[str, np.ndarray]:
        return read_columns(self.folder / f"{name}.parquet")

    def metadata(self, name: str) -> dict:
        return read_metadata(self.folder / f"{name}.parquet")

    def noise(self) -> dict:
        return read_json(self.folder / "noise.json")

    def metrics(self) -> dict[tuple[str, str], tuple[float, float, float]]:
        """(method or gyro[definition], metric) → value, low, high, as the recording is."""
        table = self.table("metrics")
        names = ("method", "definition", "true_rate", "metric", "value", "low", "high")
        rows = zip(*(table[name] for name in names), strict=True)
        return {
            (f"{method}[{definition}]" if definition else method, metric): (value, low, high)
            for method, definition, rate, metric, value, low, high in rows
            if rate == 0
        }

    def columns(self) -> dict[str, str]:
        """Column of each method that ran, and "" or the reason of those that did not."""
        table = self.table("methods")
        rows = zip(table["method"], table["definition"], table["column"], table["note"], strict=True)
        return {f"{method}[{definition}]": column or f"none: {note}" for method, definition, column, note in rows}


def white(seconds: float, gyros: int, seed: int = 1) -> np.ndarray:
    """Gyros of SIGMA a sample, with biases of their own."""
    rng = np.random.default_rng(seed)
    return rng.normal(0, 0.3, gyros) + SIGMA * rng.standard_normal((round(seconds * RATE_HZ), gyros))

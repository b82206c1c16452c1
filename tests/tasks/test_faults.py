"""The task faults through files, and what fuse reads of it."""

import json

import numpy as np
import pytest
from task_options import complete

from vgyro.storage.tables import Provenance, read_columns, read_metadata, write_json, write_table
from vgyro.tasks.common import Task
from vgyro.tasks.fusion import faults
from vgyro.tasks.fusion.array_inputs import open_array

GYROS = ("g1", "g2", "g3", "g4")
RATE_HZ, SECONDS, GAP_AT, GAP_S = 20.0, 600, 8000, 2.0
SCALE, BIAS = 0.01, 150.0
STUCK, DROPPED = slice(3000, 3100), slice(5000, 5200)


def board():
    fields = [{"name": gyro, "type": "i16", "at": 2 + 2 * index} for index, gyro in enumerate((*GYROS, "t", "u"))]
    frame = {"kind": "binary", "sync": "EB90", "length": 20, "fields": fields, "checksum": {"family": "none"}}
    rows = [{"name": gyro, "field": gyro, "axis": "z", "scale": SCALE} for gyro in GYROS]
    temperatures = [{"name": "t", "field": "t", "gyro": "g1", "scale": 1.0, "offset": 0.0},
                    {"name": "u", "field": "u", "scale": 1.0, "offset": 0.0}]  # fmt: skip
    return {"name": "small", "title": "small", "rate_hz": RATE_HZ, "frame": frame, "gyros": rows,
            "temperatures": temperatures}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    """Rates in counts of 0.01 deg/s: g2 is stuck, g3 drops to a count of zero, g4 is off from sample 10000 on."""
    rng = np.random.default_rng(5)
    samples = int(SECONDS * RATE_HZ)
    segment = (np.arange(samples) >= GAP_AT).astype(np.int32)
    time = np.arange(samples) / RATE_HZ + GAP_S * segment
    rate = np.rint(rng.standard_normal((samples, len(GYROS))) * 0.4 / SCALE) * SCALE
    rate[STUCK, 1] = rate[STUCK.start - 1, 1]
    rate[DROPPED, 2] = -BIAS * SCALE
    rate[10000:, 3] += 2.0
    columns = {"time": time, "segment": segment, "at_rest": np.full(samples, True), "temp_t": 25 + time / 100,
               "temp_u": np.zeros(samples)}  # fmt: skip
    columns |= {gyro: rate[:, index] for index, gyro in enumerate(GYROS)}
    extra = {"rate_hz": RATE_HZ, "calibration": dict.fromkeys(GYROS, "measured"),
             "temperature": {gyro: {"applied": False} for gyro in GYROS}}  # fmt: skip
    write_table(tmp_path / "rates.parquet", columns, "rates", Provenance({}, "", ""), extra)
    row = {"scale": SCALE, "bias": BIAS, "temperature": None}
    write_json(tmp_path / "calibration.json", {"gyros": dict.fromkeys(GYROS, row)})
    noise = {"gyros": list(GYROS), "arw": dict.fromkeys(GYROS, 0.1), "rrw": dict.fromkeys(GYROS, 0.001),
             "rrw_source": dict.fromkeys(GYROS, "fitted"), "correlation": np.eye(len(GYROS)).tolist()}  # fmt: skip
    write_json(tmp_path / "noise.json", noise)
    return tmp_path


def task_of(folder, *names, **analysis):
    options = {
        "board": board(),
        "axis": "z",
        "recording": "r",
        "kind": "static",
        "injected_rate": None,
        "analysis": complete(analysis),
    }
    files = {"rates": "rates.parquet", "noise": "noise.json", "calibration": "calibration.json",
             "faults": "faults.parquet"}  # fmt: skip
    inputs = {name: [folder / files[name]] for name in names}
    return Task(inputs, {"faults": folder / "faults.parquet"}, json.loads(json.dumps(options)), "code")


def found_in(folder, **analysis):
    faults.main(task_of(folder, "rates", "calibration", **analysis))
    return read_columns(folder / "faults.parquet"), read_metadata(folder / "faults.parquet")


def test_events_in_seconds(folder):
    # Truth: the three faults as they were put in. A stuck gyro repeats the sample before, which counts as the first.
    table, metadata = found_in(folder)
    rows = list(zip(table["gyro"], table["kind"], table["start"], table["stop"], strict=True))
    step = table["start"][2]
    assert rows == [
        ("g2", "stuck", (STUCK.start - 1) / RATE_HZ, (STUCK.stop - 1) / RATE_HZ),
        ("g3", "dropout", DROPPED.start / RATE_HZ, (DROPPED.stop - 1) / RATE_HZ),
        ("g4", "step", step, (SECONDS * RATE_HZ - 1) / RATE_HZ + GAP_S),
    ]
    assert step == pytest.approx(10000 / RATE_HZ + GAP_S, abs=1)
    assert table["size"][2] == pytest.approx(2.0, abs=0.1)
    assert table["sentence"][2].startswith("g4: the bias jumps by +2.0")
    assert ", from 502 s to the end (" in table["sentence"][2]
    assert metadata["note"] == ""


def test_fuse_reads_the_events_in_samples(folder):
    found_in(folder)
    rates = open_array(task_of(folder, "rates", "noise", "faults")).rates
    spans = [(one.gyro, one.kind, one.start, one.stop) for one in rates.faults]
    assert spans[:2] == [
        (1, "stuck", STUCK.start - 1, STUCK.stop),
        (2, "dropout", DROPPED.start, DROPPED.stop),
    ]
    assert spans[2][:2] == (3, "step")
    assert spans[2][3] == len(rates.rate)
    np.testing.assert_allclose(rates.stretch_time, [0.0, GAP_AT / RATE_HZ + GAP_S])


def test_temperature_is_that_of_the_gyros_or_of_the_board(folder):
    # g1 has a thermometer of its own: the board's is left out.
    temperature = open_array(task_of(folder, "rates", "noise")).rates.temperature
    np.testing.assert_allclose(temperature, 25 + read_columns(folder / "rates.parquet")["time"] / 100, rtol=1e-6)
    assert open_array(task_of(folder, "rates", "noise", fusion={"temperature": "off"})).rates.temperature is None
    assert open_array(task_of(folder, "rates", "noise")).rates.faults == ()


def test_switched_off(folder):
    table, metadata = found_in(folder, faults={"detect": "off"})
    assert len(table["gyro"]) == 0
    assert metadata["note"] == "analysis.faults.detect is off: nothing was looked for"
    assert open_array(task_of(folder, "rates", "noise", "faults")).rates.faults == ()

"""The task more_gyros: noise and correlation in, the table and its summary out."""

from pathlib import Path

import numpy as np
import pytest
from task_options import complete

from vgyro.storage.schemas import SCHEMAS
from vgyro.storage.tables import Provenance, read_columns, read_metadata, write_json, write_table
from vgyro.tasks.common import Task
from vgyro.tasks.fusion import more_gyros

GYROS = ["g1", "g2", "g3"]


def board() -> dict:
    channels = {"name": "rate", "type": "i16", "count": 3, "at": 2}
    frame = {"kind": "binary", "sync": "EB90", "length": 8, "fields": [channels], "checksum": {"family": "none"}}
    gyros = [
        {"name": name, "field": f"rate{place + 1}", "axis": "z", "scale": 0.01} for place, name in enumerate(GYROS)
    ]
    return {"name": "b", "title": "b", "rate_hz": 200.0, "frame": frame, "gyros": gyros}


def run(
    folder: Path, value: np.ndarray, kind: str = "static", fusion: dict | None = None, moved: bool = False
) -> tuple[dict, dict]:
    """Table and summary for the correlation matrix `value`, limits 0.03 off; gyros of 0.1 deg/s/√Hz."""
    flat = dict.fromkeys(GYROS, 0.1)
    noise = {"gyros": GYROS, "arw": flat, "rrw": flat, "rrw_source": dict.fromkeys(GYROS, "fitted")}
    write_json(folder / "noise" / "z.json", {**noise, "correlation": np.eye(3).tolist()})
    # The order of the file is not that of the board.
    pairs = [(a, b) for a in reversed(range(3)) for b in range(3)]
    table = {"gyro": [GYROS[a] for a, _ in pairs], "other": [GYROS[b] for _, b in pairs]}
    for name, off in (("correlation", 0.0), ("low", -0.03), ("high", 0.03)):
        table[name] = [float(value[place] + off * (place[0] != place[1])) for place in pairs]
    write_table(folder / "correlation.parquet", table, "correlation", Provenance({}, "", ""))
    still = {"time": np.arange(3) / 200, "segment": np.zeros(3, np.int32), "at_rest": np.full(3, kind == "static")}
    extra = {"rate_hz": 200.0, **({"moved": {"share": 0.5, "stretches": [[0.0, 0.1]]}} if moved else {})}
    write_table(folder / "rates.parquet", still, "rates", Provenance({}, "", ""), extra)
    inputs = {"rates": [folder / "rates.parquet"], "noise": [folder / "noise" / "z.json"]}
    inputs["correlation"] = [folder / "correlation.parquet"]
    options = {"board": board(), "axis": "z", "kind": kind, "analysis": complete({"fusion": fusion or {}})}
    out = folder / "more_gyros.parquet"
    more_gyros.main(Task(inputs, {"more_gyros": out}, options, "code"))
    return read_columns(out), read_metadata(out)


MATRIX = np.array([[1, 0.1, 0.2], [0.1, 1, 0.3], [0.2, 0.3, 1]])


def test_table(tmp_path):
    table, metadata = run(tmp_path, MATRIX, fusion={"most_gyros": 10})
    assert list(table) == [column.name for column in SCHEMAS["more_gyros"].columns]
    measured = table["measured"]
    assert table["gyros"][measured].tolist() == list(range(1, 11))
    # Expected: mean correlation 0.2: N = 3 gives √(3/1.4); present array of three, correlation none: 0.1/√3.
    assert np.unique(table["correlation"][measured]) == pytest.approx(0.2)
    assert table["factor"][measured][2] == pytest.approx(np.sqrt(3 / 1.4))
    assert table["over_present"][measured][2] == pytest.approx(np.sqrt(1 / 1.4))
    summary = metadata["summary"]
    assert summary["correlation"][0] == pytest.approx(0.2)
    # Expected: between the width of independent pairs and that of one pair.
    assert 0.03 / 3**0.5 < summary["correlation"][2] - 0.2 < 0.03
    assert summary["gyros"] == 3
    assert metadata["units"]["arw"] == "deg/s/√Hz"


def test_bandwidth_in_motion(tmp_path):
    # Expected: at a bandwidth P∞ = 2π·BW/D, so 5 Hz instead of 1 Hz is √5 in √P∞.
    still, _ = run(tmp_path, MATRIX)
    moving, _ = run(tmp_path, MATRIX, kind="sinusoid")
    np.testing.assert_allclose(moving["sd"] / still["sd"], np.sqrt(5))
    # A static recording in which the board moved is none.
    moved, _ = run(tmp_path, MATRIX, moved=True)
    np.testing.assert_allclose(moved["sd"], moving["sd"])
    # Expected: 6 °/√h is 0.1 deg/s/√Hz, as measured here.
    given, _ = run(tmp_path, MATRIX, fusion={"arw_deg_rt_h": 12.0})
    np.testing.assert_allclose(given["arw"] / still["arw"], 2)


def test_correlation_that_is_not_known(tmp_path):
    table, metadata = run(tmp_path, np.where(np.eye(3) == 1, 1.0, np.nan))
    assert metadata["summary"]["correlation"] is None
    assert not table["measured"].any()
    assert len(table["gyros"]) == 4 * 48

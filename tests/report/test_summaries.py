"""What the report reads of long tables, against the same tables read whole."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from vgyro.storage.tables import Provenance, TableWriter, read_columns, write_table
from vgyro.tasks.pages.rates import read_rates
from vgyro.tasks.pages.volatility import read_dcc, read_garch, read_weights

PROVENANCE = Provenance({}, "", "")
WINDOWS, GYROS = 5000, ("g1", "g2")


def test_garch_is_summed_up_a_gyro(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = (WINDOWS + 1) * len(GYROS)
    alpha = np.where(rng.random(rows) < 0.1, np.nan, rng.random(rows))
    status = np.where(np.isnan(alpha), "no variance", np.where(rng.random(rows) < 0.3, "boundary: α = 0", "converged"))
    window = np.repeat(np.arange(-1, WINDOWS), len(GYROS))
    columns = {
        "window": window, "gyro": pa.array(np.tile(GYROS, WINDOWS + 1)).dictionary_encode(), "alpha": alpha,
        "beta": 1 - alpha, "omega": alpha, "se_alpha": alpha / 10, "se_beta": alpha / 10,
        "status": pa.array(status).dictionary_encode(),
    }  # fmt: skip
    write_table(tmp_path / "garch.parquet", columns, "garch", PROVENANCE)
    first, second = read_garch(tmp_path / "garch.parquet", (*GYROS, "g3"))
    mine = (np.arange(rows) % 2 == 1) & (window >= 0)
    assert (first.gyro, second.gyro, second.windows) == ("g1", "g2", WINDOWS)
    assert second.alpha == np.nanmedian(alpha[mine])
    assert second.beta == np.nanmedian(1 - alpha[mine])
    assert second.statuses == {name: int((status[mine] == name).sum()) for name in second.statuses}
    assert sum(second.statuses.values()) == WINDOWS
    assert second.whole is not None
    assert np.array_equal(second.whole["omega"], alpha[1], equal_nan=True)


def test_dcc_without_a_model_has_a_reason_and_no_curve(tmp_path: Path) -> None:
    nothing = np.full(3, np.nan)
    names = ("a", "b", "se_a", "se_b", "p_value", "p_value_s", "statistic", "time_stop")
    columns = {**dict.fromkeys(names, nothing), "window": np.array([-1, 0, 1]), "status": ["one gyro"] * 3}
    write_table(tmp_path / "dcc.parquet", columns, "dcc", PROVENANCE)
    found = read_dcc(tmp_path / "dcc.parquet")
    assert (found.windows, found.statuses) == (2, {"one gyro": 2})
    assert np.isnan([found.a, found.b, found.rejects["p_value"]]).all()
    assert len(found.curves["time"]) == 0


def test_weights_are_picked_block_by_block(tmp_path: Path) -> None:
    samples = 3000
    blocks = [["dcc", "in_sample"], ["dcc", "causal"]]
    path = tmp_path / "weights.parquet"
    with TableWriter(path, "weights", PROVENANCE, {"blocks": blocks, "samples": samples}) as writer:
        for number, (model, mode) in enumerate(blocks):
            for start in range(0, samples, 700):
                time = np.arange(start, min(start + 700, samples), dtype=float)
                figures = {"sigma": time, "w_g1": time + 10_000 * number, "sd_g1": time}
                status = np.where(time < 600 * number, "no model yet", "ok")
                writer.append({"time": time, "model": [model] * len(time), "mode": [mode] * len(time), **figures,
                               "status": pa.array(status).dictionary_encode()})  # fmt: skip
    first, second = read_weights(path, ("g1",))
    assert (first.mode, first.statuses) == ("in_sample", {"ok": 3000})
    assert (second.mode, second.statuses) == ("causal", {"ok": 2400, "no model yet": 600})
    assert len(second.curves["time"]) == 600
    assert (second.curves["time"][0], second.curves["time"][-1]) == (0, 2999)
    assert np.array_equal(second.curves["w_g1"], second.curves["time"] + 10_000)


@pytest.mark.parametrize("samples", [500, 600_000])
def test_rates_are_thinned_with_their_rest(tmp_path: Path, samples: int) -> None:
    rng = np.random.default_rng(2)
    time = np.arange(samples) / 200
    rate = rng.standard_normal(samples)
    at_rest = (np.arange(samples) // (samples // 5)) % 2 == 0
    path = tmp_path / "rates.parquet"
    columns = {"time": time, "segment": np.zeros(samples, dtype=np.int32), "at_rest": at_rest, "temp_t1": 20 + time,
               "g1": rate.astype(np.float32), "reference": np.full(samples, np.nan)}  # fmt: skip
    write_table(path, columns, "rates", PROVENANCE, {"rate_hz": 200.0, "delays": {}})
    found = read_rates(path, ["g1", "g2"])
    stored = read_columns(path, ["g1"])["g1"]
    assert list(found.gyros) == ["g1"]
    assert (found.gyros["g1"].min(), found.gyros["g1"].max()) == (stored.min(), stored.max())
    assert found.rest["g1"].size == found.gyros["g1"].size <= 2000
    assert np.nanmax(found.rest["g1"]) == stored[at_rest].max()
    fifth = samples // 5
    assert found.spans == tuple((time[k * fifth], time[(k + 1) * fifth - 1]) for k in (0, 2, 4))
    assert found.still == at_rest.mean()
    assert found.reference is None
    assert np.array_equal(found.temperatures["t1"], 20 + found.temperature_time)

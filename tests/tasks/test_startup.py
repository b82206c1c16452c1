"""What a job loads: pandas only where it is used, and then it works with pyarrow as ever."""

from __future__ import annotations

import subprocess
import sys

TABLES = """
import sys
from vgyro.tasks.startup import keep_pandas_away
keep_pandas_away()
import numpy as np, pyarrow as pa, pyarrow.parquet as pq
mixed = {"text": ["a", None], "list": [[1.0], None], "whole": [1, None], "flag": [True, False], "x": np.arange(2.0)}
pq.write_table(pa.table(mixed), sys.argv[1])
read = pq.ParquetFile(sys.argv[1]).read()
assert read.column("text").to_numpy().tolist() == ["a", None]
assert read.column("x").to_numpy().tolist() == [0.0, 1.0]
"""
WITHOUT = TABLES + "assert 'pandas' not in sys.modules\n"
WITH = (
    TABLES
    + """
import pandas as pd
frame = pd.read_parquet(sys.argv[1])
assert frame["x"].tolist() == [0.0, 1.0]
assert frame["text"].isna().tolist() == [False, True]
assert pa.table({"x": frame["x"]}).num_rows == 2
"""
)


def run(program: str, file: str) -> None:
    done = subprocess.run([sys.executable, "-c", program, file], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_tables_are_written_and_read_without_pandas(tmp_path) -> None:
    run(WITHOUT, str(tmp_path / "table.parquet"))


def test_pandas_is_there_for_who_wants_it(tmp_path) -> None:
    run(WITH, str(tmp_path / "table.parquet"))

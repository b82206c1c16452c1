"""docs/file-formats.md as text, from the declared schemas, the registry of methods and the list of figures."""

from __future__ import annotations

from collections.abc import Iterator

from vgyro.fusion import METHODS
from vgyro.metrics import FIGURES
from vgyro.storage.schemas import SCHEMAS, Schema

HEAD = """\
# File formats

Everything below `results/` is Parquet or JSON. Each Parquet file holds, in its metadata under the key `vgyro`, a JSON
record: the name and version of its schema, the unit of each column, and the SHA-256 of its inputs, of the options it
used and of the code that made it. No file holds a clock time or a random id: the same inputs give the same bytes.

    import json, pyarrow.parquet as pq
    json.loads(pq.read_schema("metrics.parquet").metadata[b"vgyro"])["units"]

A column name with braces stands for one column for each gyro, channel, temperature sensor or method. Unit "1" is a pure
number; an empty unit means that units make no sense there. This page is written from the code
(`python -m vgyro.cli.documents`): do not edit it by hand.

## Where each file is

| file | schema |
|---|---|
| `results/<dataset>/<recording>/frames.parquet` | frames |
| `results/<dataset>/<recording>/integrity.json` | JSON: status, reasons, frames, gaps, damage, channels, rate |
| `results/<dataset>/calibration.json` | JSON: scale factor and bias of each gyro, with intervals |
| `results/<dataset>/<recording>/rates.parquet` | rates |
| `results/<dataset>/noise/<axis>.json` | JSON: random walks, correlation, Allan covariances of an array's gyros |
| `results/<dataset>/<recording>/<axis>/<definition>/*.parquet` | arch_lm, garch, dcc, weights |
| `results/<dataset>/<recording>/<axis>/*.parquet` | fused, methods, allan, spectrum, correlation, metrics, crosscheck |
| `raw/<twin>/truth/<recording>.parquet` | truth, of simulated data |
"""
METRICS_HEAD = """
## Figures in metrics.parquet

One row a figure: other programs may rely on the columns, and on the names below.

| metric | title | unit | meaning |
|---|---|---|---|
"""
METHODS_HEAD = """
## Methods

Names in `analysis.fusion.methods`, in the column `method` and in fused.parquet. A method that runs once for each
definition of r_t has columns such as `dcc_causal[level]`. Causal: sample t uses nothing later than t.

| method | title | source | causal | needs |
|---|---|---|---|---|
"""


def file_formats() -> str:
    """The text of docs/file-formats.md."""
    parts = [HEAD]
    for schema in SCHEMAS.values():
        parts += _schema(schema)
    parts.append(METRICS_HEAD)
    parts += [f"| `{name}` | {f.title} | {f.unit} | {_cell(f.meaning)} |\n" for name, f in FIGURES.items()]
    parts.append(METHODS_HEAD)
    for name, method in METHODS.items():
        if method.package:
            continue  # The document is of vgyro; another package has its own.
        needs = ", ".join([*method.needs, *(["one run a definition"] if method.per_definition else [])])
        causal = "yes" if method.causal else "no"
        parts.append(f"| `{name}` | {method.title} | {_cell(method.source)} | {causal} | {needs} |\n")
    return "".join(parts)


def _schema(schema: Schema) -> Iterator[str]:
    yield f"\n## {schema.name}, version {schema.version}\n\n{schema.meaning[:1].upper()}{schema.meaning[1:]}.\n\n"
    yield "| column | unit | meaning |\n|---|---|---|\n"
    for column in schema.columns:
        yield f"| `{column.name}` | {column.unit} | {_cell(column.meaning)} |\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")

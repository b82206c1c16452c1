"""Logs of three gyros as files of several kinds, and what the pipeline's reader makes of them."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vgyro.config import IntegrityOptions
from vgyro.dataset import Recording
from vgyro.log import Log
from vgyro.storage import open_recording
from vgyro.storage.frames import gather

AXES = ("gyro_x", "gyro_y", "gyro_z")
COUNT = 5000


def counts():
    """Values of the three gyros [COUNT, 3]."""
    return np.random.default_rng(1).integers(-50, 50, (COUNT, 3)).astype(np.int16)


def frames_of(paths, board, options=None, **log):
    """Read a recording of a board; keys of `log` of its manifest. Gives Frames with the record."""
    recording = Recording(name="a", kind="static", files=("x",), log=Log(**log))
    paths = paths if isinstance(paths, list) else [paths]
    reader = open_recording(paths, recording, board, options or IntegrityOptions())
    frames = gather(reader, board)
    return frames._replace(integrity=reader.integrity)


def write(path, values, names=AXES, **more):
    """Write columns as Parquet."""
    path.parent.mkdir(parents=True, exist_ok=True)
    columns = {name: values[:, index] for index, name in enumerate(names)}
    pq.write_table(pa.table({**columns, **more}), path)
    return path


def stack(frames):
    """The gyros' columns [T, 3]."""
    return np.column_stack([frames.counts[name] for name in AXES])


def write_as(kind, path, values, time=None, names=AXES):
    """Values [T, 3], with a time column unless time is None. Gives the path, with its ending."""
    path = path.with_suffix(f".{kind}")
    if kind == "parquet":
        return write(path, values, names, **({} if time is None else {"t": time}))
    table = values if time is None else np.column_stack([time, values])
    if kind == "npy":
        np.save(path, table)
        return path
    header = ",".join([*([] if time is None else ["t"]), *names])
    rows = [",".join(f"{value:.10g}" for value in row) for row in table]
    path.write_text("\n".join([header, *rows]) + "\n")
    return path

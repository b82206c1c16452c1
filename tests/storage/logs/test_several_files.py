"""Recordings of several files and tables, of texts and ids: restarts, damage, and one bad file of three."""

from decimal import Decimal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from log_files import AXES, COUNT, counts, frames_of, stack, write, write_as

from vgyro.config import IntegrityOptions
from vgyro.dataset import parse_manifest
from vgyro.errors import DataError
from vgyro.log import Log, board_of_log
from vgyro.storage import open_recording
from vgyro.storage.frames import gather
from vgyro.storage.logs import files
from vgyro.storage.logs.families import open_log
from vgyro.storage.logs.table import LogRows

KINDS = ("csv", "parquet", "npy")


@pytest.fixture
def values():
    return counts()


@pytest.fixture
def read(board):
    return lambda paths, options=None, **log: frames_of(paths, board("adis16405"), options, **log)


@pytest.fixture
def three(values, tmp_path):
    """Three files of 1000 rows each, at 100 Hz; stamps go on from file to file, or begin again."""

    def make(kind, again=False):
        stamps = np.arange(3000) / 100
        if again:
            stamps = np.tile(stamps[:1000], 3)
        return [
            write_as(kind, tmp_path / f"part{place}", values[rows], stamps[rows])
            for place, rows in enumerate(slice(start, start + 1000) for start in (0, 1000, 2000))
        ]

    return make


@pytest.fixture
def npy_names(tmp_path):
    """What the columns of an array are called."""
    np.save(tmp_path / "names.npy", np.zeros((5, 4)))
    return [column.name for column in open_log(tmp_path / "names.npy", Log()).tables[0].columns]


def log_of(kind, npy_names, timed=True):
    if kind != "npy":
        return {"time": "t"} if timed else {}
    return {"columns": dict(zip(AXES, npy_names[1:], strict=True)), "time": npy_names[0]}


@pytest.mark.parametrize("kind", KINDS)
def test_stamps_go_on_from_file_to_file(read, values, three, npy_names, kind):
    frames = read(three(kind), **log_of(kind, npy_names))
    record = frames.integrity
    assert np.array_equal(stack(frames), values[:3000])
    assert (record.restarts, record.segments, record.frames.lost, record.status) == (0, 1, 0, "good")
    assert frames.time == pytest.approx(np.arange(3000) / 100, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_each_file_that_begins_at_zero_is_a_restart(read, three, npy_names, kind):
    record = read(three(kind, again=True), **log_of(kind, npy_names)).integrity
    assert (record.restarts, record.segments, record.frames.good) == (2, 3, 3000)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("harm", ["missing", "empty", "cut at its head"])
def test_a_bad_file_of_three_is_named_and_the_rest_is_analysed(read, values, three, npy_names, kind, harm):
    paths = three(kind)
    if harm == "missing":
        paths[1].unlink()
    else:
        paths[1].write_bytes(paths[1].read_bytes()[: 0 if harm == "empty" else 8])
    frames = read(paths, **log_of(kind, npy_names))
    record = frames.integrity
    assert np.array_equal(stack(frames), np.concatenate([values[:1000], values[2000:3000]]))
    assert record.status == "suspect"
    assert paths[1].name in record.reasons[0]
    assert (record.frames.lost, record.segments) == (1000, 2)


def test_what_is_before_a_cut_is_read(read, values, three):
    paths = three("csv")
    whole = paths[1].read_bytes()
    paths[1].write_bytes(whole[: len(whole) // 2])
    frames = read(paths, time="t")
    good = frames.integrity.frames.good
    assert 2400 < good < 2600
    assert np.array_equal(stack(frames)[: good - 1000], values[: good - 1000])
    assert paths[1].name in " ".join([*frames.integrity.warnings, *frames.integrity.reasons])


def test_columns_in_another_order_in_the_second_file(read, values, tmp_path):
    time = np.arange(2000) / 100
    one = write_as("csv", tmp_path / "a", values[:1000], time[:1000])
    order = [2, 0, 1]
    two = write_as("csv", tmp_path / "b", values[1000:2000][:, order], time[1000:], [AXES[place] for place in order])
    assert np.array_equal(stack(read([one, two], time="t")), values[:2000])


def test_a_column_that_is_missing_in_the_second_file_is_named(read, values, tmp_path):
    time = np.arange(2000) / 100
    one = write_as("csv", tmp_path / "a", values[:1000], time[:1000])
    two = write_as("csv", tmp_path / "b", values[1000:2000, :2], time[1000:], AXES[:2])
    record = read([one, two], time="t").integrity
    assert record.frames.good == 1000
    assert record.status == "suspect"
    assert f"{two}: has no column 'gyro_z'" in record.reasons[0]


def test_files_of_several_families_make_one_recording(read, values, tmp_path):
    time = np.arange(2000) / 100
    one = write_as("csv", tmp_path / "a", values[:1000], time[:1000])
    two = write_as("parquet", tmp_path / "b", values[1000:2000], time[1000:])
    frames = read([one, two], time="t")
    assert np.array_equal(stack(frames), values[:2000])
    assert frames.integrity.segments == 1


def test_a_folder_with_notes_beside_the_logs(read, values, tmp_path):
    folder = tmp_path / "log"
    for place in range(3):
        write(folder / f"{place}.parquet", values[place * 1000 : (place + 1) * 1000])
    (folder / "README.txt").write_text("Gyros of March.\n")
    (folder / ".hidden.parquet").write_bytes(b"")
    assert np.array_equal(stack(read(folder)), values[:3000])


def test_whole_numbers_with_one_empty_cell(read, values, tmp_path):
    path = write_as("csv", tmp_path / "a", values[:1000], np.arange(1000) / 100)
    lines = path.read_text().splitlines()
    cells = lines[501].split(",")
    lines[501] = ",".join([*cells[:2], "", cells[3]])
    path.write_text("\n".join(lines) + "\n")
    frames = read(path, time="t")
    assert frames.integrity.channels["gyro_y"].missing == 1
    assert np.isnan(frames.counts["gyro_y"]).nonzero()[0].tolist() == [500]
    assert np.array_equal(frames.counts["gyro_x"], values[:1000, 0])


def test_booleans_and_decimals_are_numbers(read, values, tmp_path):
    columns = {
        "gyro_x": values[:200, 0] > 0,
        "gyro_y": pa.array([Decimal(int(value)) / 4 for value in values[:200, 1]], pa.decimal128(10, 2)),
        "gyro_z": pa.array(values[:200, 2].astype(np.float16)),
    }
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    frames = read(tmp_path / "a.parquet")
    assert np.array_equal(frames.counts["gyro_x"], values[:200, 0] > 0)
    assert np.array_equal(frames.counts["gyro_y"], values[:200, 1] / 4)
    assert np.array_equal(frames.counts["gyro_z"], values[:200, 2])


@pytest.mark.parametrize(("ids", "where"), [
    (np.array([1, 2]), 2), (np.array([1.0, 2.0]), 2), (np.array(["1", "2"]), 2), (np.array([1, 2]), "2"),
    (np.array(["left", "right"]), "right"), (np.array(["left", " right "]), "right"), (np.array([False, True]), 1),
])  # fmt: skip
def test_ids_are_numbers_or_text(read, values, tmp_path, ids, where):
    path = write(tmp_path / "a.parquet", values, id=np.tile(ids, COUNT // 2))
    columns = {name: {"column": name, "where": {"id": where}} for name in AXES}
    assert np.array_equal(stack(read(path, columns=columns)), values[1::2])


def test_an_id_that_is_not_there(read, values, tmp_path):
    path = write(tmp_path / "a.parquet", values, id=np.ones(COUNT, int))
    for where in (7, "seven"):
        with pytest.raises(DataError, match=f"id = {where}: has no row"):
            read(path, columns={name: {"column": name, "where": {"id": where}} for name in AXES})
    with pytest.raises(DataError, match="has no column 'idd'; did you mean 'id'"):
        read(path, columns={name: {"column": name, "where": {"idd": 1}} for name in AXES})


def test_unknown_tables_and_files_ask_whether_others_were_meant(read, values, tmp_path):
    np.savez(tmp_path / "a.npz", first=values[:100].astype(float), second=values[:100].astype(float))
    with pytest.raises(DataError, match="has no table 'frist'; did you mean 'first'"):
        read(tmp_path / "a.npz", table="frist", columns=dict(zip(AXES, ("a", "b", "c"), strict=True)))
    path = write(tmp_path / "a.parquet", values)
    with pytest.raises(DataError, match=r"fits 'a.parket'; did you mean 'a.parquet'"):
        read(path, columns={"gyro_x": {"column": "gyro_x", "file": "a.parket"}})


def test_a_file_of_a_gyro_that_cannot_be_read_is_named(read, values, tmp_path):
    paths = [write(tmp_path / f"{name}.parquet", values[:, :1], ("z",)) for name in "abc"]
    paths[1].write_bytes(b"")
    columns = {axis: {"column": "z", "file": path.name} for axis, path in zip(AXES, paths, strict=True)}
    with pytest.raises(DataError, match=r"gyros stand in b.parquet, which cannot be read: .*is empty: 0 bytes"):
        read(paths, columns=columns)


def damaged_text(values, path, bad=(300, 301, 700)):
    """A text without time, three of whose lines are cut."""
    rows = [",".join(str(value) for value in row) for row in values]
    for place in bad:
        rows[place] = rows[place].split(",")[0] + ",x"
    path.write_text("\n".join([",".join(AXES), *rows]) + "\n")
    return path


def test_without_time_a_damaged_line_is_a_lost_sample(read, values, tmp_path):
    frames = read(damaged_text(values[:1000], tmp_path / "a.csv"))
    record = frames.integrity
    assert (record.frames.good, record.frames.bad, record.frames.lost, record.segments) == (997, 3, 3, 3)
    assert [(gap.time, gap.frames_lost) for gap in record.gaps] == [(pytest.approx(3.0), 2), (pytest.approx(7.0), 1)]
    kept = np.delete(np.arange(1000), [300, 301, 700])
    assert np.array_equal(stack(frames), values[kept])
    assert frames.time == pytest.approx(kept / 100)
    assert [damage.start for damage in record.damage] == [302, 303, 702]


def test_damage_before_the_first_row_is_no_loss(read, values, tmp_path):
    record = read(damaged_text(values[:1000], tmp_path / "a.csv", bad=(0, 500))).integrity
    assert (record.frames.good, record.frames.lost) == (998, 1)


def test_rows_without_value_at_both_ends_and_in_the_middle(read, values, tmp_path):
    holes = values[:1000].astype(float)
    holes[[0, 1, 500, 998, 999]] = np.nan
    frames = read(write(tmp_path / "a.parquet", holes, t=np.arange(1000) / 100), time="t")
    record = frames.integrity
    assert (record.frames.good, record.frames.bad, record.frames.lost) == (995, 5, 1)
    assert np.array_equal(stack(frames), np.delete(values[:1000], [0, 1, 500, 998, 999], axis=0))
    assert np.diff(frames.time) == pytest.approx(np.where(np.arange(994) == 497, 0.02, 0.01))
    assert frames.segment[[497, 498]].tolist() == [frames.segment[0], frames.segment[0] + 1]


class Splitting:
    """A log whose rows come a few at a time."""

    def __init__(self, log, size):
        self.log, self.size = log, size

    def __getattr__(self, name):
        return getattr(self.log, name)

    def rows(self, table, columns):
        for rows in self.log.rows(table, columns):
            bad = list(rows.bad)
            place, number = rows.place, 0
            for start in range(0, rows.batch.num_rows, self.size):
                part = rows.batch.slice(start, self.size)
                last = start + self.size >= rows.batch.num_rows
                mine = [line for line in bad if last or line.place < place + part.num_rows + number + 1]
                bad = bad[len(mine) :]
                yield LogRows(part, place, tuple(mine))
                place += part.num_rows + len(mine)
            if not rows.batch.num_rows:
                yield rows


@pytest.mark.parametrize("size", [1, 7, 64, 999])
@pytest.mark.parametrize("case", ["damage", "holes and repeats", "restart"])
def test_results_do_not_depend_on_the_size_of_batches(read, values, tmp_path, monkeypatch, case, size):
    if case == "damage":
        path, log = damaged_text(values[:1000], tmp_path / "a.csv"), {}
    else:
        holes = values[:1000].astype(float)
        holes[[63, 64, 500]] = np.nan
        holes[700, 1] = np.inf
        rows = np.insert(np.arange(1000), 321, 320)
        time = np.arange(1000) / 100
        time[600:] -= 6 if case == "restart" else 0
        path, log = write(tmp_path / "a.parquet", holes[rows], t=time[rows]), {"time": "t"}
    whole = read(path, **log)
    opened = files.open_log
    monkeypatch.setattr(files, "open_log", lambda *given: Splitting(opened(*given), size))
    parts = read(path, **log)
    assert parts.integrity == whole.integrity
    for one, two in zip((*parts[1:4], stack(parts)), (*whole[1:4], stack(whole)), strict=True):
        assert np.array_equal(one, two, equal_nan=True)


def test_a_thermometer_in_another_table(tmp_path):
    time, slow = np.arange(2000) / 100, np.arange(20.0)
    rate = 0.1 * np.random.default_rng(3).standard_normal(2000)
    lines = [f"GYR,{t:.2f},{value:.4f}" for t, value in zip(time, rate, strict=True)]
    lines += [f"TMP,{t + 0.002:.3f},{25 + t:.2f}" for t in slow]
    lines.sort(key=lambda line: float(line.split(",")[1]))
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines) + "\n")
    manifest = parse_manifest(
        f"""
array:
  gyros: [{{name: g1, axis: z, unit: deg/s}}]
  temperatures: [{{name: near, gyro: g1}}]
recordings:
- name: a
  kind: static
  files: [{path.name}]
  log:
    time: c1
    columns: {{g1: {{column: c2, table: GYR}}, temp_near: {{column: c2, table: TMP}}}}
""",
        "f",
    )
    made = board_of_log(manifest.array, "log", "")
    reader = open_recording([path], manifest.recordings[0], made, IntegrityOptions(), array=manifest.array)
    frames = gather(reader, made)
    assert reader.integrity.rate_hz == pytest.approx(100)
    assert frames.counts["g1"] == pytest.approx(rate, abs=1e-4)
    expected = 25 + np.floor(time - 0.002 + 0.5)
    near = frames.counts["temp_near"]
    # The nearest reading, within half of its period; the last one, at 19.002 s, holds until 19.50 s.
    known = np.isfinite(near)
    assert known.sum() == 1951
    assert np.abs(near - expected)[known].max() <= 1

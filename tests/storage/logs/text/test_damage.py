"""Damaged text logs: each bad line is named, nothing else is lost, and what is no log is refused in one sentence."""

import contextlib
import gzip
import tracemalloc

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vgyro.errors import DataError
from vgyro.log import TextForm
from vgyro.storage.logs.text import blocks as blocks_module
from vgyro.storage.logs.text import open_log
from vgyro.storage.logs.text.blocks import LONGEST, Lines
from vgyro.storage.logs.text.damage import NAMED
from vgyro.storage.logs.text.encoding import Encoding
from vgyro.storage.sources import open_sources

LINES = [f"{k},{k / 8},{-k / 4}\n" for k in range(40)]


@pytest.fixture
def opened(tmp_path):
    """Write a text and open it."""

    def make(content: str | bytes, name: str = "log.csv", **form):
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return open_log(path, TextForm(**form))

    return make


def read(log, table: str = ""):
    """All columns of a table, and the bad lines."""
    names = [column.name for one in log.tables if one.name == table for column in one.columns]
    rows = list(log.rows(table, names))
    return pa.Table.from_batches([one.batch for one in rows]), [bad for one in rows for bad in one.bad]


@pytest.mark.parametrize(
    ("damaged", "expected"),
    [
        ("5,0.12-0.34,1", "expected a number as c2"),
        ("5,0.1", "has 2 cells, expected 3"),
        ("5,0.1,1,7", "has more cells than 3"),
        ("5,ERR,1", "expected a number as c2"),
        ("5,0.1,\x00\x00", "expected a number as c3"),
        ('5,"0.1,1', "a quote is not closed where c2 was expected"),
        ("\x00\x01garbage\xff", "expected a number as c1"),
    ],
)
def test_each_bad_line_is_named(opened, damaged, expected):
    lines = [*LINES[:7], damaged + "\n", *LINES[7:]]
    log = opened("".join(lines).encode("latin-1"))
    table, bad = read(log)
    assert table["c1"].to_pylist() == list(range(40))
    assert [(one.place, one.expected) for one in bad] == [(8, expected)]
    assert (log.account.rows, log.account.bad, log.account.notes) == (40, 1, [])


def test_places_are_lines(opened):
    log = opened("# a\nt,x,y\n" + "".join(LINES[:3]) + "\n# b\nbad,1,2\n" + "".join(LINES[3:]))
    rows = list(log.rows("", ["t"]))
    assert [(one.place, [bad.place for bad in one.bad]) for one in rows] == [(3, [8])]


def test_a_last_line_without_end(opened):
    log = opened("".join(LINES) + "40,5.0,6.0")
    assert read(log)[0].num_rows == 41
    assert log.account.notes == ["line 41, the last one, has no end: taken, for it has all its fields"]
    log = opened("".join(LINES) + "40,5.0")
    table, bad = read(log)
    assert (table.num_rows, log.account.bad) == (40, 1)
    assert bad[0].place == 41
    assert "ends within" in bad[0].expected
    assert "line 41" in log.account.notes[0]


def test_a_first_line_that_is_cut(opened):
    log = opened("8,-0.25\n" + "".join(LINES))
    table, bad = read(log)
    assert table.num_rows == 40
    assert [one.place for one in bad] == [1]


def test_a_wrong_checksum_and_the_rest_of_a_line(opened):
    log = opened("$A,1,2*42\n" * 5 + "$A,1,3*42\n1,2*42\n" + "$A,1,2*42\n" * 5)
    table, bad = read(log, "$A")
    assert table.num_rows == 10
    assert [(one.place, one.expected) for one in bad] == [
        (6, "expected another checksum at its end"), (7, "expected a line that begins with a word"),
    ]  # fmt: skip


@pytest.mark.parametrize("count", [NAMED - 1, NAMED, NAMED + 1, 9000])
def test_at_most_so_many_bad_lines_are_named(opened, count):
    log = opened("".join(LINES) * 800 + "x,1,2\n" * count + "".join(LINES))
    table, bad = read(log)
    assert (table.num_rows, log.account.bad, len(bad)) == (40 * 801, count, min(count, NAMED))


def test_data_that_break_off(opened):
    packed = gzip.compress("".join(LINES * 2000).encode())
    log = opened(packed[: len(packed) // 2], "log.csv.gz")
    table, _ = read(log)
    assert 0 < table.num_rows < 80_000
    assert any("gzip data break off" in note for note in log.account.notes)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b"\n\n \n", "no rows"),
        (b"# only\n# comments\n", "no rows"),
        (b"t,gx,gy\n", "line 1: holds only a header: found 't,gx,gy'"),
        (b"t,gx,gy\r\ns,dps,dps\r\n", "only a header"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "is not a text: it begins with the bytes 89 50 4e 47"),
        (bytes(range(256)) * 10, "is not a text"),
        (b"Dear all,\nthe gyro was dropped\nSorry\n", "line 1: holds no table of numbers"),
        (gzip.compress(b"", mtime=0), "unpacks to nothing"),
        (b"0a\n0b\n0c\n", "line 1: holds no table of numbers"),
        (b"1,2,3\n" * 30 + b"all,my,words\n" * 40, "line 31: holds no table of numbers"),
    ],
)
def test_what_is_no_log(opened, content, said):
    with pytest.raises(DataError) as caught:
        opened(content)
    assert said in str(caught.value)
    assert "log.csv" in str(caught.value)


def test_folders_missing_files_tables_and_columns(opened, tmp_path):
    with pytest.raises(DataError, match="is a folder"):
        open_log(tmp_path, TextForm())
    with pytest.raises(DataError, match="no such file"):
        open_log(tmp_path / "none.csv", TextForm())
    log = opened("t,gx\n0,1\n1,2\n")
    with pytest.raises(DataError, match="no table 'gyro'"):
        log.rows("gyro", ["t"])
    with pytest.raises(DataError, match="no column 'gX'"):
        log.rows("", ["gX"])
    with pytest.raises(DataError, match="each once"):
        log.rows("", ["t", "t"])


@pytest.mark.parametrize(
    ("form", "said"),
    [
        ({"names": ("a", "b")}, "has 3 columns, but the manifest has 2 names"),
        ({"header": True, "delimiter": ";"}, "holds no table of numbers"),
        ({"delimiter": "7"}, "cannot stand between columns"),
        ({"delimiter": ",", "decimal": ","}, "cannot be both"),
        ({"skip": 40}, "no rows"),
    ],
)
def test_a_form_that_does_not_fit(opened, form, said):
    with pytest.raises(DataError, match=said):
        read(opened("".join(LINES), **form))


def test_a_header_with_too_few_names(opened):
    with pytest.raises(DataError, match=r"line 1: the header holds 2 names, the rows 3 cells"):
        opened("t,gx\n1,2,3\n2,3,4\n", header=True)


# --- blocks of lines


def all_lines(path, block: int, eol: bytes = b"\n") -> tuple[list[bytes], list, bool]:
    """The lines that come in blocks of a given size, the ones that are too long, and whether the last was cut."""
    lines = Lines(open_sources([path]).files[0], Encoding("utf-8"), eol, block)
    content, long, cut, number = [], [], False, 1
    for one in lines.blocks():
        long += one.long
        cut = one.cut
        number = one.line + one.data[: one.size].tobytes().count(eol)
        content.append(one.data[: one.size].tobytes())
    assert lines.line == number
    return b"".join(content).split(eol)[:-1], long, cut


@pytest.mark.parametrize("end", [b"\n", b""])
@pytest.mark.parametrize("block", [1, 2, 3, 7, 64, 1000])
def test_lines_are_the_same_whatever_the_blocks(tmp_path, block, end):
    content = b"a\n\nbc,1\n" + b"x" * 100 + b"\n\nd" + end
    path = tmp_path / "x"
    path.write_bytes(content)
    assert all_lines(path, block) == (content.removesuffix(b"\n").split(b"\n"), [], not end)


@pytest.mark.parametrize(("longer", "expected"), [(0, 0), (1, 1)])
def test_lines_that_are_too_long(tmp_path, monkeypatch, longer, expected):
    # A line of LONGEST bytes is held back whole; one byte more, and it is damage.
    monkeypatch.setattr(blocks_module, "LONGEST", 50)
    path = tmp_path / "x"
    path.write_bytes(b"1\n2\n" + b"y" * (50 + longer) + b"zz\n4\n")
    lines, long, _ = all_lines(path, 54 + longer)
    assert len(long) == expected
    assert [number for number, _ in long] == [3] * expected
    assert lines[:2] + lines[-1:] == [b"1", b"2", b"4"]


def test_a_long_line_in_the_middle_is_damage(opened):
    log = opened("".join(LINES).encode() + b"9" * (LONGEST * 9) + b"\n" + "".join(LINES).encode())
    table, bad = read(log)
    assert table.num_rows == 80
    assert [one.place for one in bad] == [41]
    assert log.account.bad == 1


def test_memory_is_bounded(tmp_path):
    path = tmp_path / "one_line.csv"
    with open(path, "wb") as file:
        file.truncate(1 << 30)
        file.write(b"1,2,3")
    tracemalloc.start()
    with pytest.raises(DataError, match="line 1 is longer than 1024 KiB"):
        open_log(path, TextForm(encoding="utf-8"))
    line = tmp_path / "ones.csv"
    line.write_bytes(b"0,1,2,3,4,5,6\n" * 2_000_000)
    for rows in open_log(line, TextForm()).rows("", ["c1", "c7"]):
        assert rows.batch.num_rows <= 1 << 18
    assert tracemalloc.get_traced_memory()[1] < 64 << 20
    tracemalloc.stop()


# --- mutated and random files

VALID = [
    "t,gx (deg/s),s\n" + "".join(f"{k},{k / 8},ab\n" for k in range(30)),
    "".join(f"{k};0,{k};-1,5\r\n" for k in range(30)),
    "".join(f"12:00:{k:02}.5 -> {k}, {k / 8}\n" for k in range(30)),
    "".join(f"2026-02-28T12:00:{k:02}.5Z {k} {k / 8}\n" for k in range(30)),
    "".join(f"gx:{k} gy:{k / 8}\n" for k in range(30)),
    "".join(f'{{"gx":{k},"gy":[{k / 8},1]}}\n' for k in range(30)),
    "".join(f"acc {k} 1 2\ngyro {k} 3\n" for k in range(15)),
    "".join("$A,1,2*42\n$B,1*5F\n" for k in range(15)),
]


def survives(content: bytes, path, engine: str) -> None:
    """DataError or rows that hold together; nothing else."""
    path.write_bytes(content)
    lines = content.count(b"\n") + content.count(b"\r") + 1
    # Other errors are not caught: they fail the test.
    with contextlib.suppress(DataError):
        log = open_log(path, TextForm(), engine)
        for table in log.tables:
            rows = list(log.rows(table.name, [column.name for column in table.columns]))
            assert log.account.rows == sum(one.batch.num_rows for one in rows) > 0
            assert log.account.bad == sum(len(one.bad) for one in rows)
            assert log.account.rows + log.account.bad + log.account.other <= lines


@st.composite
def mutated(draw) -> bytes:
    content = bytearray(draw(st.sampled_from(VALID)).encode(draw(st.sampled_from(["utf-8", "utf-16"]))))
    for _ in range(draw(st.integers(1, 6))):
        place = draw(st.integers(0, len(content)))
        match draw(st.integers(0, 3)):
            case 0:
                content[place : place + 1] = bytes([draw(st.integers(0, 255))])
            case 1:
                content[place : place + draw(st.integers(1, 60))] = b""
            case 2:
                content[place:place] = draw(
                    st.one_of(st.binary(max_size=8), st.sampled_from([b'"', b"\n", b"\r", b"{", b"*"]))
                )
            case 3:
                content = content[:place] + content[draw(st.integers(0, len(content))) :]
    return bytes(content)


PIECES = [
    "1", "-0.5", ",", ";", " ", "\t", "\n", "\r\n", ":", "gx", "=", '"', "2026-02-28", "12:00:00", "T", "{", "}", "[",
    "]", "*42", "$A", "#", "->", "nan", "0x1F", "e5", "\0", "\ufeff", "é",
]  # fmt: skip
ANYTHING = st.one_of(
    mutated(),
    mutated(),
    st.binary(max_size=300),
    st.text(max_size=200).map(lambda text: text.encode("utf-8", "replace")),
    st.lists(st.sampled_from(PIECES), max_size=80).map(lambda parts: "".join(parts).encode()),
)


@example(b"0\n0a", "native")
@given(ANYTHING, st.sampled_from(["native", "native", "reference"]))
@settings(max_examples=200, deadline=None)
def test_any_bytes(tmp_path_factory, content, engine):
    survives(content, tmp_path_factory.getbasetemp() / "any.csv", engine)


@pytest.mark.full
@given(ANYTHING, st.sampled_from(["native", "native", "reference"]))
@settings(max_examples=10_000, deadline=None)
def test_any_bytes_at_length(tmp_path_factory, content, engine):
    survives(content, tmp_path_factory.getbasetemp() / "any.csv", engine)


@given(
    st.integers(1, 5),
    st.integers(1, 60),
    st.sampled_from([",", ";", "\t", " ", "|"]),
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
@settings(max_examples=100, deadline=None)
def test_what_is_written_is_read(tmp_path_factory, columns, rows, delimiter, end, header, seed):
    values = np.random.default_rng(seed).normal(size=(rows, columns)) * 10.0 ** (seed % 7 - 3)
    if columns == 1 and delimiter == " ":
        delimiter = ","
    lines = [delimiter.join(f"g{k}" for k in range(columns))] * header
    lines += [delimiter.join(map(repr, row)) for row in values.tolist()]
    path = tmp_path_factory.getbasetemp() / "written.csv"
    path.write_bytes(end.join([*lines, ""]).encode())
    log = open_log(path, TextForm())
    table, bad = read(log)
    assert not bad
    assert table.column_names == [f"g{k}" if header else f"c{k + 1}" for k in range(columns)]
    assert np.array_equal(np.column_stack([table[name].to_numpy() for name in table.column_names]), values)

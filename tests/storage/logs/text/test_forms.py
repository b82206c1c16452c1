"""Forms of text logs: each small file is read as its author meant it, by both engines."""

import datetime
import gzip
import math
from pathlib import Path

import pyarrow as pa
import pytest

from vgyro.log import TextForm
from vgyro.storage.logs.text import TextLog, looks_like_text, open_log

NAN = math.nan


@pytest.fixture(params=["native", "reference"])
def opened(request, tmp_path):
    """Write a text and open it."""

    def make(content: str | bytes, name: str = "log.csv", **form) -> TextLog:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return open_log(path, TextForm(**form), request.param)

    return make


def columns_of(log: TextLog, table: str = "") -> dict[str, list]:
    """Every column of a table, as lists."""
    found = next(one for one in log.tables if one.name == table)
    names = [column.name for column in found.columns]
    batches = [rows.batch for rows in log.rows(table, names)]
    return pa.Table.from_batches(batches).to_pydict()


def units(log: TextLog) -> list[str]:
    return [column.unit for column in log.tables[0].columns]


def same(found: list, expected: list) -> bool:
    return len(found) == len(expected) and all(
        one == two or (one != one and two != two) for one, two in zip(found, expected, strict=True)
    )


def ns(*parts: int, rest: int = 0) -> int:
    return round(datetime.datetime(*parts, tzinfo=datetime.UTC).timestamp()) * 10**9 + rest


ROWS = {"t": [0, 1, 2, 3], "gx": [0.5, -0.25, 1.5, 2.0], "gy": [10.0, 20.0, 30.0, 40.0]}


def written(delimiter: str, decimal: str = ".", end: str = "\n", header: str = "t{0}gx{0}gy") -> str:
    lines = [header.format(delimiter)] if header else []
    for row in zip(*ROWS.values(), strict=True):
        lines.append(delimiter.join(str(value).replace(".", decimal) for value in row))
    return end.join([*lines, ""])


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|", " ", ", ", "  ", " ; ", "\t\t "])
def test_delimiters_and_ends(opened, delimiter, end):
    if delimiter.strip(" ") == "\t\t":
        delimiter = " \t "
    assert columns_of(opened(written(delimiter, end=end))) == ROWS


@pytest.mark.parametrize("delimiter", [";", "\t", "|", " "])
def test_decimal_comma(opened, delimiter):
    log = opened(written(delimiter, ","))
    assert columns_of(log) == ROWS
    assert "decimal comma" in log.tables[0].text


@pytest.mark.parametrize(
    ("encoding", "mark"),
    [("utf-8", b""), ("utf-8", b"\xef\xbb\xbf"), ("utf-16-le", b"\xff\xfe"), ("utf-16-be", b"\xfe\xff"),
     ("utf-16-le", b""), ("utf-16-be", b""), ("latin-1", b"")],
)  # fmt: skip
def test_encodings(opened, encoding, mark):
    content = mark + written(";", header="Zeit{0}Größe (°/s){0}gy").encode(encoding)
    assert looks_like_text(content)
    log = opened(content)
    assert columns_of(log) == {"Zeit": ROWS["t"], "Größe (°/s)": ROWS["gx"], "gy": ROWS["gy"]}
    assert units(log) == ["", "°/s", ""]


@pytest.mark.parametrize("packed", [gzip.compress, lambda data: pa.compress(data, "zstd", asbytes=True)])
def test_compressed(opened, packed):
    log = opened(packed(written(",").encode()), "log.csv.gz")
    assert columns_of(log) == ROWS
    assert log.account.compression in ("gzip", "zstd")
    assert log.account.content_bytes == len(written(","))


def test_a_first_line_of_zeros_is_a_row(opened):
    assert columns_of(opened("0,0,0\n1,2,3\n2,3,4\n")) == {"c1": [0, 1, 2], "c2": [0, 2, 3], "c3": [0, 3, 4]}
    assert columns_of(opened("0,5\n")) == {"c1": [0], "c2": [5]}


def test_given_names_and_header(opened):
    assert list(columns_of(opened(written(",", header=""), names=("t", "gx", "gy")))) == ["t", "gx", "gy"]
    # Names of digits are a header only because the manifest says so.
    log = opened("1,2\n0.5,0.25\n1.5,0.75\n", header=True)
    assert columns_of(log) == {"1": [0.5, 1.5], "2": [0.25, 0.75]}
    assert columns_of(opened("1,2\n0.5,0.25\n", header=False)) == {"c1": [1, 0.5], "c2": [2, 0.25]}


def test_skipped_lines(opened):
    assert columns_of(opened("9,9,9\n8,8,8\n" + written(",", header=""), skip=2))["c1"] == ROWS["t"]
    assert columns_of(opened("junk;1;2\n" + written(","), skip=1)) == ROWS


@pytest.mark.parametrize(
    ("name", "unit"),
    [("gx (deg/s)", "deg/s"), ("gx [rad/s]", "rad/s"), ("gx_dps", "dps"), ("gx mdps", "mdps"), ("gx_rad_s", "rad/s"),
     ("Time (ms)", "ms"), ("t_us", "us"), ("gyro.x.deg_s", "deg/s"), ("Temp (C)", "C"), ("gx", ""), ("axis", ""),
     ("gases", "")],
)  # fmt: skip
def test_units_in_names(opened, name, unit):
    log = opened(f"{name};b\n1;2\n3;4\n")
    assert [column.name for column in log.tables[0].columns] == [name, "b"]
    assert units(log) == [unit, ""]


def test_a_line_of_units(opened):
    log = opened("t,gx\ns,deg/s\n0,0.5\n1,0.25\n")
    assert columns_of(log) == {"t": [0, 1], "gx": [0.5, 0.25]}
    assert units(log) == ["s", "deg/s"]


def test_two_lines_of_names(opened):
    assert list(columns_of(opened("time,gyro,gyro\nus,x,y\n0,1,2\n5,3,4\n"))) == ["us", "x", "y"]
    assert list(columns_of(opened("gyro1,gyro1,gyro2\nx,y,x\n0,1,2\n5,3,4\n"))) == ["gyro1 x", "gyro1 y", "gyro2 x"]
    assert list(columns_of(opened("t,g,g\n0,1,2\n5,3,4\n"))) == ["t", "g", "g#1"]


def test_preamble_and_comments(opened):
    content = "Firmware v1.2\nDate: 2026-02-28 12:00\n\n# gain 3\n# t,gx\n0,0.5\n1,0.25\n# pause\n2,0.75\n"
    log = opened(content)
    assert columns_of(log) == {"t": [0, 1, 2], "gx": [0.5, 0.25, 0.75]}
    assert (log.account.rows, log.account.bad, log.account.other) == (3, 0, 5)


def test_a_logger_that_started_again(opened):
    content = "Firmware v1.2\nt,gx\n0,0.5\n1,0.25\nFirmware v1.2\nt,gx\n0,0.125\n"
    log = opened(content)
    assert columns_of(log) == {"t": [0, 1, 0], "gx": [0.5, 0.25, 0.125]}
    assert (log.account.bad, log.account.other) == (0, 4)


def test_quotes_text_and_empty_cells(opened):
    content = '\ufeff"t","State","g, x","e",\r\n"0","M, a","0.5","",\r\n"1","S ""b""","","",\r\n"2","","nan","",\r\n'
    log = opened(content)
    found = columns_of(log)
    assert found["State"] == ["M, a", 'S "b"', None]
    assert same(found["g, x"], [0.5, NAN, NAN])
    assert same(found["e"], [NAN, NAN, NAN])
    assert list(found) == ["t", "State", "g, x", "e"]


def test_missing_and_infinite(opened):
    found = columns_of(opened("a;b\n1;inf\nNaN;-inf\nnull;1e3\nNA;+2\n;-0x1F\n"))
    assert same(found["a"], [1, NAN, NAN, NAN, NAN])
    assert found["b"] == [math.inf, -math.inf, 1000, 2, -31]


def test_hexadecimal_columns(opened):
    assert columns_of(opened("t,g\n0,0x1F\n1,0xff\n")) == {"t": [0, 1], "g": [31, 255]}
    assert columns_of(opened("t g\n0 00FF\n1 01A0\n2 0010\n")) == {"t": [0, 1, 2], "g": [255, 416, 16]}
    # Of words of letters alone nobody knows; plain numbers are decimal.
    assert columns_of(opened("t,g\n0,AB\n1,CD\n"))["g"] == ["AB", "CD"]
    assert columns_of(opened("t,g\n0,10\n1,20\n"))["g"] == [10, 20]


def test_long_integers_are_exact(opened):
    # 15 digits are exact as a double; from 16 on a column of integers stays one.
    log = opened("t,g\n1700000000123456789,1\n1700000000123456790,2\n,3\n")
    assert columns_of(log)["t"] == [1700000000123456789, 1700000000123456790, None]
    assert next(log.rows("", ["t"])).batch.schema.field("t").type == pa.int64()
    assert next(opened("t,g\n1234567890123456,1\n").rows("", ["t"])).batch.schema.field("t").type == pa.int64()
    assert next(opened("t,g\n123456789012345,1\n").rows("", ["t"])).batch.schema.field("t").type == pa.float64()


@pytest.mark.parametrize(
    "content",
    ["gx:0.5 gy:-1 T:30\ngx:0.25 gy:-2 T:31\n", "gx=0.5, gy=-1, T=30\ngx=0.25, gy=-2, T=31\n",
     "gx: 0.5\tgy: -1\tT: 30\ngx: 0.25\tgy: -2\tT: 31\n", "gx: 0.5 gy: -1 T: 30\ngx: 0.25 gy: -2 T: 31\n",
     '{"gx":0.5,"gy":-1,"T":30}\n{"gx":0.25,"gy":-2,"T":31}\n', "gx:0.5;gy:-1;T:30;\r\ngx:0.25;gy:-2;T:31;\r\n"],
)  # fmt: skip
def test_labels(opened, content):
    assert columns_of(opened(content)) == {"gx": [0.5, 0.25], "gy": [-1, -2], "T": [30, 31]}


def test_labels_beyond_ascii_and_with_signs(opened):
    content = "ωx:0.5 ωy:1\nωx:0.25 ωy:2\n"
    assert columns_of(opened(content)) == {"ωx": [0.5, 0.25], "ωy": [1, 2]}
    latin = "größe:0.5 gx:1\ngröße:0.25 gx:2\n".encode("latin-1")
    assert columns_of(opened(latin)) == {"größe": [0.5, 0.25], "gx": [1, 2]}
    # A label that holds the delimiter is a text.
    assert columns_of(opened('1|"a|b: 1"\n2|"a|b: 2"\n')) == {"c1": [1, 2], "c2": ["a|b: 1", "a|b: 2"]}


def test_labels_that_change(opened):
    log = opened("gx:1 gy:2\ngx:3\ngy:4 gx:5\ngx:6 gy:x\ngx:7 gy:8\ngx:9\n")
    assert log.tables[0].text == ("labelled", "labels change")
    found = columns_of(log)
    assert found["gx"] == [1, 3, 5, 7, 9]
    assert same(found["gy"], [2, NAN, 4, 8, NAN])
    assert log.account.bad == 1


def test_json_lines(opened):
    content = (
        '{"t":1700000000123456789,"g":[1,2.5],"s":{"ok":true,"x":"a"}}\n{"s":{"x":null},"t":1700000000123456790}\n'
    )
    found = columns_of(opened(content))
    assert found["t"] == [1700000000123456789, 1700000000123456790]
    assert same(found["g[1]"], [2.5, NAN])
    assert same(found["s.ok"], [1, NAN])
    assert found["s.x"] == ["a", None]
    log = opened('{"g":1}\n{"h":5}\n{"g":2\n{"g":3}\n{"g":4}\n{"g":5}\n')
    rows = list(log.rows("", ["g"]))
    assert rows[0].batch["g"].to_pylist() == [1, 3, 4, 5]
    assert [(bad.place, bad.found) for bad in rows[0].bad] == [(3, '{"g":2')]
    assert (log.account.bad, log.account.other) == (1, 1)


def test_serial_monitor(opened):
    lines = "23:59:59.999 -> -0.5, 1\n00:00:00.009 -> 0.25, 2\n00:00:00.019 -> 0.75, 3\n"
    log = opened(lines)
    assert columns_of(log) == {
        "time": [86_399_999_000_000, 9_000_000, 19_000_000],
        "c1": [-0.5, 0.25, 0.75],
        "c2": [1, 2, 3],
    }
    assert log.tables[0].columns[0].kind == "day"
    found = columns_of(opened("23:59:50.000 -> gx,gy\n" + lines))
    assert list(found) == ["time", "gx", "gy"]
    found = columns_of(opened("12:00:00 -> gx:1 gy:2\n12:00:01 -> gx:3 gy:4\n"))
    assert found == {"time": [43_200 * 10**9, 43_201 * 10**9], "gx": [1, 3], "gy": [2, 4]}
    found = columns_of(opened("[2026-02-28 12:00:00.5] 1 2\n[2026-02-28 12:00:01.5] 3 4\n"))
    assert found == {"time": [ns(2026, 2, 28, 12, 0, 0, rest=5 * 10**8), ns(2026, 2, 28, 12, 0, 1, rest=5 * 10**8)],
                     "c1": [1, 3], "c2": [2, 4]}  # fmt: skip


FIRST = ns(2026, 2, 28, 23, 59, 55, rest=123_000_000)


@pytest.mark.parametrize(
    ("stamp", "delimiter"),
    [("2026-02-28T23:59:55.123Z", ","), ("2026-02-28 23:59:55.123", ","), ("2026-02-28T23:59:55.123000000", " "),
     ("2026/02/28 23:59:55,123", ";"), ("2026/02/28 23:59:55,123", ","), ("28.02.2026 23:59:55.123", "\t"),
     ("28.02.2026 23:59:55.123", " "), ("2/28/2026 11:59:55.123 PM", ","), ("2026-03-01T00:59:55.123+01:00", ","),
     ("28-Feb-2026 23:59:55.123", ",")],
)  # fmt: skip
@pytest.mark.parametrize("header", [True, False])
def test_dates(opened, stamp, delimiter, header):
    lines = [f"when{delimiter}g"] * header + [f"{stamp}{delimiter}{value}" for value in (0.5, 0.25)]
    log = opened("\n".join([*lines, ""]))
    first, second = columns_of(log).values()
    assert first == [FIRST, FIRST]
    assert second == [0.5, 0.25]
    assert log.tables[0].columns[0].kind == "date"


def test_date_and_time_apart(opened):
    for content in (
        "date,time,g\n2026-02-28,23:59:55.123,1\n2026-02-28,23:59:55.123,2\n",
        "date\ttime\tg\n28.02.2026\t23:59:55,123\t1\n28.02.2026\t23:59:55,123\t2\n",
    ):
        assert columns_of(opened(content)) == {"date time": [FIRST, FIRST], "g": [1, 2]}
    assert columns_of(opened("time,g\n23:59:55.123,1\n\n,2\n")) == {"time": [86_395_123_000_000, None], "g": [1, 2]}


def test_fractions_are_never_cut(opened):
    # More than ns are damage, but for zeros.
    fractions = ["000000001", "999999999Z", "5", "1234567890", "0000000015"]
    log = opened("t,g\n" + "".join(f"2026-02-28T00:00:00.{fraction},1\n" for fraction in fractions))
    assert columns_of(log)["t"] == [ns(2026, 2, 28, rest=rest) for rest in (1, 999_999_999, 500_000_000, 123_456_789)]
    assert log.account.bad == 1


def test_dates_that_are_not_sure_say_so(opened):
    log = opened("t,g\n2/3/2026 12:00:00,1\n2/3/2026 12:00:01,2\n")
    assert any("not tell for sure" in phrase for phrase in log.tables[0].text)
    assert columns_of(log)["t"][0] == ns(2026, 3, 2, 12)
    assert not any("sure" in phrase for phrase in opened("t,g\n2/28/2026 12:00:00,1\n").tables[0].text)


def test_lines_of_several_kinds(opened):
    lines = ["acc 0 0.5 extra 1", "mag 0 7", "gyro 0 -1", "boot: ok", "acc 1 0.25 extra 1", "gyro 1 -2"] * 5
    log = opened("\n".join([*lines, ""]))
    assert [table.name for table in log.tables] == ["acc", "mag", "gyro"]
    assert columns_of(log, "gyro") == {"c1": [0, 1] * 5, "c2": [-1, -2] * 5}
    assert (log.account.rows, log.account.bad, log.account.other) == (10, 0, 20)
    assert columns_of(log, "acc")["c3"] == ["extra"] * 10


def test_sentences_with_checksums(opened):
    def sentence(content: str) -> str:
        total = 0
        for byte in content.encode():
            total ^= byte
        return f"${content}*{total:02X}\r\n"

    lines = [sentence(f"VNYMR,{k}.5,-1") + sentence(f"GPS,{k},A") for k in range(6)]
    lines.insert(3, "$VNYMR,9.5,-1*00\r\n")
    log = opened("".join(lines))
    assert columns_of(log, "$VNYMR")["c1"] == [k + 0.5 for k in range(6)]
    assert (log.account.bad, log.account.other) == (1, 6)


def test_empty_columns_and_trailing_delimiters(opened):
    assert list(columns_of(opened("stamp\tg1\t\n0\t1\t\n1\t2\t\n"))) == ["stamp", "g1"]
    assert list(columns_of(opened("1;2;\n3;4;\n"))) == ["c1", "c2"]
    found = columns_of(opened("a,b,c\n1,,3\n4,,6\n"))
    assert same(found["b"], [NAN, NAN])


def test_a_delimiter_of_several_signs(opened):
    assert columns_of(opened("t::gx\n0::0.5\n1::0.25\n", delimiter="::")) == {"t": [0, 1], "gx": [0.5, 0.25]}
    assert columns_of(opened(written(","), delimiter=", ")) == ROWS
    assert columns_of(opened("t§gx\n0§0.5\n1§0.25\n", delimiter="§")) == {"t": [0, 1], "gx": [0.5, 0.25]}


def test_some_columns_in_any_order(opened):
    log = opened(written(","))
    rows = next(log.rows("", ["gy", "t"]))
    assert rows.batch.schema.names == ["gy", "t"]
    assert rows.batch.to_pydict() == {"gy": ROWS["gy"], "t": ROWS["t"]}
    assert rows.place == 2


def test_words_alone_do_not_read_headers_as_rows(opened):
    log = opened("t,s\n0,a\nt,s\n1,b\n")
    assert next(log.rows("", ["s"])).batch.to_pydict() == {"s": ["a", "b"]}


@pytest.mark.parametrize(
    ("head", "text"),
    [(b"t,gx\n0,1\n", True), (b"", False), (b"\0" * 100, False), (bytes(range(256)), False),
     (b"\x7fELF\2\1\1\0\0", False), ("t;gx\r\n".encode("utf-16"), True), (b"Gr\xf6\xdfe;1\n", True),
     (b"\0\0\0\0" + b"1,2\n" * 50, True), (b"1,2\n" * 12 + b"\1", False), (b"1,2\n" * 13 + b"\1", True)],
)  # fmt: skip
def test_what_looks_like_text(head, text):
    assert looks_like_text(head) is text


def test_the_cases():
    folder = Path(__file__).resolve().parents[3] / "cases" / "logs"
    found = {path.name: open_log(path, TextForm()) for path in folder.iterdir() if path.suffix != ".json"}
    assert [table.name for table in found["interleaved.txt"].tables] == ["acc", "mag", "gyro"]
    log = found["restart.csv"]
    assert sum(rows.batch.num_rows for rows in log.rows("", ["g1"])) == 2000
    assert (log.account.bad, log.account.other) == (1, 2)

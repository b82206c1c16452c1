"""The C reader of text lines against that of plain Python: equal to the last bit, whatever the lines hold."""

import datetime
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vgyro.engine import text
from vgyro.engine.native.text import Parser as Native
from vgyro.engine.reference.text import Parser as Reference
from vgyro.engine.text import NULL, PAD, Field, LineForm, Parsed

NUMBER = Field("number")


def parse(parser: type, lines: bytes, form: LineForm, room: int = 1000) -> Parsed:
    # Digits behind the end: what reads too far finds them.
    data = np.frombuffer(lines + b"7" * PAD, dtype=np.uint8)
    return parser(form).parse(data, len(lines), room)


def values(lines: bytes, form: LineForm | None = None) -> list:
    """Rows that C reads; none is bad."""
    form = form or LineForm((NUMBER,) * (lines.split(b"\n")[0].count(b",") + 1))
    found = parse(Native, lines, form, room=10_000)
    assert len(found.bad) == 0
    return [column.tolist() for column in found.columns if column is not None]


def reasons(lines: bytes, form: LineForm) -> list[tuple[int, int, int]]:
    """(line, field, why) of the bad lines."""
    return [tuple(row[2:]) for row in parse(Native, lines, form).bad.tolist()]


def assert_equal(lines: bytes, form: LineForm, room: int = 1000) -> None:
    mine, other = (parse(parser, lines, form, room) for parser in (Native, Reference))
    assert mine[2:] == other[2:], lines
    np.testing.assert_array_equal(mine.bad, other.bad, err_msg=repr(lines))
    for one, two in zip(mine.columns, other.columns, strict=True):
        assert (one is None) == (two is None)
        if one is not None:
            assert one.dtype == two.dtype
            # Signs of zeros count, too; of the bits of NaN there is only one kind.
            assert one.tobytes() == two.tobytes() or _same(one, two), lines


def _same(one: np.ndarray, two: np.ndarray) -> bool:
    return np.array_equal(one, two, equal_nan=True) and np.array_equal(
        np.signbit(one[~np.isnan(one)]), np.signbit(two[~np.isnan(two)])
    )


CELLS = st.one_of(
    st.floats(allow_nan=False).map(repr),
    st.from_regex(r"[+-]?[0-9]{0,25}[.,]?[0-9]{0,25}([eE][+-]?[0-9]{1,3})?", fullmatch=True),
    st.from_regex(r"[0-9]{1,2}:[0-9]{2}(:[0-9]{2}([.,][0-9]{1,12})?)?( ?[aApP][mM])?", fullmatch=True),
    st.from_regex(
        r"[0-9]{4}[-/.]?(0?[0-9]|1[0-3])[-/.]?[0-3][0-9]([T _][0-2][0-9]:?[0-6][0-9](:?[0-6][0-9](\.[0-9]{1,11})?)?"
        r"(Z| UTC|[+-][0-9]{2}:?[0-9]{2})?)?",
        fullmatch=True,
    ),
    st.from_regex(r"[0-3]?[0-9][-/. ]([01]?[0-9]|Feb|MAR|xyz)[-/. ]([0-9]{2}){1,2}( 1?[0-9]:00:00)?", fullmatch=True),
    st.from_regex(r"(0[xX])?[0-9a-fA-F]{1,17}", fullmatch=True),
    st.sampled_from(["", "nan", "-NaN", "null", "N/A", "none", "inf", "-Infinity", "x", "gx:1", "gx: 2", '"1.5"',
                     '"a""b"', '"', ' "3" ', "gx:", "*", "1*", "-", "+", ".", "1e", "0x", "12-3", " 4 ", "9" * 19,
                     "1.", ".5"]),
    st.text("0123456789.,-+eE:*\"x \t\r$ \x00ÿ", max_size=12),
)  # fmt: skip
KINDS: list[text.Cell] = ["skip", "number", "hex", "integer", "date", "day", "words", "literal"]


@st.composite
def forms(draw: st.DrawFn) -> LineForm:
    labels = st.sampled_from([b"", b"", b"", b"gx:"])
    fields = st.builds(Field, st.sampled_from([*KINDS, "number", "number"]), labels, st.sampled_from(text.ORDERS),
                       st.booleans())  # fmt: skip
    delimiter = draw(st.sampled_from([b",", b";", b"\t", b" ", b"|", b":"]))
    if delimiter == b":":
        fields = fields.map(lambda one: one._replace(label=b""))
    decimal = draw(st.sampled_from([b".", b","])) if delimiter != b"," else b"."
    # Only dates are split, and only by a comma.
    cells = [
        one._replace(split=one.split and delimiter == b"," and one.kind in ("date", "day"))
        for one in draw(st.lists(fields, min_size=1, max_size=4))
    ]
    word = draw(st.sampled_from([b"", b"", b"acc", b"$IMU"]))
    lead = draw(st.sampled_from([b"", b"", b"", b" -> "])) if not word else b""
    eol = draw(st.sampled_from([b"\n", b"\n", b"\r"]))
    return LineForm(tuple(cells), delimiter, decimal, eol, word, lead, bool(word) and draw(st.booleans()))


@st.composite
def lines_of(draw: st.DrawFn, form: LineForm) -> bytes:
    lines = []
    for _ in range(draw(st.integers(1, 6))):
        cells = draw(st.lists(CELLS, min_size=max(0, len(form.fields) - 1), max_size=len(form.fields) + 2))
        between = form.delimiter.decode() * draw(st.sampled_from([1, 1, 1, 2]))
        content = between.join(cells).encode("utf-8")
        if form.lead and draw(st.booleans()):
            content = content.replace(form.delimiter, form.lead, 1)
        if form.word and draw(st.integers(0, 4)):
            content = form.word + form.delimiter + content
        if form.checksum and draw(st.integers(0, 4)):
            total = 0
            for byte in content.strip(b" \t\r").removeprefix(b"$").removeprefix(b"!"):
                total ^= byte
            content += b"*%02X" % total
        lines.append(content.replace(form.eol, b"") + draw(st.sampled_from([b"", b"\r"])).replace(form.eol, b""))
    return form.eol.join([*lines, b""])


def check_engines(data: st.DataObject) -> None:
    form = data.draw(forms())
    assert_equal(data.draw(lines_of(form)), form, data.draw(st.sampled_from([1, 2, 1000])))


@given(st.data())
@settings(max_examples=200, deadline=None)
def test_both_engines_read_the_same(data: st.DataObject) -> None:
    check_engines(data)


@pytest.mark.full
@given(st.data())
@settings(max_examples=10_000, deadline=None)
def test_both_engines_read_the_same_at_length(data: st.DataObject) -> None:
    check_engines(data)


@given(
    st.lists(st.floats(allow_nan=False), min_size=1, max_size=20), st.sampled_from(["r", ".17e", ".5f", ".18g", ".25e"])
)
@settings(max_examples=200, deadline=None)
def test_numbers_are_those_of_python(numbers: list[float], form: str) -> None:
    written = [repr(one) if form == "r" else format(one, form) for one in numbers]
    found = np.array(values("".join(f"{one}\n" for one in written).encode())[0])
    assert found.tobytes() == np.array([float(one) for one in written]).tobytes()


def test_numbers_half_way_between_two_doubles() -> None:
    # Expected by float(): exactly half-way, and the last of 19 digits on either side of it.
    rng = np.random.default_rng(8)
    written = []
    for exponent in range(-27, 28):
        for digits in rng.integers(10**18, 2**63, 40):
            written.append(f"{digits}e{exponent}")
            written.append(f"{digits >> 9}{'5' if exponent % 2 else '25'}e{exponent}")
    written += [str(2**53 + one) for one in range(5)] + [
        f"{2**54 + 2 * one}.{'0' * k}" for one in range(3) for k in range(3)
    ]
    written += ["9007199254740993", "9007199254740992.5", "1e22", "1e23", "1e-22", "1e-23", "5e-324", "2e308", "1e-400"]
    found = np.array(values("".join(f"{one}\n" for one in written).encode())[0])
    assert found.tobytes() == struct.pack(f"{len(written)}d", *map(float, written))


def test_the_forms_of_a_number() -> None:
    found = values(b"+1,-0,.5,5.\n1E+02,1e-2,0x1F,-0xff\ninf,-Infinity,nan,N/A\n, ,null,None\n")
    expected = [
        [1, 100, np.inf, np.nan],
        [-0.0, 0.01, -np.inf, np.nan],
        [0.5, 31, np.nan, np.nan],
        [5, -255, np.nan, np.nan],
    ]
    np.testing.assert_array_equal(found, expected)
    assert values(b"0,25;1\n", LineForm((NUMBER, NUMBER), b";", b",")) == [[0.25], [1]]
    assert values(b'"1";"-2"\r\n', LineForm((NUMBER, NUMBER), b";")) == [[1], [-2]]
    assert values(b"ff 10\n", LineForm((Field("hex"), Field("hex")), b" ")) == [[255], [16]]


@pytest.mark.parametrize(
    "cell", [b"0.12-0.34", b"1.2.3", b"--1", b"1e", b"e5", b"1_000", b"0x", b"1 2", b"-", b"0.5", b"infin", b"\x00"]
)
def test_what_is_no_number(cell: bytes) -> None:
    form = LineForm((NUMBER, NUMBER), b";", b",")
    assert reasons(b"1;2\n1;" + cell + b"\n3;4\n", form) == [(1, 1, text.CELL)]


def test_integers_are_exact_up_to_the_ends_of_int64() -> None:
    form = LineForm((Field("integer"),))
    lines = b"1700000000123456789\n-1\n\n9223372036854775807\n-9223372036854775807\nNA\n"
    assert values(lines, form) == [[1700000000123456789, -1, 2**63 - 1, 1 - 2**63, NULL]]
    # One beyond the ends, and the least number, which stands for a missing one.
    assert [line for line, _, _ in reasons(b"9223372036854775808\n-9223372036854775808\n1.5\n7\n", form)] == [0, 1, 2]


def nanoseconds(*parts: int, ns: int = 0) -> int:
    moment = datetime.datetime(*parts, tzinfo=datetime.UTC)
    return round(moment.timestamp()) * 1_000_000_000 + ns


@pytest.mark.parametrize(
    ("cell", "order", "expected"),
    [
        ("2026-02-28T23:59:55.000000001Z", "ymd", nanoseconds(2026, 2, 28, 23, 59, 55, ns=1)),
        ("2026-02-28 23:59:55.1", "ymd", nanoseconds(2026, 2, 28, 23, 59, 55, ns=100_000_000)),
        ("2026/02/28 23:59:55,123", "ymd", nanoseconds(2026, 2, 28, 23, 59, 55, ns=123_000_000)),
        ("28.02.2026 23:59:55.123", "dmy", nanoseconds(2026, 2, 28, 23, 59, 55, ns=123_000_000)),
        ("2/28/2026 11:59:55 PM", "mdy", nanoseconds(2026, 2, 28, 23, 59, 55)),
        ("28-Feb-2026 23:59", "dmy", nanoseconds(2026, 2, 28, 23, 59)),
        ("2026-02-28T23:59:55+01:30", "ymd", nanoseconds(2026, 2, 28, 22, 29, 55)),
        ("20240229T120000.5Z", "ymd", nanoseconds(2024, 2, 29, 12, 0, 0, ns=500_000_000)),
        ("2024-02-29", "ymd", nanoseconds(2024, 2, 29)),
        ("1969-12-31 23:59:59.999999999", "ymd", -1),
        ("2026-02-28 12:00:00.1234567890", "ymd", nanoseconds(2026, 2, 28, 12, ns=123_456_789)),
        ("2262-04-11T23:47:16", "ymd", nanoseconds(2262, 4, 11, 23, 47, 16)),
        # No such day, hour, zone; a fraction that ns do not hold; years that they do not.
        ("2026-02-29", "ymd", None),
        ("2100-02-29", "ymd", None),
        ("2026-13-01", "ymd", None),
        ("2026-02-28T24:00:00", "ymd", None),
        ("2026-02-28T12:60:00", "ymd", None),
        ("2026-02-28T12:00:00.1234567891", "ymd", None),
        ("2262-04-12T00:00:00", "ymd", None),
        ("1600-01-01", "ymd", None),
        ("2026-02-28Tnoon", "ymd", None),
        ("32.01.2026", "dmy", None),
    ],
)
def test_dates(cell: str, order: text.Order, expected: int | None) -> None:
    form = LineForm((Field("date", order=order), NUMBER), b";")
    lines = f"{cell};1\n".encode()
    if expected is None:
        assert reasons(lines, form) == [(0, 0, text.CELL)]
    else:
        assert values(lines, form) == [[expected], [1]]
    assert_equal(lines, form)


def test_times_of_day() -> None:
    form = LineForm((Field("day"), NUMBER, NUMBER), lead=b" -> ")
    lines = b"23:59:59.999 -> 1, 2\n00:00:00.000 -> 3, 4\n12:00:00 AM -> 5, 6\n"
    assert values(lines, form)[0] == [86_399_999_000_000, 0, 0]
    assert reasons(b"24:00:00 -> 1, 2\n12:00 -> 1, 2\n12:00:00, 1, 2\n", form) == [
        (0, 0, text.CELL), (1, 0, text.CELL), (2, 0, text.LEAD),
    ]  # fmt: skip


def test_a_fraction_behind_the_delimiter() -> None:
    form = LineForm((Field("date", split=True), NUMBER))
    assert values(b"2026-02-28 23:59:55,123,0.5\n", form) == [
        [nanoseconds(2026, 2, 28, 23, 59, 55, ns=123_000_000)],
        [0.5],
    ]


def test_why_lines_do_not_fit() -> None:
    form = LineForm((NUMBER, Field("skip"), NUMBER))
    lines = b'1,2\n1,2,3,4\n1,"2,3\n1,2,3,,\n\n1,2,x\n'
    assert reasons(lines, form) == [(0, 2, text.FEW), (1, 2, text.MANY), (2, 1, text.QUOTE), (5, 2, text.CELL)]
    assert reasons(b"gx:1 gy:2\ngx:1 gz:2\n", LineForm((Field("number", b"gx:"), Field("number", b"gy:")), b" ")) == [
        (1, 1, text.LABEL)
    ]


def test_kinds_of_lines_and_checksums() -> None:
    form = LineForm((NUMBER, NUMBER), word=b"$IMU", checksum=True)
    lines = b"$IMU,1,2*52\n$GPS,1*00\n$IMU,1,2*53\n$IMU,1,2\n0,2*52\n$IMUX,1,2\n"
    found = parse(Native, lines, form)
    assert found.other == 2
    assert [tuple(row[2:]) for row in found.bad.tolist()] == [
        (2, 0, text.CHECKSUM), (3, 0, text.CHECKSUM), (4, 0, text.KIND),
    ]  # fmt: skip
    assert_equal(lines, form)


def test_it_stops_where_there_is_no_room() -> None:
    lines = b"1\nx\n2\n3\n"
    first = parse(Native, lines, LineForm((NUMBER,)), room=2)
    assert (first.consumed, first.lines, first.columns[0].tolist(), len(first.bad)) == (6, 3, [1, 2], 1)
    wrong = parse(Native, b"x\n" * 5000, LineForm((NUMBER,)))
    assert len(wrong.bad) == wrong.lines < 5000
    assert wrong.consumed == 2 * wrong.lines


@pytest.mark.parametrize(
    ("form", "lines"),
    [
        (LineForm((NUMBER,)), b"1"),
        (LineForm((NUMBER,)), b""),
        (LineForm((NUMBER,), b",", b","), b"1\n"),
        (LineForm((NUMBER,), b"5"), b"1\n"),
        (LineForm((NUMBER,), lead=b"\n"), b"1\n"),
        (LineForm((Field("number", b"gx:"),), b":"), b"1\n"),
    ],
)
def test_what_no_kernel_may_be_given(form: LineForm, lines: bytes) -> None:
    for parser in (Native, Reference):
        with pytest.raises(ValueError, match=r"whole lines|distinct|between|line's end|label holds"):
            parse(parser, lines, form)

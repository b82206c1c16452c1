"""Dumps of text: lines of another kind, separators, first and last lines, and what a refusal says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from storage_frames import dsp6_text_line

from vgyro.board import Board
from vgyro.config import IntegrityOptions
from vgyro.storage.dumps.reader import DumpReader
from vgyro.storage.dumps.sniff import sniff
from vgyro.storage.dumps.text_form import Kinds, fault_of, first_is_whole, opening, recurring_forms
from vgyro.storage.frames import gather
from vgyro.storage.integrity import Refused

LENIENT = IntegrityOptions(min_good_share=0)


def text_board(prefix="", fields=("a", "b"), kind="i16", counter=False, decimals=None, name="text", **frame) -> Board:
    """A board of lines; with `counter` the first field counts."""
    entries = [{"name": one, "type": kind, "decimals": decimals} for one in fields]
    if counter:
        entries = [{"name": "n", "type": "u16"}, *entries]
    return Board.model_validate({
        "name": name, "title": "t", "rate_hz": 100,
        "frame": {"kind": "text", "prefix": prefix, "fields": entries, **frame},
        "counter": {"field": "n", "modulus": 65536} if counter else None,
        "gyros": [{"name": "g", "field": fields[0], "axis": "z", "scale": 1}],
    })  # fmt: skip


@pytest.fixture
def read(dump):
    def run(data, board, options=LENIENT, chunk=1 << 22):
        reader = DumpReader([dump(data, "x.csv")], board, board.rate_hz, options, chunk)
        return gather(reader, board), reader.integrity

    return run


def lines(count=100, prefix=b"", ending=b"\r\n"):
    return [prefix + b"%d,%d" % (index % 50 - 20, 7 * index % 90) + ending for index in range(count)]


@pytest.mark.parametrize("chunk", [5, 1 << 22])
def test_lines_of_other_kinds_are_no_damage_and_no_gap(read, chunk):
    gyros = lines(200, b"$GYR,")
    mixed = b"2026-03-01 12:00:00 start\r\n# a comment\r\n"
    for line in gyros:
        mixed += line + b"$ACC,1,2,-981\r\n" * 3 + b"$MAG,10,20\r\n"
    frames, record = read(mixed, text_board("$GYR"), IntegrityOptions(), chunk)
    assert (record.frames.good, record.frames.bad, record.frames.lost) == (200, 0, 0)
    assert (record.damage, record.gaps, record.status, record.segments) == ([], [], "good", 1)
    assert frames.time[-1] == pytest.approx(1.99)
    assert "802 lines of another kind were passed over; nothing is missing for them" in record.warnings


@pytest.mark.parametrize("chunk", [5, 1 << 22])
def test_without_a_prefix_lines_with_words_and_recurring_letters_are_other(read, chunk):
    mixed = b"time ax ay\n"
    for line in lines(100, b"", b"\n"):
        mixed += line + b"A,1,2\n"
    mixed += b"# end\n"
    _, record = read(mixed, text_board(), IntegrityOptions(), chunk)
    assert (record.frames.good, record.frames.bad, record.frames.lost, record.damage) == (100, 0, 0, [])


def test_a_single_line_that_begins_with_a_letter_is_damage(read):
    whole = lines()
    whole[40] = b"x" + whole[40][1:]
    _, record = read(b"".join(whole), text_board())
    assert (record.frames.good, record.frames.bad, record.frames.lost) == (99, 1, 1)
    assert record.damage[0].cause == "form"


def test_a_truncated_line_is_damage_and_other_lines_beside_it_are_not(read):
    whole = lines(100, b"$GYR,")
    mixed = [part for line in whole for part in (b"$ACC,1,2\r\n", line)]
    mixed[81] = mixed[81][:8]  # it runs into the line after it: one other line less
    frames, record = read(b"".join(mixed), text_board("$GYR"))
    assert (record.frames.good, record.frames.bad, record.frames.lost) == (99, 1, 1)
    assert (len(record.damage), record.damage[0].frames_lost, record.damage[0].cause) == (1, 1, "form")
    start = len(b"".join(mixed[:81]))
    assert record.damage[0].start == start
    assert np.flatnonzero(np.diff(frames.time) > 0.015).tolist() == [39]
    assert any(text.startswith("line 82 of x.csv, ") and "does not fit: " in text for text in record.warnings)


def test_a_line_without_its_beginning_is_damage_unless_its_form_recurs():
    frame = text_board("$GYR").layout
    kinds = Kinds(frame)
    assert not kinds.is_other(b"YR,1,2")
    assert not kinds.is_other(b",1,2")
    assert not kinds.is_other(b"$GYX,1,2")
    assert not kinds.is_other(b"acc 1 2$GYR,1,2,3")
    assert not kinds.is_other(b"\x01\x02\x03")
    assert kinds.is_other(b"$GYX,one,2")
    assert kinds.is_other(b"hello")
    assert Kinds(frame, [b"$GYX/2"]).is_other(b"$GYX,1,2")


def test_two_lines_in_one_count_as_two_where_that_shows():
    assert Kinds(text_board("$G").layout).count(b"$G,1,2$G,3,4") == 2
    assert Kinds(text_board(fields=("a", "b", "c")).layout).count(b"1,2,31,2,3") == 2
    assert Kinds(text_board(fields=("a", "b", "c")).layout).count(b"1,2,3,4") == 1
    assert Kinds(text_board().layout).count(b"1,21,2") == 1


def test_three_lines_of_a_form_make_a_kind_and_two_do_not():
    frame = text_board().layout
    assert recurring_forms(b"1,2\n" + b"A,1,2\n" * 3, frame) == {b"A/2"}
    assert recurring_forms(b"1,2\n" + b"A,1,2\n" * 2, frame) == set()
    # Bare numbers with other fields than ours: only as a fifth of the lines.
    assert recurring_forms(b"1,2\n" * 16 + b"1,2,3\n" * 4, frame) == {b"/2"}
    assert recurring_forms(b"1,2\n" * 17 + b"1,2,3\n" * 4, frame) == set()


@pytest.mark.parametrize("separator", [",", ", ", " , ", ";", " ", "  ", "::", "\t"])
def test_any_run_of_blanks_may_stand_about_a_separator(read, separator):
    sign = separator.strip()
    for between in {separator, sign or " ", f" {sign}  "}:
        data = "".join(f"{i},{2 * i}\r\n".replace(",", between) for i in range(50)).encode()
        frames, record = read(data, text_board(separator=separator), IntegrityOptions())
        assert frames.counts["b"].tolist() == list(range(0, 100, 2))
        assert record.damage == []


@pytest.mark.parametrize("prefix", ["$VNYMR", "$VNYMR,", "$VNYMR, "])
def test_a_prefix_may_end_with_the_separator(read, prefix):
    board = text_board(prefix, kind="f64")
    assert opening(board.layout) == b"$VNYMR"
    frames, _ = read(b"$VNYMR,+006.271,-000.031\r\n" * 20, board, IntegrityOptions())
    assert frames.counts["a"][0] == 6.271


def test_after_a_sign_the_first_field_may_follow_at_once(read):
    frames, _ = read(b"G:1,2\r\n" * 20, text_board("G:"), IntegrityOptions())
    assert len(frames.time) == 20


def test_a_separator_after_the_last_field_and_a_byte_order_mark_do_no_harm(read):
    data = b"\xef\xbb\xbf" + b"".join(lines(50, b"", b",\r\n"))
    _, record = read(data, text_board(), IntegrityOptions())
    assert (record.frames.good, record.damage) == (50, [])


def test_a_number_of_too_many_digits_is_damage_not_a_crash(read):
    data = b"".join(lines(50)) + b"9999999999999999999,1\r\n" + b"".join(lines(50))
    _, record = read(data, text_board(kind="i64"))
    assert (record.frames.good, record.frames.bad) == (100, 1)


# The first line of a text without checksum.
def test_a_first_line_that_fits_the_sequence_is_kept(read):
    data = b"".join(b"%d,5,6\r\n" % index for index in range(30))
    assert read(data[0:], text_board(counter=True))[1].frames.good == 30
    data = b"".join(b"%d,5,6\r\n" % index for index in range(9, 30))
    assert read(data, text_board(counter=True))[1].frames.good == 21


def test_a_first_line_that_lost_its_beginning_is_dropped(read):
    data = b"".join(b"%d,5,6\r\n" % index for index in range(1234, 1260))
    assert read(data[1:], text_board(counter=True))[1].frames.good == 25
    assert read(data[5:], text_board(counter=True))[1].frames.good == 25  # fewer fields
    # With a prefix nothing can be missing.
    data = b"$G,9000,1\r\n" + b"$G,1,2\r\n" * 20
    assert read(data, text_board("$G"))[1].frames.good == 21


def test_a_first_value_must_lie_among_its_neighbours():
    board = text_board()
    after = [b"-10", b"10", b"0"]
    assert first_is_whole(b"30", after, board)
    assert not first_is_whole(b"31", after, board)
    assert first_is_whole(b"-30", after, board)
    assert not first_is_whole(b"-31", after, board)
    assert first_is_whole(b"7", [], board)


def test_a_first_time_stamp_steps_as_the_next_one_does():
    board = text_board(counter=True)
    board = board.model_copy(update={"counter": None, "timestamp": _stamp(wrap=None)})
    assert first_is_whole(b"980", [b"1000", b"1010"], board)
    assert not first_is_whole(b"979", [b"1000", b"1010"], board)
    assert not first_is_whole(b"1000", [b"1000", b"1010"], board)
    wrapped = board.model_copy(update={"timestamp": _stamp(wrap=1000)})
    assert first_is_whole(b"995", [b"5", b"15"], wrapped)


def _stamp(wrap):
    from vgyro.board import TimeStamp

    return TimeStamp(field="n", tick_s=0.001, wrap=wrap)


# The last line without its end.
@pytest.mark.parametrize("chunk", [5, 1 << 22])
def test_a_last_line_of_the_usual_width_is_whole(read, chunk):
    data = b"".join(b"%d,%d\r\n" % (index, 10 + index) for index in range(50))
    assert read(data[:-2], text_board(), LENIENT, chunk)[1].frames.good == 50
    _, record = read(data[:-3], text_board(), LENIENT, chunk)
    assert record.frames.good == 49
    assert (record.damage[0].cause, record.frames.bad) == ("truncated at the end", 1)
    assert "line 50 of x.csv, the last, has no line end and may be cut: it is left out" in record.warnings


def test_a_last_field_of_changing_width_does_not_show_that_it_is_whole(read):
    data = b"".join(b"1,%d\n" % (index % 12) for index in range(50))
    assert read(data[:-1], text_board())[1].frames.good == 49


def test_all_decimals_show_that_the_last_line_is_whole(read):
    data = b"".join(b"%.3f,%.3f\n" % (index, 10.0 ** (index % 4)) for index in range(50))
    board = text_board(kind="f64", decimals=3)
    assert read(data[:-1], board)[1].frames.good == 50
    assert read(data[:-2], board)[1].frames.good == 49


# What a refusal says.
def refused(read, data, board) -> str:
    with pytest.raises(Refused) as caught:
        read(data, board, IntegrityOptions())
    assert "checksum" not in str(caught.value) or board.layout.checksum.family != "none"
    assert caught.value.integrity.frames.bad <= data.count(b"\n") + 1
    return str(caught.value)


def test_too_few_fields_name_the_line(read):
    message = refused(read, b"# log\r\n" + b"1,2\r\n" * 30, text_board(fields=("a", "b", "c")))
    assert message.endswith(
        'x.csv: no good line of board text (30 that do not fit, 1 of another kind); line 2 of x.csv, "1,2", does not'
        " fit: too few fields: 2 of 3. Mend `frame` in the file of board text (prefix, separator, fields), or `board`."
    )


def test_a_prefix_that_is_nowhere_shows_the_first_line(read):
    message = refused(read, b"\r\n$GYR,1,2\r\n" * 30, text_board("$VG"))
    assert 'line 2 of x.csv, "$GYR,1,2", does not fit: it does not begin with "$VG"' in message
    assert "(0 that do not fit, 30 of another kind)" in message


def test_wrong_checksums_say_which_and_what(read, board):
    data = b"".join(dsp6_text_line(index, range(6)) for index in range(30)).replace(b"$VG,", b"$VG, ")
    message = refused(read, data, board("dsp6-text"))
    assert "does not fit: its checksum is " in message
    assert ", computed " in message


def test_text_of_two_bytes_a_character_is_called_so(read):
    data = "".join(f"{i},{i}\r\n" for i in range(30)).encode("utf-16")
    assert "x.csv is UTF-16 text, two bytes a character: save it as UTF-8" in refused(read, data, text_board())


def test_too_small_a_share_names_the_first_line_that_does_not_fit(read):
    data = b"".join(lines(20)) + b"1,2,3\r\n" * 30
    message = refused(read, data, text_board())
    assert "only 40 % of the lines are good (20 good, 0 lost, 30 that do not fit)" in message
    assert 'line 21 of x.csv, "1,2,3", does not fit: too many fields: 3 of 2' in message


@pytest.mark.parametrize(
    ("line", "frame", "expected"),
    [
        (b"1,2", {"fields": ("a", "b", "c")}, "too few fields: 2 of 3"),
        (b"1;2", {}, "one field of 2 between separators ','"),
        (b"1,2,3", {}, "too many fields: 3 of 2"),
        (b"1,abc", {}, 'field 2 (b) "abc" is no number'),
        (b"1,", {"fields": ("a",)}, ""),
        (b",2", {}, "field 1 (a) is empty"),
        (b"1.5,2", {}, 'field 1 (a) "1.5" is no whole number (type i16)'),
        (b"32767,2", {}, ""),
        (b"32768,2", {}, "field 1 (a) 32768 is out of range of i16"),
        (b"-1,2", {"kind": "u16"}, "field 1 (a) -1 is out of range of u16"),
        (b"1.50,2.5", {"kind": "f64", "decimals": 2}, 'field 2 (b) "2.5" has 1 digits after the point, not 2'),
        (b"1,0", {"require": {"b": 1}}, "field 2 (b) is 0, not 1"),
        (b"$V,1,2*0C", {"prefix": "$V", "checksum": {"family": "xor", "width": 8}}, "its checksum is 0C, computed"),
        (b"$V,1,2", {"prefix": "$V", "checksum": {"family": "xor", "width": 8}}, "it has no checksum"),
        (b"$W,1,2", {"prefix": "$V"}, 'it does not begin with "$V"'),
    ],
)  # fmt: skip
def test_what_does_not_fit_in_a_line(line, frame, expected):
    fault = fault_of(line, text_board(**frame).layout)
    assert fault.startswith(expected)
    assert bool(fault) == bool(expected)


def test_other_lines_do_not_count_as_the_boards_share(dump):
    data = b"".join(line + b"$ACC,1,2,3\r\n" * 9 for line in lines(100, b"$GYR,"))
    (found,) = sniff(dump(data), [text_board("$GYR")])
    assert found.frames == 100
    assert found.good_share < 0.2


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), chunk=st.integers(1, 2000), prefix=st.sampled_from(["", "$G"]))
def test_the_size_of_the_chunks_changes_nothing(tmp_path_factory, seed, chunk, prefix):
    rng = np.random.default_rng(seed)
    head = f"{prefix}," if prefix else ""
    kinds = [f"{head}{{}},{{}}\r\n", "A,{},{}\r\n", "# note {} {}\r\n", "\r\n", "1,2", "{}{}\r", "x" * 5000 + "\n"]
    chosen = rng.choice(len(kinds), 120, p=[0.7, 0.1, 0.05, 0.05, 0.04, 0.04, 0.02])
    text = "".join(kinds[kind].format(*rng.integers(-99, 99, 2)) for kind in chosen).encode()
    path = tmp_path_factory.mktemp("chunks") / "x.csv"
    path.write_bytes(text[int(rng.integers(6)) : len(text) - int(rng.integers(6))])
    results = []
    for size in (chunk, 1 << 22):
        reader = DumpReader([path], text_board(prefix), 100, LENIENT, size)
        results.append((gather(reader, text_board(prefix)), reader.integrity))
    (one, first), (other, second) = results
    assert first == second
    assert np.array_equal(one.counts["a"], other.counts["a"])
    assert np.array_equal(one.time, other.time)

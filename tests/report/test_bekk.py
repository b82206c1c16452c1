"""DCC against its alternatives: figures of the made-up windows of bench_volatility, counted by hand."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from vgyro.report.model import ArrayPart
from vgyro.report.volatility.bekk import bekk_part, compare, sentence
from vgyro.report.volatility.section import volatility_part
from vgyro.tasks.common import Task
from vgyro.tasks.pages.report import read_dataset_part


@pytest.fixture(scope="module")
def array(report_task: Task) -> ArrayPart:
    return next(one for one in read_dataset_part(report_task).arrays if one.anchor == "rest-x")


def changed(array: ArrayPart, model: str, name: str, value: float) -> ArrayPart:
    table = {key: column.copy() for key, column in array.tables["bekk"].items()}
    table[name][table["model"] == model] = value
    return replace(array, tables={**array.tables, "bekk": table})


def test_the_least_bic_is_counted_window_by_window(array: ArrayPart) -> None:
    # Beside DCC: CCC has 2 parameters less, 2·ln 360 = 11.8 of BIC, and loses 6, 6, 40; scalar BEKK 8 less, 47.1, and
    # loses 60; diagonal 2 less and loses 18. So CCC has the least twice and DCC once, in each of two definitions.
    found = {one.model: one for one in compare(array.tables["bekk"])}
    assert [int(found[name].least.sum()) for name in ("ccc", "dcc", "bekk_scalar", "bekk_diagonal")] == [4, 2, 0, 0]
    np.testing.assert_allclose(found["ccc"].bic[:3], np.array([6.0, 6.0, 40.0]) - 2 * np.log(360))
    # Geometric means of 0.9, 0.8, 1.01 and of 1.1, 0.9, 1.1.
    assert found["bekk_diagonal"].mean_ratio == pytest.approx((0.9 * 0.8 * 1.01) ** (1 / 3))
    assert found["bekk_diagonal"].better == 4
    assert not found["bekk_diagonal"].weighs_better, "four of six windows are not three quarters"


def test_the_sentence_says_who_fits_and_who_weighs_better(array: ArrayPart) -> None:
    said = sentence(compare(array.tables["bekk"]))
    assert said.startswith("Of 6 fits of all definitions the least BIC has CCC in 4, DCC in 2.")
    assert "none weighs better" in said
    assert "BEKK, diagonal 0.899 (less in 4 of 6)" in said
    better = changed(array, "bekk_diagonal", "sigma", 0.049)
    assert "BEKK, diagonal weighs better" in sentence(compare(better.tables["bekk"]))
    none = changed(array, "bekk_scalar", "bic", np.nan)
    assert sentence(compare(none.tables["bekk"])) == "In no window could all four models be fitted."


def test_the_table_has_a_part_for_each_definition(array: ArrayPart) -> None:
    html = bekk_part(array)
    assert html.count("definition “") == 2
    row = re.search(r">BEKK, scalar<.*?</tr>", html, re.S).group(0)
    assert [text for text in re.findall(r">([^<]+)<", row) if text.strip()][1:8] == [
        "3", "12", "−30.0", "+12.9", "0", "0.0600", "1.20",
    ]  # fmt: skip
    assert "DCC against its alternatives" in volatility_part(array)
    without = {name: table for name, table in array.tables.items() if name != "bekk"}
    assert bekk_part(replace(array, tables=without)) == ""
    page = volatility_part(replace(array, tables=without))
    assert "ARCH-LM" in page
    assert "BEKK" not in page
    assert "alternatives" not in page

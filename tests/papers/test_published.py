"""The transcription of the two papers: shapes, cells checked by the tables' own arithmetic."""

import numpy as np
import pytest

from vgyro.papers import PAPERS, load_paper
from vgyro.papers.implied_cells import jiang_correlation
from vgyro.papers.published import PublishedTable, half_unit

J, L = load_paper("jiang2012"), load_paper("liu2015")
# Rows, columns and printed numbers of each table, counted in the papers.
SHAPES = {
    ("jiang2012", 1): (6, 6, 36),
    ("jiang2012", 2): (4, 4, 16),
    ("jiang2012", 3): (3, 5, 15),
    ("liu2015", 1): (6, 2, 12),
    ("liu2015", 2): (6, 6, 36),
    ("liu2015", 3): (12, 4, 48),
}


@pytest.mark.parametrize(("paper", "number"), SHAPES)
def test_every_numeric_cell_is_there(paper, number):
    table = load_paper(paper).table(number)
    cells = [text for row in table.values for text in row if text is not None]
    assert (len(table.rows), len(table.columns), len(cells)) == SHAPES[paper, number]
    assert all(np.isfinite(float(text)) for text in cells)


@pytest.mark.parametrize("name", PAPERS)
def test_names_are_unique(name):
    for table in load_paper(name).tables:
        for headings in ([*table.rows, *table.extra_rows], [*table.columns, *table.extra_columns]):
            assert len({heading.name for heading in headings}) == len(headings)
    claims = [claim.name for claim in load_paper(name).claims]
    assert len(set(claims)) == len(claims)


def test_jiang_correlations_are_symmetric_with_a_unit_diagonal():
    matrix = jiang_correlation(J)
    np.testing.assert_array_equal(matrix, matrix.T)
    np.testing.assert_array_equal(np.diag(matrix), 1.0)
    assert np.linalg.eigvalsh(matrix).min() > 0


def test_jiang_abstract_repeats_the_tables():
    # The abstract rounds: 6.2 and 1.8, 54.1 and 16.3, 2.4 and 20.6.
    table = J.table(2)
    printed = {
        ("ARW", "Single gyroscope"): 6.2,
        ("ARW", "1st order Markov"): 1.8,
        ("ARW", "Random walk"): 2.4,
        ("Bias Drift", "1st order Markov"): 16.3,
        ("Bias Drift", "Random walk"): 20.6,
    }
    for (row, column), value in printed.items():
        assert round(table.number_at(row, column), 1) == pytest.approx(value, abs=0.051)


def test_jiang_table_3_has_the_headings_of_its_two_header_rows():
    table = J.table(3)
    names = "Constant rate: Mean, Constant rate: 1σ, Random rate: 1σ, Sinusoidal rate: Amplitude, Sinusoidal rate: 1σ"
    assert [column.name for column in table.columns] == names.split(", ")
    # The text of section 3.4 gives these again.
    assert table.number_at("Random walk", "Sinusoidal rate: 1σ") == 1.80
    assert table.number_at("1st order Markov", "Sinusoidal rate: Amplitude") == 62.29
    assert table.number_at("1st order Markov", "Random rate: 1σ") == 0.29


def test_liu_ranges_of_the_text_are_those_of_table_3():
    # Section 5: 1σ 0.0418-0.0545 but for gyro 4, ARW 1.73-2.94, bias drift 32.78-73.19.
    table = L.table(3)

    def column(name):
        return [table.number_at(f"Gyro {number}", name) for number in range(1, 7)]

    healthy = [value for index, value in enumerate(column("1σ")) if index != 3]
    assert (min(healthy), max(healthy)) == (0.0418, 0.0545)
    assert (min(column("ARW")), max(column("ARW"))) == (1.73, 2.94)
    assert (min(column("Bias Drift")), max(column("Bias Drift"))) == (32.78, 73.19)


def test_liu_average_of_the_means_is_the_mean_of_the_average():
    # 0.1458 / 6 = 0.0243: a slip in one transcribed mean would break it.
    table = L.table(3)
    means = [table.number_at(f"Gyro {number}", "Mean") for number in range(1, 7)]
    assert np.mean(means) == pytest.approx(table.number_at("Simple average", "Mean"), abs=5e-5)


def test_liu_garch_is_stationary():
    table = L.table(2)
    for row in table.rows:
        assert table.number_at(row.name, "α: Value") + table.number_at(row.name, "β: Value") < 1.0


def test_a_row_with_a_missing_value_is_refused():
    record = J.table(2).model_dump()
    record["values"] = [record["values"][0][:-1], *record["values"][1:]]
    with pytest.raises(ValueError, match="3 values, 4 columns"):
        PublishedTable.model_validate(record)


def test_a_cell_without_a_unit_is_refused():
    record = J.table(3).model_dump()
    record["unit"] = None
    with pytest.raises(ValueError, match="no unit"):
        PublishedTable.model_validate(record)


@pytest.mark.parametrize(("text", "half"), [("1.83", 0.005), ("4.94e-4", 5e-7), ("0.0000", 5e-5), ("0", 0.5)])
def test_half_unit_of_the_last_digit(text, half):
    assert half_unit(text) == pytest.approx(half, rel=1e-12)


def test_an_unknown_paper_is_named():
    with pytest.raises(KeyError, match="bayard2003"):
        load_paper("bayard2003")

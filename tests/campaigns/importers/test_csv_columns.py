"""Tables of text with a header: cells by column, and every fault of a file, a row or a cell in one line."""

import numpy as np
import pytest
from support import refused

from elastocal.campaigns.importers.csv_columns import numbers, read_columns


@pytest.fixture
def file(tmp_path):
    """Writes a file and gives its path."""

    def written(contents):
        path = tmp_path / "table.csv"
        path.write_bytes(contents)
        return path

    return written


def test_cells_come_by_the_names_of_the_header(file):
    found = read_columns(file(b"b;a\n1;x\n2;y z\n"), ";", ("a",), "a table")
    assert found == {"b": ("1", "2"), "a": ("x", "y z")}


@pytest.mark.parametrize(
    ("contents", "key", "words"),
    [
        (b"", "", ["no row of data", "a header and rows"]),
        (b"a,b\n", "", ["no row of data"]),
        (b"a,b\n1,2\n\n1\n", "row 2", ["1 cell", "2, one for each column"]),
        (b"a,b\n1,2,3\n", "row 1", ["3 cells", "2, one for each column"]),
        (b"a,c\n1,2\n", "header", ["no column 'b'", "the made source"]),
        (b"a,b\n1,\xff\n", "line 2", ["not UTF-8"]),
        (b'a,b\n"1,2\n', "", ["columns separated by ,"]),
    ],
)
def test_text_that_is_no_such_table_is_refused(file, contents, key, words):
    path = file(contents)
    with refused(path, key, *words):
        read_columns(path, ",", ("a", "b"), "the made source")


@pytest.mark.parametrize(("decimal", "cells"), [(".", ("1", "-2.5", " 3e-3 ", "+4.")), (",", ("1", "-2,5", " 3e-3 ", "+4,"))])
def test_numbers_are_read_with_the_decimal_sign_of_the_source(decimal, cells):
    found = numbers("table.csv", "x", cells, decimal)
    np.testing.assert_array_equal(found, [1.0, -2.5, 0.003, 4.0])
    assert found.dtype == float


@pytest.mark.parametrize("cell", ["", "x", "1.2.3", "nan", "inf", "-Infinity", "1 2"])
@pytest.mark.parametrize(("decimal", "word"), [(".", "a number"), (",", "a number with a decimal comma")])
def test_a_cell_that_is_no_finite_number_is_named_by_row_and_column(cell, decimal, word):
    with refused("table.csv", "row 3, column q 1", repr(cell), word):
        numbers("table.csv", "q 1", ("1", "2", cell, "4"), decimal)

"""Dialects of text tables are detected, and faults are refused with their line."""

import numpy as np
import pytest
from support import refused

from elastocal.campaigns import tables
from elastocal.campaigns.tables import Dialect, read_text_table


def read(folder, text, encoding="utf-8", dialect=None, **options):
    """Write a text to a file and read it as a table with columns x and y."""
    path = folder / "table.txt"
    path.write_bytes(text.encode(encoding))
    return read_text_table(
        path, lambda cells: {"x", "y"} <= set(cells), dialect or Dialect(), **options
    )


X = {"x": ("1.234",)}
# The commas may be decimal marks or separators of thousands.
AMBIGUOUS = "x;y\n1,234;22,500\n"


@pytest.mark.parametrize(
    ("text", "options", "columns"),
    [
        # An option or another number resolves an ambiguity. Detection in general is
        # tested in tests/fuzz/test_dialects.py.
        (AMBIGUOUS, {"dialect": Dialect(decimal="comma")}, X),
        ("x;y\n1,234;0,500\n", {}, X),
        # Spaces between thousands, wide, narrow or not to be broken.
        ("x;y\n-1 203,114;1\u00a0000\n", {}, {"x": ("-1203.114",), "y": ("1000",)}),
        ("x;y\n1\u202f203,1;1 2\n", {}, {"x": ("1203.1",), "y": ("1 2",)}),
        ("# x;y\n1.234;2\n", {"dialect": Dialect(header=1)}, X),
        ("x;y;n;n\n1.234;2;1,5;1.2.3\n", {"ignored": ["n"]}, X),
        # The header is a comment; a header that is no comment takes precedence.
        *(
            (f"{mark}made by hand\n{mark}x,y,n\n1.234,2,3\n", {}, X | {"n": ("3",)})
            for mark in ("#", "% ", "// ")
        ),
        ("# x,y,n\nn,x,y\n1,1.234,3\n# 4\n", {}, X | {"n": ("1",)}),
        # Columns without a name and rows are ignored if all their cells are empty.
        *(
            (text, {}, {"x": ("1",), "y": ("2",)})
            for text in ("x,y,,\n1,2,,\n,,,\n", ",x,,y\n,1,,2\n", "x,y\n1,2,,,\n")
        ),
        ("# raw\n1.234,2,3\n", {"names": ["x", "y", "n"]}, X | {"n": ("3",)}),
    ],
)
def test_a_table_is_read_with_stated_options_and_without_empty_rows_and_columns(
    tmp_path, text, options, columns
):
    assert read(tmp_path, text, **options).columns.items() >= columns.items()


def test_the_detected_dialect_is_returned(tmp_path):
    table = read(
        tmp_path,
        "Tracker 7\r\n# made by hand\r\n\r\nx;y;n;\r\n1,5;-2,25e-3;P1;\r\n;\r\n# end",
        "utf-16",
    )
    assert table.dialect == Dialect("semicolon", "comma", 4, "utf-16")
    assert table.lines == (5,)
    assert [*table.columns] == ["x", "y", "n"]


@pytest.mark.parametrize(
    ("text", "phrases", "options"),
    [
        ("", ["nothing but comments"], {}),
        ("a;b\n1;2\n", ["line 1", "--header"], {}),
        ("x;y\n", ["a header alone"], {}),
        ("x;y;x\n1;2;3\n", ["line 1", "'x' twice", "--ignore 'x'"], {}),
        ("x;y\n1;2\n1\n", ["line 3", "1 cell", "2, one for each"], {}),
        ("x;y\n1,5;2.5\n", ["'2.5' in line 2", "'1,5' in line 2", "--decimal"], {}),
        # A comma before three digits, or in quotes between commas, is ambiguous.
        (AMBIGUOUS, ["line 2", "'1,234'", "--decimal comma"], {}),
        ('x,y\n"1,5",2\n', ["line 2", "'1,5'", "--decimal comma"], {}),
        ('x;y\n"1;2\n', ["line 2", "quotes in pairs"], {}),
        ("x;y\n1;\x002\n", ["line 2", r"the character '\x00'", "UTF-16"], {}),
        *(
            (f"x;y\n1{character};2\n", ["line 2", ascii(character), "printable"], {})
            for character in "\x1b\u202e"
        ),
        (
            "x;y\n1;2\n",
            ["line 1", "no column 'm' to ignore", "x, y"],
            {"ignored": ["m"]},
        ),
        (
            "1,2,3\n",
            ["line 1", "2, one for each column of --columns"],
            {"names": ["x", "y"]},
        ),
    ],
)
def test_an_unreadable_or_ambiguous_table_is_refused_with_its_line(
    tmp_path, text, phrases, options
):
    with refused((tmp_path / "table.txt").as_posix(), "", *phrases):
        read(tmp_path, text, **options)


@pytest.mark.parametrize(
    ("limit", "largest", "phrase"),
    [("MOST_LINES", 200, "201 lines"), ("LARGEST_BYTES", 100, "more than 100 bytes")],
)
def test_a_table_larger_than_any_campaign_is_refused_before_its_lines_are_read(
    tmp_path, monkeypatch, limit, largest, phrase
):
    monkeypatch.setattr(tables, limit, largest)
    # A call of this function would fail.
    monkeypatch.setattr(tables, "find_control_character", None)
    with refused(tmp_path / "table.txt", "", phrase):
        read(tmp_path, "x;y\n" + "1;2\n" * 200)


@pytest.mark.parametrize(("name", "encoding"), [("°", "cp1252"), ("角度", "gb18030")])
def test_an_unmarked_encoding_other_than_utf_8_must_be_stated(tmp_path, name, encoding):
    text = f"x;y;{name}\n1;2;3\n"
    with refused(tmp_path / "table.txt", "line 1", "not UTF-8", "--encoding cp1252"):
        read(tmp_path, text, encoding)
    table = read(tmp_path, text, encoding, Dialect(encoding=encoding))
    assert [*table.columns] == ["x", "y", name]
    with refused("--encoding", "", "'klingon'", "cp1252"):
        read(tmp_path, text, dialect=Dialect(encoding="klingon"))


def test_cells_are_numbers_in_si_units_or_texts_and_a_fault_has_its_line_and_header(
    tmp_path,
):
    table = read(tmp_path, "# made by hand\nx;y;n\n1,5;+2;P1\n\n2,5;1_0; P2\n")
    cells = table.cells({"a": "x", "b": "y", "name": "n"}, {"a": 1e-3})
    assert cells.numbers("a").tolist() == [0.0015, 0.0025]
    assert cells.texts("name") == ["P1", "P2"]
    with refused(
        tmp_path / "table.txt", "line 5, column y", "'1_0'", "a number such as"
    ):
        cells.numbers("b")
    assert table.cells({"b": "y"}, {}, np.array([0])).numbers("b").tolist() == [2.0]
    with refused(tmp_path / "table.txt", "line 3, column x", "'1.5'", "an integer"):
        table.cells({"pose": "x"}, {}).integers("pose")

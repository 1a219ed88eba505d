"""Tables in any dialect: what is found out, and what is refused with its line."""

import numpy as np
import pytest
from support import refused

from elastocal.campaigns import tables
from elastocal.campaigns.tables import Dialect, read_text_table


def read(folder, text, encoding="utf-8", dialect=None, **more):
    path = folder / "table.txt"
    path.write_bytes(text.encode(encoding))
    return read_text_table(
        path, lambda cells: {"x", "y"} <= set(cells), dialect or Dialect(), **more
    )


X = {"x": ("1.234",)}
NO_MARK = "x;y\n1,234;22,500\n"


@pytest.mark.parametrize(
    ("text", "options", "columns"),
    [
        # What an option or another number says; that a dialect is found out rightly,
        # tests/fuzz/test_dialects.py has.
        (NO_MARK, {"dialect": Dialect(decimal="comma")}, X),
        ("x;y\n1,234;0,500\n", {}, X),
        ("# x;y\n1.234;2\n", {"dialect": Dialect(header=1)}, X),
        ("x;y;n;n\n1.234;2;1,5;1.2.3\n", {"ignored": ["n"]}, X),
        # A header behind a comment mark, before which a plain one goes.
        *(
            (f"{mark}made by hand\n{mark}x,y,n\n1.234,2,3\n", {}, X | {"n": ("3",)})
            for mark in ("#", "% ", "// ")
        ),
        ("# x,y,n\nn,x,y\n1,1.234,3\n# 4\n", {}, X | {"n": ("1",)}),
        # Columns without a name, and rows, that are empty throughout.
        *(
            (text, {}, {"x": ("1",), "y": ("2",)})
            for text in ("x,y,,\n1,2,,\n,,,\n", ",x,,y\n,1,,2\n", "x,y\n1,2,,,\n")
        ),
        ("# raw\n1.234,2,3\n", {"names": ["x", "y", "n"]}, X | {"n": ("3",)}),
    ],
)
def test_a_table_is_read_with_what_is_stated_and_without_what_is_empty(
    tmp_path, text, options, columns
):
    assert read(tmp_path, text, **options).columns.items() >= columns.items()


def test_what_is_found_out_is_told(tmp_path):
    found = read(
        tmp_path,
        "Tracker 7\r\n# made by hand\r\n\r\nx;y;n;\r\n1,5;-2,25e-3;P1;\r\n;\r\n# end",
        "utf-16",
    )
    assert found.dialect == Dialect(
        "semicolon", "comma", 4, "utf-16"
    ) and found.lines == (5,)
    assert [*found.columns] == ["x", "y", "n"]


@pytest.mark.parametrize(
    ("text", "words", "options"),
    [
        ("", ["nothing but comments"], {}),
        ("a;b\n1;2\n", ["line 1", "--header"], {}),
        ("x;y\n", ["a header alone"], {}),
        ("x;y;x\n1;2;3\n", ["line 1", "'x' twice", "--ignore 'x'"], {}),
        ("x;y\n1;2\n1\n", ["line 3", "1 cell", "2, one for each"], {}),
        ("x;y\n1,5;2.5\n", ["'2.5' in line 2", "'1,5' in line 2", "--decimal"], {}),
        # Three digits behind each comma, or a comma in quotes between commas, may be
        # either.
        (NO_MARK, ["line 2", "'1,234'", "--decimal comma"], {}),
        ('x,y\n"1,5",2\n', ["line 2", "'1,5'", "--decimal comma"], {}),
        ('x;y\n"1;2\n', ["line 2", "quotes in pairs"], {}),
        ("x;y\n1;\x002\n", ["line 2", r"the character '\x00'", "UTF-16"], {}),
        *(
            (f"x;y\n1{each};2\n", ["line 2", ascii(each), "printable"], {})
            for each in "\x1b\u202e"
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
def test_what_cannot_be_read_or_in_two_ways_is_refused_with_its_line(
    tmp_path, text, words, options
):
    with refused((tmp_path / "table.txt").as_posix(), "", *words):
        read(tmp_path, text, **options)


@pytest.mark.parametrize(
    ("limit", "largest", "words"),
    [("MOST_LINES", 200, "201 lines"), ("LARGEST_BYTES", 100, "more than 100 bytes")],
)
def test_more_than_a_campaign_can_have_is_refused_at_once(
    tmp_path, monkeypatch, limit, largest, words
):
    monkeypatch.setattr(tables, limit, largest)
    # Before any line is looked at.
    monkeypatch.setattr(tables, "find_control_character", None)
    with refused(tmp_path / "table.txt", "", words):
        read(tmp_path, "x;y\n" + "1;2\n" * 200)


@pytest.mark.parametrize(("name", "encoding"), [("°", "cp1252"), ("角度", "gb18030")])
def test_an_encoding_that_is_neither_utf_8_nor_marked_is_asked_for(
    tmp_path, name, encoding
):
    text = f"x;y;{name}\n1;2;3\n"
    with refused(tmp_path / "table.txt", "line 1", "not UTF-8", "--encoding cp1252"):
        read(tmp_path, text, encoding)
    assert [*read(tmp_path, text, encoding, Dialect(encoding=encoding)).columns] == [
        "x",
        "y",
        name,
    ]
    with refused("--encoding", "", "'klingon'", "cp1252"):
        read(tmp_path, text, dialect=Dialect(encoding="klingon"))


def test_cells_are_numbers_in_si_units_or_texts_and_a_fault_has_its_line_and_header(
    tmp_path,
):
    found = read(tmp_path, "# made by hand\nx;y;n\n1,5;+2;P1\n\n2,5;1_0; P2\n")
    cells = found.cells({"a": "x", "b": "y", "name": "n"}, {"a": 1e-3})
    assert cells.numbers("a").tolist() == [0.0015, 0.0025] and cells.texts("name") == [
        "P1",
        "P2",
    ]
    with refused(
        tmp_path / "table.txt", "line 5, column y", "'1_0'", "a number such as"
    ):
        cells.numbers("b")
    assert found.cells({"b": "y"}, {}, np.array([0])).numbers("b").tolist() == [2.0]
    with refused(tmp_path / "table.txt", "line 3, column x", "'1.5'", "an integer"):
        found.cells({"pose": "x"}, {}).integers("pose")

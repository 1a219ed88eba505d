"""Tables in any dialect: what is found out, and what is refused with its line."""

import numpy as np
import pytest
from support import refused

from elastocal.campaigns import tables
from elastocal.campaigns.tables import Dialect, read_text_table


def read(folder, text, encoding="utf-8", dialect=None, **more):
    path = folder / "table.txt"
    path.write_bytes(text.encode(encoding))
    return read_text_table(path, lambda cells: {"x", "y"} <= set(cells), dialect or Dialect(), **more)


def test_what_is_found_out_is_told(tmp_path):
    """That it is found out rightly, tests/fuzz/test_dialects.py has."""
    found = read(tmp_path, "Tracker 7\r\n# made by hand\r\n\r\nx;y;n\r\n1,5;-2,25e-3;P1\r\n", "utf-16")
    assert found.dialect == Dialect("semicolon", "comma", 4, "utf-16") and found.lines == (5,)
    assert found.columns == {"x": ("1.5",), "y": ("-2.25e-3",), "n": ("P1",)}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["nothing but comments"]),
        ("a;b\n1;2\n", ["line 1", "--header"]),
        ("x;y\n", ["a header alone"]),
        ("x;y;x\n1;2;3\n", ["line 1", "'x' twice", "--ignore 'x'"]),
        ("x;y\n1;2\n1\n", ["line 3", "1 cell", "2, one for each"]),
        ("x;y\n1,5;2.5\n", ["'2.5' in line 2", "'1,5' in line 2", "--decimal"]),
        # Three digits behind each comma, or a comma in quotes between commas, may be either.
        ("x;y\n1,234;22,500\n", ["line 2", "'1,234'", "--decimal comma"]),
        ('x,y\n"1,5",2\n', ["line 2", "'1,5'", "--decimal comma"]),
        ('x;y\n"1;2\n', ["line 2", "quotes in pairs"]),
        ("x;y\n1;\x002\n", ["line 2", r"the character '\x00'", "UTF-16"]),
        *((f"x;y\n1{each};2\n", ["line 2", ascii(each), "printable"]) for each in "\x1b\u202e"),
        # A blank that does not break.
        ("x;y\n1\u00a0;2\n1\n", ["line 3", "1 cell"]),
    ],
)
def test_what_cannot_be_read_or_in_two_ways_is_refused_with_its_line(tmp_path, text, words):
    with refused((tmp_path / "table.txt").as_posix(), "", *words):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "dialect"),
    [
        ("x;y\n1,234;22,500\n", Dialect(decimal="comma")),
        ("x;y\n1,234;0,500\n", Dialect()),
        ("# x;y\n1.234;2\n", Dialect(header=1)),
    ],
)
def test_what_an_option_or_another_number_says_is_read(tmp_path, text, dialect):
    assert read(tmp_path, text, dialect=dialect).columns["x"] == ("1.234",)


@pytest.mark.parametrize(
    ("limit", "largest", "words"), [("MOST_LINES", 200, "201 lines"), ("LARGEST_BYTES", 100, "more than 100 bytes")]
)
def test_more_than_a_campaign_can_have_is_refused_at_once(tmp_path, monkeypatch, limit, largest, words):
    monkeypatch.setattr(tables, limit, largest)
    # Before any line is looked at.
    monkeypatch.setattr(tables, "steering", None)
    with refused(tmp_path / "table.txt", "", words):
        read(tmp_path, "x;y\n" + "1;2\n" * 200)


@pytest.mark.parametrize(("name", "encoding"), [("°", "cp1252"), ("角度", "gb18030"), ("Łódź", "cp1250")])
def test_an_encoding_that_is_neither_utf_8_nor_marked_is_asked_for(tmp_path, name, encoding):
    text = f"x;y;{name}\n1;2;3\n"
    with refused(tmp_path / "table.txt", "line 1", "not UTF-8", "--encoding cp1252"):
        read(tmp_path, text, encoding)
    assert [*read(tmp_path, text, encoding, Dialect(encoding=encoding)).columns] == ["x", "y", name]
    with refused("--encoding", "", "'klingon'", "cp1252"):
        read(tmp_path, text, dialect=Dialect(encoding="klingon"))


@pytest.mark.parametrize("mark", ["#", "% ", "// "])
def test_a_header_behind_a_comment_mark_is_found_and_a_plain_one_goes_before(tmp_path, mark):
    found = read(tmp_path, f"{mark}made by hand\n{mark}x,y,n\n1,2,3\n")
    assert found.columns == {"x": ("1",), "y": ("2",), "n": ("3",)} and found.dialect.header == 2
    found = read(tmp_path, f"{mark}x,y,n\nn,x,y\n1,2,3\n{mark}4\n")
    assert found.columns["x"] == ("2",)
    assert found.left_out == ("1 line above the header", "1 line of comments below the header")


@pytest.mark.parametrize(
    "text",
    ["x,y,,\n1,2,,\n,,,\n", ",x,,y\n,1,,2\n", "x,y\n1,2,,,\n", "x;y;\n1;2;\n;;\n\n", "\ufeffx;y\n1;2;;\n"],
)
def test_nameless_columns_and_rows_that_are_empty_throughout_are_left_out(tmp_path, text):
    assert read(tmp_path, text).columns == {"x": ("1",), "y": ("2",)}


def test_columns_to_ignore_are_left_out_whatever_they_hold(tmp_path):
    text = "x;y;n;n\n1,5;2;1.5;1.2.3\n"
    assert read(tmp_path, text, ignored=["n"]).columns == {"x": ("1.5",), "y": ("2",)}
    with refused(tmp_path / "table.txt", "line 1", "no column 'm' to ignore", "x, y, n"):
        read(tmp_path, text, ignored=["m"])


def test_a_table_without_a_header_has_the_names_that_are_stated(tmp_path):
    found = read(tmp_path, "# raw\n1,2,3\n4,5,6\n", names=["x", "y", "n"])
    assert found.columns == {"x": ("1", "4"), "y": ("2", "5"), "n": ("3", "6")} and found.lines == (2, 3)
    for names, words in ((["x", "y"], ["line 2", "2, one for each column of --columns"]), (["x", "y", "x"], ["'x' twice"])):
        with refused(tmp_path / "table.txt", "", *words):
            read(tmp_path, "# raw\n1,2,3\n", names=names)


def test_cells_are_numbers_in_si_units_or_texts_and_a_fault_has_its_line_and_header(tmp_path):
    found = read(tmp_path, "# made by hand\nx;y;n\n1,5;+2;P1\n\n2,5;1_0; P2\n")
    cells = found.cells({"a": "x", "b": "y", "name": "n"}, {"a": 1e-3})
    assert cells.numbers("a").tolist() == [0.0015, 0.0025] and cells.texts("name") == ["P1", "P2"]
    with refused(tmp_path / "table.txt", "line 5, column y", "'1_0'", "a number such as"):
        cells.numbers("b")
    assert found.cells({"b": "y"}, {}, np.array([0])).numbers("b").tolist() == [2.0]
    with refused(tmp_path / "table.txt", "line 3, column x", "'1.5'", "an integer"):
        found.cells({"pose": "x"}, {}).integers("pose")

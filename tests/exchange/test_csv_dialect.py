"""Tables in any dialect: what is found out, and what is refused with its line."""

import itertools

import pytest
from durations import growth
from support import refused

from elastocal.exchange import csv_dialect
from elastocal.exchange.csv_dialect import DECIMALS, SEPARATORS, read_text_table


def is_header(cells):
    return {"x", "y"} <= set(cells)


def written(folder, text, encoding="utf-8"):
    path = folder / "table.txt"
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize(
    ("separator", "decimal"), [pair for pair in itertools.product(SEPARATORS, DECIMALS) if pair != ("comma", "comma")]
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_separator_decimal_mark_encoding_and_header_are_found_out(tmp_path, separator, decimal, encoding):
    mark, point = SEPARATORS[separator], DECIMALS[decimal]
    lines = ["Tracker 7", "# made by hand", "", mark.join("xyn"), mark.join([f"1{point}5", f"-2{point}25e-3", "P1"])]
    found = read_text_table(written(tmp_path, "\r\n".join(lines), encoding), is_header)
    assert (found.dialect.separator, found.dialect.decimal, found.dialect.header) == (separator, decimal, 4)
    assert found.columns == {"x": ("1.5",), "y": ("-2.25e-3",), "n": ("P1",)}
    assert found.lines == (5,)


def test_a_separator_at_the_end_of_rows_and_quotes_are_read(tmp_path):
    found = read_text_table(written(tmp_path, 'x;y;"a;b"\n1;2;3;\n'), is_header)
    assert found.columns == {"x": ("1",), "y": ("2",), "a;b": ("3",)}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["nothing but comments"]),
        ("# a\n\n", ["nothing but comments"]),
        ("a;b\n1;2\n", ["line 1", "--header"]),
        ("x;y\n", ["a header alone"]),
        ("x;y;x\n1;2;3\n", ["line 1", "'x' twice"]),
        ("x;y\n1;2\n1\n", ["line 3", "1 cells", "2, one for each"]),
        ("x;y\n1,5;2.5\n", ["'2.5' in line 2", "'1,5' in line 2", "--decimal"]),
        ('x;y\n"1;2\n', ["line 2"]),
        ("x;y\n1;\x002\n", ["line 2", r"the character '\x00'", "UTF-16"]),
        *((f"x;y\n1{each};2\n", ["line 2", ascii(each), "printable"]) for each in "\x0c\x1b\x85\u2028\u202e\u2067"),
        # A blank that does not break.
        ("x;y\n1\u00a0;2\n1\n", ["line 3", "1 cells"]),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_line(tmp_path, text, words):
    with refused((tmp_path / "table.txt").as_posix(), "", *words):
        read_text_table(written(tmp_path, text), is_header)


def test_lines_that_end_in_any_way_are_counted_as_editors_count_them(tmp_path):
    found = read_text_table(written(tmp_path, "x;y\r1;2\r\n3;4\n\n5;6"), is_header)
    assert found.lines == (2, 3, 5) and found.columns["y"] == ("2", "4", "6")


def test_more_than_a_campaign_can_have_is_refused_at_once(tmp_path, monkeypatch):
    path = written(tmp_path, "x;y\n" + "1;2\n" * 200)
    monkeypatch.setattr(csv_dialect, "MOST_LINES", 200)
    with refused(path, "", "201 lines", "at most 200"):
        read_text_table(path, is_header)
    monkeypatch.setattr(csv_dialect, "LARGEST_BYTES", 100)
    with refused(path, "", "more than 100 bytes"):
        read_text_table(path, is_header)


def test_ten_times_as_many_columns_take_about_ten_times_as_long(tmp_path):
    def read(columns):
        with refused(tmp_path / "table.txt", "line 2"):
            read_text_table(written(tmp_path, ";".join(["x", "y", *map(str, range(columns))]) + "\n1;2\n"), is_header)

    assert growth(lambda: read(3_000), lambda: read(30_000)) < 20


def test_a_missing_file_and_other_encodings_are_refused(tmp_path):
    with refused((tmp_path / "none.csv").as_posix(), "", "No such file", "a table"):
        read_text_table(tmp_path / "none.csv", is_header)
    with refused((tmp_path / "table.txt").as_posix(), "line 1", "UTF-8"):
        read_text_table(written(tmp_path, "x;y;°\n", "latin-1"), is_header)

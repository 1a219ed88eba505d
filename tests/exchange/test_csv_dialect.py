"""Tables in any dialect: what is found out, and what is refused with its line."""

import itertools

import pytest
from support import refused

from elastocal.exchange import csv_dialect
from elastocal.exchange.csv_dialect import DECIMALS, SEPARATORS, Dialect, read_text_table


def is_header(cells):
    return {"x", "y"} <= set(cells)


def write_text_file(folder, text, encoding="utf-8"):
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
    found = read_text_table(write_text_file(tmp_path, "\r\n".join(lines), encoding), is_header)
    assert (found.dialect.separator, found.dialect.decimal, found.dialect.header) == (separator, decimal, 4)
    assert found.columns == {"x": ("1.5",), "y": ("-2.25e-3",), "n": ("P1",)}
    assert found.lines == (5,)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["nothing but comments"]),
        ("# a\n\n", ["nothing but comments"]),
        ("a;b\n1;2\n", ["line 1", "--header"]),
        ("x;y\n", ["a header alone"]),
        ("x;y;x\n1;2;3\n", ["line 1", "'x' twice"]),
        ("x;y\n1;2\n1\n", ["line 3", "1 cell", "2, one for each"]),
        ("x;y\n1,5;2.5\n", ["'2.5' in line 2", "'1,5' in line 2", "--decimal"]),
        ('x;y\n"1;2\n', ["line 2", "quotes in pairs"]),
        ("x;y\n1;\x002\n", ["line 2", r"the character '\x00'", "UTF-16"]),
        *((f"x;y\n1{each};2\n", ["line 2", ascii(each), "printable"]) for each in "\x0c\x1b\x85\u2028\u202e\u2067"),
        # A blank that does not break.
        ("x;y\n1\u00a0;2\n1\n", ["line 3", "1 cell"]),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_line(tmp_path, text, words):
    with refused((tmp_path / "table.txt").as_posix(), "", *words):
        read_text_table(write_text_file(tmp_path, text), is_header)


def test_more_than_a_campaign_can_have_is_refused_at_once(tmp_path, monkeypatch):
    path = write_text_file(tmp_path, "x;y\n" + "1;2\n" * 200)
    monkeypatch.setattr(csv_dialect, "MOST_LINES", 200)
    with refused(path, "", "201 lines", "at most 200"):
        read_text_table(path, is_header)
    monkeypatch.setattr(csv_dialect, "LARGEST_BYTES", 100)
    with refused(path, "", "more than 100 bytes"):
        read_text_table(path, is_header)


@pytest.mark.parametrize(
    ("header", "encoding"),
    [("x;y;°", "cp1252"), ("x;y;µm größe", "cp1252"), ("x;y;z", "utf-16-le"), ("x;y;°", "utf-16-be"), ("x;y;°", "utf-8")],
)
def test_an_encoding_that_can_be_no_other_is_found_out(tmp_path, header, encoding):
    found = read_text_table(write_text_file(tmp_path, f"{header}\n1;2;3\n", encoding), is_header)
    assert list(found.columns) == header.split(";") and found.dialect.encoding == encoding


@pytest.mark.parametrize(
    ("header", "encoding"), [("x;y;角度", "gb18030"), ("x;y;角度", "shift_jis"), ("x;y;°", "cp437"), ("x;y;Łódź", "cp1250")]
)
def test_another_encoding_is_asked_for_and_read_where_it_is_stated(tmp_path, header, encoding):
    path = write_text_file(tmp_path, f"{header}\n1;2;3\n", encoding)
    with refused(path, "line 1", "not UTF-8", "--encoding cp1252"):
        read_text_table(path, is_header)
    assert list(read_text_table(path, is_header, Dialect(encoding=encoding)).columns) == header.split(";")


@pytest.mark.parametrize("encoding", ["klingon", "hex", "a\0b", "undefined"])
def test_a_stated_encoding_that_is_none_is_refused(tmp_path, encoding):
    with refused("--encoding", "", "cp1252"):
        read_text_table(write_text_file(tmp_path, "x;y;°\n1;2;3\n"), is_header, Dialect(encoding=encoding))


def test_a_stated_encoding_that_the_file_does_not_have_is_refused(tmp_path):
    path = write_text_file(tmp_path, "x;y;°\n1;2;3\n", "latin-1")
    with refused(path, "line 1", "not ASCII"):
        read_text_table(path, is_header, Dialect(encoding="ascii"))


@pytest.mark.parametrize("mark", ["# ", "#", "% ", "%", "// ", "%% "])
@pytest.mark.parametrize("separator", [",", " ", ";"])
def test_a_header_behind_a_comment_mark_is_found(tmp_path, mark, separator):
    text = f"{mark}made by hand\n{mark}{separator.join('xyn')}\n{separator.join('123')}\n"
    found = read_text_table(write_text_file(tmp_path, text), is_header)
    assert found.columns == {"x": ("1",), "y": ("2",), "n": ("3",)} and found.dialect.header == 2
    assert read_text_table(write_text_file(tmp_path, text), is_header, Dialect(header=2)).columns == found.columns


def test_two_headers_behind_comment_marks_are_a_question_and_a_plain_one_goes_before(tmp_path):
    text = "# x;y;n\n# n;y;x\n1;2;3\n"
    with refused(tmp_path / "table.txt", "line 1 and line 2", "--header LINE"):
        read_text_table(write_text_file(tmp_path, text), is_header)
    assert read_text_table(write_text_file(tmp_path, text), is_header, Dialect(header=2)).columns["x"] == ("3",)
    found = read_text_table(write_text_file(tmp_path, "# x;y;n\nn;x;y\n1;2;3\n#4;5;6\n"), is_header)
    assert found.columns["x"] == ("2",)
    assert found.left_out == ("1 line above the header", "1 line of comments below the header")


@pytest.mark.parametrize(
    "text",
    ["x,y,,\n1,2,,\n,,,\n", ",x,,y\n,1,,2\n", "x,y\n1,2,,,\n", "x;y;\n1;2;\n;;\n\n", "\ufeffx;y\n1;2;;\n"],
)
def test_nameless_columns_and_rows_that_are_empty_throughout_are_left_out(tmp_path, text):
    assert read_text_table(write_text_file(tmp_path, text), is_header).columns == {"x": ("1",), "y": ("2",)}


def test_columns_to_ignore_are_left_out_whatever_they_hold(tmp_path):
    path = write_text_file(tmp_path, "x;y;n;n\n1,5;2;1.5;1.2.3\n")
    with refused(path, "line 1", "'n' twice", "--ignore 'n'"):
        read_text_table(path, is_header)
    assert read_text_table(path, is_header, ignored=["n"]).columns == {"x": ("1.5",), "y": ("2",)}
    with refused(path, "line 1", "no column 'm' to ignore", "x, y, n"):
        read_text_table(path, is_header, ignored=["m"])


GROUPED = {
    "1.234,56": ("point", "1234.56"),
    "-1,234.56": ("comma", "-1234.56"),
    "1 234,5": ("space", "1234.5"),
    "1\u202f234.5": ("space", "1234.5"),
    "1'234.5": ("apostrophe", "1234.5"),
    "1\u2019234": ("apostrophe", "1234"),
    "1,234,567": ("comma", "1234567"),
    "12.345.678": ("point", "12345678"),
    "1,234": ("comma", "1234"),
}


@pytest.mark.parametrize("cell", GROUPED)
def test_marks_between_thousands_are_asked_for(tmp_path, cell):
    thousands, number = GROUPED[cell]
    path = write_text_file(tmp_path, f"x;y\n{cell};2\n")
    with refused(path, "line 2", repr(cell), "--thousands"):
        read_text_table(path, is_header)
    assert read_text_table(path, is_header, Dialect(thousands=thousands)).columns["x"] == (number,)


def test_three_digits_behind_each_comma_may_be_either_and_anything_else_tells(tmp_path):
    path = write_text_file(tmp_path, "x;y\n1,234;22,500\n")
    with refused(path, "line 2", "'1,234'", "--decimal comma", "--thousands comma"):
        read_text_table(path, is_header)
    assert read_text_table(path, is_header, Dialect(decimal="comma")).columns["x"] == ("1.234",)
    assert read_text_table(write_text_file(tmp_path, "x;y\n1,234;0,500\n"), is_header).columns["x"] == ("1.234",)
    # In quotes between commas it may be either too.
    path = write_text_file(tmp_path, 'x,y\n"1,5",2\n')
    with refused(path, "line 2", "'1,5'", "--decimal comma"):
        read_text_table(path, is_header)
    with refused("--thousands", "", "decimal mark too"):
        read_text_table(path, is_header, Dialect(decimal="comma", thousands="comma"))
    with refused(path, "line 2", "'1,5'", "three digits"):
        read_text_table(path, is_header, Dialect(separator="comma", thousands="comma"))

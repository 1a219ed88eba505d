"""Workbooks and MATLAB files are read as tables; other files are named and not loaded."""

import io
import pickle
import zipfile
from datetime import datetime, time

import numpy as np
import pytest
from openpyxl import Workbook
from scipy.io import savemat
from support import refused

from elastocal.campaigns.tables import Dialect, read_text_table

ROWS = [["Job 7"], ["x", "y", "Time"], [1203.114, -2, time(9, 14, 22)], [None, None]]


def write_workbook(path, **sheets):
    workbook = Workbook()
    workbook.remove(workbook.active)
    for name, rows in sheets.items():
        sheet = workbook.create_sheet(name)
        for row in rows:
            sheet.append(row)
    workbook.save(path)
    return path


def read(path, dialect=None, **options):
    return read_text_table(
        path, lambda cells: {"x", "y"} <= {*cells}, dialect or Dialect(), **options
    )


def test_the_only_sheet_with_cells_is_read_with_its_rows_as_lines(tmp_path):
    path = write_workbook(tmp_path / "t.xlsx", Empty=[], Points=ROWS)
    table = read(path)
    assert table.columns == {"x": ("1203.114",), "y": ("-2",), "Time": ("09:14:22",)}
    assert table.lines == (3,) and table.dialect.header == 2


def test_dates_and_texts_of_cells_are_on_one_line(tmp_path):
    when = datetime(2026, 11, 20, 9, 14, 22)
    rows = [["x", "y", "n"], [1, when, 'a "b"\nc']]
    table = read(write_workbook(tmp_path / "t.xlsx", A=rows))
    assert table.columns["y"] == ("2026-11-20 09:14:22",)
    assert table.columns["n"] == ("a 'b' c",)


def test_of_several_sheets_one_is_asked_for(tmp_path):
    path = write_workbook(tmp_path / "t.xlsx", A=ROWS, B=[["x", "y"], [1, 2]])
    with refused(path, "", "sheets 'A', 'B'", "--sheet NAME"):
        read(path)
    with refused("--sheet", "", "'C'", "A, B"):
        read(path, Dialect(sheet="C"))
    assert read(path, Dialect(sheet="B")).columns == {"x": ("1",), "y": ("2",)}


def write_archive(path, **members):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name.replace("__", "/"), content)
    return path


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"readme": "a"}, ["an archive (zip)"]),
        ({"content.xml": "a"}, ["OpenDocument"]),
        ({"a.npy": "a"}, ["arrays of NumPy (.npz)"]),
        ({"xl__workbook.xml": "<a"}, ["a damaged workbook"]),
        (
            {"xl__workbook.xml": '<!DOCTYPE a [<!ENTITY b "bb">]><a/>'},
            ["with a document type"],
        ),
        ({"xl__workbook.xml": b"0" * 201_000_000}, ["201000000 bytes", "at most"]),
    ],
)
def test_other_archives_and_bombs_are_refused(tmp_path, members, words):
    path = write_archive(tmp_path / "t.xlsx", **members)
    with refused(path, "", *words):
        read(path)


def test_a_damaged_archive_is_refused(tmp_path):
    path = tmp_path / "t.xlsx"
    path.write_bytes(b"PK\x03\x04" + b"0" * 100)
    with refused(path, "", "a damaged archive"):
        read(path)


def test_variables_of_a_matlab_file_are_columns(tmp_path):
    path = tmp_path / "t.mat"
    q = np.array([[0.5, 1.5], [2.5, 3.5]])
    variables = {
        "q": q,
        "x": [[1.0], [2.0]],
        "y": [[3], [4]],
        "note": "a",
        "T": np.eye(1),
    }
    savemat(path, variables)
    columns = read(path).columns
    assert columns["q1"] == ("0.5", "2.5") and columns["q2"] == ("1.5", "3.5")
    assert columns["x"] == ("1.0", "2.0") and columns["y"] == ("3.0", "4.0")
    assert "note" not in columns and "T" not in columns
    named = read(path, Dialect(sheet="q"), names=["x", "y"])
    assert named.columns == {"x": ("0.5", "2.5"), "y": ("1.5", "3.5")}
    with refused("--sheet", "", "'Q'", "'q'?"):
        read(path, Dialect(sheet="Q"))


def test_a_damaged_matlab_file_is_refused(tmp_path):
    path = tmp_path / "t.mat"
    savemat(path, {"q": np.ones((50, 2))}, do_compression=True)
    path.write_bytes(path.read_bytes()[:-20])
    with refused(path, "", "a damaged MATLAB file"):
        read(path)
    savemat(path, {"note": "a"})
    with refused(path, "", "no matrix of numbers"):
        read(path)


class Explosive:
    """Leaves a file behind if it is loaded."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_a_pickle_is_named_and_never_loaded(tmp_path, protocol):
    trace = tmp_path / "loaded"
    path = tmp_path / "t.pkl"
    path.write_bytes(pickle.dumps(Explosive(trace), protocol))
    with refused(path, "", "a pickle, which is never loaded", "CSV"):
        read(path)
    assert not trace.exists()


@pytest.mark.parametrize(
    ("beginning", "kind"),
    [
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", ".xls"),
        (b"\x89HDF\r\n\x1a\n", "HDF5"),
        (b"\x93NUMPY", ".npy"),
        (b"PAR1", "Parquet"),
        (b"\x1f\x8b\x08", "gzip"),
        (b"SQLite format 3\x00", "SQLite"),
    ],
)
def test_files_of_other_programs_are_named(tmp_path, beginning, kind):
    path = tmp_path / "t.csv"
    path.write_bytes(beginning + bytes(100))
    with refused(path, "", kind):
        read(path)


def test_text_has_no_sheets(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("x,y\n1,2\n")
    with refused("--sheet", "", "'A'", "of a workbook"):
        read(path, Dialect(sheet="A"))


def test_an_array_of_arrays_is_no_reason_to_load_a_pickle(tmp_path):
    """An array of objects holds a pickle."""
    buffer = io.BytesIO()
    np.savez(buffer, a=np.array([1, "a"], object))
    path = tmp_path / "t.npz"
    path.write_bytes(buffer.getvalue())
    with refused(path, "", "arrays of NumPy"):
        read(path)

"""Measurements in text and in Parquet files are the same, and every fault of a file, a
column or a cell is refused in one line."""

import struct
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from made_cells import assert_same
from support import refused

from elastocal.campaigns import measurements as module
from elastocal.campaigns.reading import read_campaign


def test_marks_blanks_and_empty_lines_of_a_spreadsheet_are_skipped_and_counted(
    cell,
):
    expected = cell.read().measurements
    for name, column in cell.table.items():
        cell.table[name] = [str(entry).replace(".", ",") for entry in column]
    cell.write(separator=";")
    path = cell.folder / "measurements.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    lines.insert(3, "")
    lines.insert(5, ";" * lines[0].count(";"))
    text = '\ufeff# tracker "A, 20 °C\n\n  # poses\n' + "\n".join(
        line.replace(";", "; ") for line in lines
    )
    path.write_text(text, encoding="utf-8")
    measurements = read_campaign(cell.open()).measurements
    assert measurements.row.tolist()[:5] == [1, 2, 4, 6, 7]
    assert_same(replace(measurements, row=expected.row), expected)
    path.write_text(text.replace("\n0; 0; 0; A", "\n0; 0; no; A"), encoding="utf-8")
    with refused(cell.measurements, "line 5, column repeat", "'no'"):
        read_campaign(cell.open())


@pytest.mark.parametrize(
    ("row", "column", "entry", "phrases"),
    [
        (3, "q2", "0.1.2", ["'0.1.2'", "a number"]),
        (3, "q2", "", ["nothing", "a number"]),
        (80, "z", "nan", ["'nan'", "a number"]),
        (7, "q3", "1e13", ["'1e13'", "up to 1e+12"]),
        (2, "repeat", "3000000000", ["'3000000000'", "integer"]),
        (2, "q1", "1_0", ["'1_0'", "a number"]),
        (2, "pose", "\uff10", ["a number"]),
        (14, "fx", -1e9, ["hundred tonnes"]),
        (14, "my", 1e8, ["ten metres"]),
        (14, "x", 1e9, ["the Earth"]),
        (14, "time_s", 1.6e11, ["three thousand years"]),
        (14, "u95_m", 0.0, ["more than 0"]),
        (14, "u95_m", 0.2, ["1e-08 to 0.1 m"]),
        (14, "temperature_c", 293.15, ["-200 to 200"]),
    ],
)
def test_a_faulty_cell_is_refused_by_row_and_column(cell, row, column, entry, phrases):
    cell.table["u95_m"] = [1e-4] * len(cell.table["pose"])
    cell.spoil(row, column, entry)
    with refused(cell.measurements, f"line {row + 1}, column {column}:", *phrases):
        cell.read()


def test_a_faulty_cell_of_a_parquet_file_is_refused_likewise(cell):
    cell.spoil(5, "x", None)
    cell.write("parquet")
    with refused(
        cell.folder / "measurements.parquet",
        "row 5, column x",
        "found nothing",
        "a number",
    ):
        read_campaign(cell.open())


@pytest.mark.parametrize("missing", ["load", "q3", "rz", "mx", "approach1"])
def test_a_missing_column_is_refused(cell, missing):
    cell.without(missing)
    with refused(cell.measurements, "header", f"no column {missing!r}", f"{missing}: "):
        cell.read()


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("Load", "'load'?"),
        ("temperature", "'temperature_c'?"),
        ("q4", "q3, u95_m, kind, feature, value, for 3 joints"),
    ],
)
def test_an_unknown_column_is_refused_with_the_closest_name(cell, name, hint):
    old = {"Load": "load", "temperature": "temperature_c", "q4": "q3"}[name]
    cell.table = {
        name if column == old else column: cells for column, cells in cell.table.items()
    }
    with refused(cell.measurements, "header", f"unknown column {name!r}", hint):
        cell.read()


def test_files_that_are_too_large_for_memory_are_refused(cell, monkeypatch):
    cell.write("parquet")
    rows = len(cell.table["pose"])
    path = cell.folder / "measurements.parquet"
    monkeypatch.setattr(module, "MOST_MEASUREMENTS", rows)
    assert len(read_campaign(cell.open()).measurements) == rows
    monkeypatch.setattr(module, "MOST_MEASUREMENTS", rows - 1)
    with refused(path, "", "rows of data", f"at most {rows - 1}"):
        read_campaign(cell.open())
    monkeypatch.setattr(module, "_MOST_BYTES", 100)
    with refused(path, "", "bytes", "at most 100"):
        read_campaign(cell.open())


@pytest.mark.parametrize(
    ("text", "key", "phrases"),
    [
        (b"load,repeat\n0,0\n", "line 1", ["a header with pose"]),
        (b"pose,load\n0,0\n0,0,0\n", "line 3", ["3 cells", "2, one for each column"]),
        ("pose,target\n1,a\n2,a\u202eb\n".encode(), "line 3", ["character"]),
        (b"pose,x,pose\n0,0,0\n", "line 1", ["column 'pose' twice", "once"]),
    ],
)
def test_a_file_that_is_no_table_is_refused(cell, text, key, phrases):
    cell.write()
    (cell.folder / "measurements.csv").write_bytes(text)
    with refused(cell.measurements, key, *phrases):
        read_campaign(cell.open())


def test_one_altered_byte_of_a_parquet_file_with_checksums_is_detected(cell):
    cell.write()
    path = cell.folder / "measurements.parquet"
    pq.write_table(
        pa.table(cell.table),
        path,
        write_page_checksum=True,
        compression="none",
        use_dictionary=False,
    )
    (cell.folder / "measurements.csv").unlink()
    read_campaign(cell.open())
    content = bytearray(path.read_bytes())
    position = content.index(struct.pack("<d", cell.table["x"][10]))
    content[position] ^= 1
    path.write_bytes(content)
    with refused(path.as_posix(), "", "no readable Parquet file"):
        read_campaign(cell.open())


@pytest.mark.parametrize(
    ("column", "entry", "kind"),
    [("x", "1", "string"), ("x", True, "bool"), ("target", b"A", "binary")],
)
def test_a_column_of_a_parquet_file_must_hold_numbers_or_text(
    cell, column, entry, kind
):
    cell.table[column] = [entry] * len(cell.table[column])
    cell.write("parquet")
    with refused(
        cell.folder / "measurements.parquet", f"column {column}", kind, "numbers"
    ):
        read_campaign(cell.open())


def test_there_must_be_exactly_one_file_of_measurements(cell):
    cell.write()
    cell.write("parquet")
    with refused(
        cell.folder.as_posix(), "", "both measurements.csv and", "one of them"
    ):
        read_campaign(cell.open())
    for name in ("measurements.csv", "measurements.parquet"):
        (cell.folder / name).unlink()
    with refused(
        cell.folder.as_posix(), "", "neither measurements.csv nor", "one of them"
    ):
        read_campaign(cell.open())


def test_a_sheet_may_have_ticks_and_a_column_in_degrees_that_agrees(cell):
    cell.table["done"] = ["x"] * len(cell.table["pose"])
    cell.table["q2_deg"] = np.degrees(cell.table["q2"]).round(3)
    cell.write()
    assert len(read_campaign(cell.open()).measurements) == len(cell.table["pose"])
    cell.table["q2_deg"][4] += 1.0
    cell.write()
    with refused(cell.measurements, "line 6, column q2_deg", "what is q2 in deg"):
        cell.read()


def test_a_parquet_file_that_would_expand_too_much_is_refused_before_it_is_read(
    cell, monkeypatch
):
    monkeypatch.setattr(pq, "read_table", None)
    cell.write("parquet")
    path = cell.folder / "measurements.parquet"
    table = pa.table(cell.table)
    empty = np.zeros(len(table), np.int32)
    pq.write_table(table.append_column("x", table["x"]), path)
    with refused(path.as_posix(), "header", "column 'x' twice", "each column once"):
        read_campaign(cell.open())
    lists = pa.ListArray.from_arrays(
        np.append(empty, np.int32(1000)), pa.array(np.zeros(1000, np.int8))
    )
    pq.write_table(table.set_column(table.column_names.index("x"), "x", lists), path)
    with refused(path.as_posix(), "column x", "list"):
        read_campaign(cell.open())
    monkeypatch.setattr(module, "_MOST_ROW_GROUPS", 7)
    pq.write_table(table, path, row_group_size=10)
    with refused(path.as_posix(), "", "8 row groups", "at most 7"):
        read_campaign(cell.open())

"""Files of several sessions become one table; a row that no file has is named."""

import numpy as np
import pytest

from elastocal.errors import InputError
from elastocal.exchange.measurement_table import ImportOptions, OtherFile
from elastocal.exchange.sessions import read_sessions

SHEET = """pose,load,repeat,target,q1,x,y,z
1,0,0,A,1.0,,,
1,0,1,A,1.0,,,
2,0,0,A,2.0,,,
"""
HEADER = "Pose;Load;Repeat;Target;X [mm];Y [mm];Z [mm]\n"
MORNING = HEADER + "P1;0;0;A;1203,5;0,5;3,5\nP1;0;1;A;1203,6;0,5;3,5\n"
AFTERNOON = HEADER + "P2;0;0;A;203,5;10,5;3,5\n"


def read(folder, *texts, options=None, sheet=SHEET):
    (folder / "sheet.csv").write_text(sheet)
    paths = []
    for number, text in enumerate(texts):
        paths.append(folder / f"t{number}.csv")
        paths[-1].write_text(text)
    other = OtherFile(folder / "sheet.csv", is_sheet=True)
    return read_sessions(paths, options or ImportOptions(), None, other)


def test_each_file_is_a_session_and_together_they_fill_the_sheet(tmp_path):
    imported = read(tmp_path, MORNING, AFTERNOON)
    table = imported.table
    assert table["session"].tolist() == [0, 0, 1]
    assert table["pose"].tolist() == [1, 1, 2]
    assert table["q1"].tolist() == [1.0, 1.0, 2.0]
    np.testing.assert_allclose(table["x"], [1.2035, 1.2036, 0.2035])
    assert "each of 2 files is a session of its own" in imported.notes


def test_one_file_is_no_session(tmp_path):
    options = ImportOptions(skip_empty=True)
    assert "session" not in read(tmp_path, MORNING, options=options).table


def test_a_row_of_the_sheet_that_no_file_has_is_refused(tmp_path):
    sheet = SHEET + "3,0,0,A,2.5,,,\n"
    with pytest.raises(InputError) as error:
        read(tmp_path, MORNING, AFTERNOON, sheet=sheet)
    message = str(error.value)
    assert "pose 3, load 0, repeat 0, target A" in message and "t1.csv" in message
    options = ImportOptions(skip_empty=True)
    table = read(tmp_path, MORNING, AFTERNOON, options=options, sheet=sheet).table
    assert table["pose"].tolist() == [1, 1, 2]


@pytest.mark.parametrize("column", ["Temperature [C]", "Time"])
def test_a_condition_that_only_one_file_has_is_left_out(tmp_path, column):
    first, *rows = AFTERNOON.splitlines()
    warm = "\n".join([f"{first};{column}", *(f"{row};21,5" for row in rows)])
    assert (
        read(tmp_path, MORNING, warm)
        .table.keys()
        .isdisjoint({"temperature_c", "time_s"})
    )


def test_files_with_different_columns_are_refused(tmp_path):
    first, *rows = AFTERNOON.splitlines()
    turned = "\n".join([f"{first};session", *(f"{row};4" for row in rows)])
    with pytest.raises(InputError) as error:
        read(tmp_path, MORNING, turned)
    message = str(error.value)
    assert "t1.csv" in message and "session" in message

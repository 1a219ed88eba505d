"""Options of an import as a file; a sheet of a plan that a spreadsheet saved is read without a question."""

import pytest
from support import refused

from elastocal.exchange.import_options import ImportOptions, import_options_text, read_import_options
from elastocal.exchange.measurement_table import read_measurement_table


def test_options_read_back_as_they_were(tmp_path):
    (tmp_path / "t.csv").write_text("x")
    options = ImportOptions(
        *("tab", "comma", 3, None, None, {"q1": "Achse 1 [°]"}, {"q1": "°"}, "euler:ZYX", "smr", "by-robot", True)
    )
    (tmp_path / "import.yaml").write_text(import_options_text(options, tmp_path / "t.csv"), encoding="utf-8")
    assert read_import_options(tmp_path / "import.yaml") == options


def test_an_unknown_key_is_refused(tmp_path):
    (tmp_path / "import.yaml").write_text("seperator: tab\n")
    with refused((tmp_path / "import.yaml").as_posix(), "seperator", "'separator'?"):
        read_import_options(tmp_path / "import.yaml")


HEADER = "pose;load;repeat;target;done;q1_mm;q2_deg;q1;q2;fx;fy;fz;mx;my;mz;x;y;z;rx;ry;rz"
ROW = "1;0;0;A;x;250;57,296;0,25;1,00000384;0;0;0;0;0;0;1,5;2,5;3,5;0,1;0,2;0,3"


def read(tmp_path, row=ROW, header=HEADER, **options):
    path = tmp_path / "sheet.csv"
    path.write_text(f"{header}\n{row}\n", encoding="utf-8")
    return read_measurement_table(path, ImportOptions(**options))


def test_a_saved_sheet_is_asked_nothing(tmp_path):
    found = read(tmp_path)
    assert found.table["q1"] == 0.25 and found.table["q2"] == pytest.approx(1.00000384)
    assert found.table["x"] == 1.5 and found.table["rz"] == pytest.approx(0.3)
    assert found.options.rotation == "vector"


def test_degrees_that_are_not_the_angle_are_refused_by_line(tmp_path):
    with refused((tmp_path / "sheet.csv").as_posix(), "line 2, column q2_deg", "'58.296'", "57.296, which is q2"):
        read(tmp_path, ROW.replace("57,296", "58,296"))

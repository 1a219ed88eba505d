"""Options of tables of poses, and what the columns are then taken for."""

import pytest
from support import refused

from elastocal.exchange.pose_table import (
    PoseTable,
    TableOptions,
    check_option_names,
    read_cells,
)


@pytest.mark.parametrize("option", [{"columns": {"qq": "A"}}, {"units": {"qq": "mm"}}])
def test_an_option_for_a_column_that_no_table_has_is_refused(option):
    with refused("--column", "", "'qq'"):
        check_option_names(TableOptions(**option))
    check_option_names(TableOptions(units={"lengths": "mm", "angles": "deg", "x": "m"}))


def test_the_header_is_the_first_line_with_names_of_a_position(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("Job 7 of today\nX;Y;Z;A;B;C\n1;2;3;4;5;6\n")
    text = read_cells(path, TableOptions())
    assert text.dialect.header == 2 and text.columns["A"] == ("4",)


def test_the_columns_of_a_pose_follow_from_the_notation(tmp_path):
    columns = {"rx": "RX", "ry": "RY", "rz": "RZ", "x": "X", "y": "Y", "z": "Z"}
    path = tmp_path / "t.csv"
    path.write_text("X,Y,Z,RX,RY,RZ\n1,2,3,4,5,6\n")
    text = read_cells(path, TableOptions())
    table = PoseTable(text, columns, {}, "euler:ZYX")
    assert [*table.orientation] == ["rz", "ry", "rx"]
    assert table.with_units == ["x", "y", "z", "rz", "ry", "rx"]

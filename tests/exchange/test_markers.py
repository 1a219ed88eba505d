"""Several markers in a row become measurements of several targets, where options say that they are targets."""

from dataclasses import replace

import numpy as np
import pytest
from imported_tables import PLAIN as NAMED
from imported_tables import table
from support import refused

from elastocal.exchange.import_options import ImportOptions
from elastocal.exchange.markers import markers_in

PLAIN = replace(NAMED, target=None)
TWO = ("A", "B")


@pytest.mark.parametrize(
    ("headers", "markers"),
    [
        ("A_x,A_y,A_z,B_x,B_y,B_z", ("A", "B")),
        ("x_A,x_B,y_A,y_B,z_A,z_B", ("A", "B")),
        ("X1,Y1,Z1,X2,Y2,Z2", ("1", "2")),
        ("P1X,P1Y,P1Z,P2X,P2Y,P2Z", ("P1", "P2")),
        ("Ax,Ay,Az,Bx,By,Bz", ("A", "B")),
        ("SMR 1 X [mm],SMR 1 Y [mm],SMR 1 Z [mm],SMR 2 X [mm],SMR 2 Y [mm],SMR 2 Z [mm]", ("SMR 1", "SMR 2")),
        ("A.x_mm,A.y_mm,A.z_mm,B.x_mm,B.y_mm,B.z_mm", ("A", "B")),
        ("A Position X,A Position Y,A Position Z,B Position X,B Position Y,B Position Z", ("A", "B")),
        ("Robot:A x,Robot:A y,Robot:A z,Robot:B x,Robot:B y,Robot:B z", ("Robot:A", "Robot:B")),
        (",".join(f"/{marker}/pose/position/{axis}" for marker in TWO for axis in "xyz"), ("A", "B")),
        (",".join(f"field.{marker}.translation.{axis}" for marker in TWO for axis in "xyz"), ("field.A", "field.B")),
    ],
)
def test_markers_are_asked_for_and_read_where_they_are_stated(tmp_path, headers, markers):
    places = {header: 10 * (number + 1) for number, header in enumerate(headers.split(","))}
    cells = ",".join(map(str, places.values()))
    text = f"q1,{headers},fz\n90,{cells},-5\n7,{cells},0\n"
    named = markers_in(headers.split(","))
    assert tuple(named) == markers
    with refused(tmp_path / "t.csv", "header", *map(repr, markers), f"--target {markers[0]}"):
        table(tmp_path, text, PLAIN)
    targets = {"SMR": markers[1], markers[0]: markers[0]}
    found = table(tmp_path, text, replace(PLAIN, targets=targets))
    assert found.table["target"].tolist() == ["SMR", markers[0]] * 2 and found.table["pose"].tolist() == [1, 1, 2, 2]
    for row, marker in enumerate((markers[1], markers[0])):
        got = [found.table[axis][row] for axis in "xyz"]
        np.testing.assert_allclose(got, [places[named[marker][axis]] / 1000 for axis in "xyz"])
        assert found.table["fz"][row] == -5.0
    assert found.ignored == () and any(note.startswith("SMR has") for note in found.notes)
    # The options that were found out give the same again.
    again = table(tmp_path, text, found.options)
    assert again.options == found.options
    assert all((again.table[name] == found.table[name]).all() for name in found.table)
    with refused(tmp_path / "t.csv", "header", "'C'", "markers of the table"):
        table(tmp_path, text, replace(PLAIN, targets={"C": "C"}))


def test_a_marker_that_the_target_is_called_after_is_meant_and_the_others_are_left_out(tmp_path):
    text = "q1,A_x,A_y,A_z,B_x,B_y,B_z\n1,1,2,3,4,5,6\n"
    found = table(tmp_path, text, replace(PLAIN, target="B"))
    assert found.table["x"].tolist() == [0.004] and found.ignored == ("A_x", "A_y", "A_z")
    # Another name says nothing of a marker.
    with refused(tmp_path / "t.csv", "header", "'A', 'B'"):
        table(tmp_path, text, replace(PLAIN, target="SMR"))


def test_what_was_commanded_is_no_target_and_a_number_behind_plain_names_is_a_question(tmp_path):
    found = table(tmp_path, "q1,x,y,z,x_cmd,y_cmd,z_cmd\n1,1,2,3,4,5,6\n", replace(PLAIN, target="a"))
    assert found.table["x"].tolist() == [0.001] and found.ignored == ("x_cmd", "y_cmd", "z_cmd")
    text = "q1,x,y,z,x2,y2,z2\n1,1,2,3,4,5,6\n"
    with refused(tmp_path / "t.csv", "header", "x, y, z, '2'", "--target NAME= "):
        table(tmp_path, text, replace(PLAIN, target="a"))
    found = table(tmp_path, text, replace(PLAIN, targets={"a": "", "b": "2"}))
    assert found.table["x"].tolist() == [0.001, 0.004]
    columns = {"x": "x", "y": "y", "z": "z"}
    assert table(tmp_path, text, replace(PLAIN, target="a", columns=columns)).table["x"].tolist() == [0.001]


@pytest.mark.parametrize(
    ("headers", "words"),
    [
        ("A_x,A_y,A_z,B_x,B_y,B_z,A_u95", ["'A_u95' of A alone", "--ignore 'A_u95'"]),
        ("A_x,A_y,A_z,B_x,B_y,B_z,B_u95", ["'B_u95' of B alone"]),
        ("A_x [mm],A_y,A_z,B_x [m],B_y,B_z", ["'A_x [mm]' in mm and 'B_x [m]' in m", "one unit"]),
    ],
)
def test_what_only_one_target_has_is_a_question(tmp_path, headers, words):
    text = f"q1,{headers}\n1,{','.join('1' * len(headers.split(',')))}\n"
    with refused(tmp_path / "t.csv", "header", *words):
        table(tmp_path, text, replace(PLAIN, targets={"A": "A", "B": "B"}))


@pytest.mark.parametrize("above", ["Name,,SMR1,SMR1,SMR1,SMR2,SMR2,SMR2", ",,SMR1,,,SMR2,,", ",,SMR1,,,SMR2"])
def test_markers_may_stand_in_the_line_above_the_axes(tmp_path, above):
    text = f"Motive,1.2\n{above}\nq1,Time,X,Y,Z,X,Y,Z\ndeg,s,mm,mm,mm,mm,mm,mm\n90,5,1,2,3,4,5,6\n"
    with refused(tmp_path / "t.csv", "header", "'SMR1', 'SMR2'"):
        table(tmp_path, text, ImportOptions())
    found = table(tmp_path, text, ImportOptions(targets={"SMR1": "SMR1", "SMR2": "SMR2"}))
    assert found.table["x"].tolist() == [0.001, 0.004] and found.table["time_s"].tolist() == [5.0, 5.0]
    assert "1 line above the header" in found.notes


def test_two_targets_of_one_marker_or_a_column_that_is_none_of_it_are_refused(tmp_path):
    text = "q1,A_x,A_y,A_z,n\n1,1,2,3,4\n"
    with refused("--column", "x", "'n'"):
        table(tmp_path, text, replace(PLAIN, targets={"A": "A"}, columns={"x": "n"}))

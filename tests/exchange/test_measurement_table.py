"""Another program's table becomes measurements; what it leaves open is asked for."""

import math
from dataclasses import replace

import numpy as np
import pytest
from durations import growth
from imported_tables import PLAIN, table
from support import refused

from elastocal.exchange.measurement_table import SAME_POSE, ImportOptions, import_options_text, read_import_options


def test_angles_lengths_and_forces_come_in_si_units(tmp_path):
    found = table(tmp_path, "J1;J2;X;Y;Z;Fz [kN];Time [ms]\n90;-45;1000;2;3;0,5;2000\n")
    row = {name: values[0] for name, values in found.table.items()}
    assert (row["q1"], row["q2"], row["x"], row["fz"], row["fx"]) == (math.pi / 2, -math.pi / 4, 1.0, 500.0, 0.0)
    assert (row["time_s"], row["target"], row["pose"], row["load"], row["repeat"]) == (2.0, "smr", 1, 1, 0)


def test_forces_that_the_robot_exerts_are_turned_round(tmp_path):
    found = table(tmp_path, "q1,x,y,z,fz\n0,1,2,3,5\n", replace(PLAIN, wrench="by-robot"))
    assert found.table["fz"].tolist() == [-5.0] and not np.signbit(found.table["fx"]).any()


def test_poses_loads_and_repeats_are_counted_where_no_column_has_them(tmp_path):
    rows = ["0,0", "0,0", "0,9", "0,9", "10,0", "10,-9", "10,9", "0.001,9"]
    found = table(tmp_path, "q1,fz,x,y,z\n" + "\n".join(f"{row},1,2,3" for row in rows))
    # 0.001 degrees apart is the same pose; a repeat is the same state again.
    assert found.table["pose"].tolist() == [1, 1, 1, 1, 2, 2, 2, 1]
    assert found.table["load"].tolist() == [0, 0, 1, 1, 0, 1, 2, 1]
    assert found.table["repeat"].tolist() == [0, 1, 0, 1, 0, 0, 0, 2]


def test_poses_without_numbers_are_told_apart_as_by_looking_at_each(tmp_path):
    rng = np.random.default_rng(5)
    angles = np.repeat(rng.uniform(-3, 3, (40, 2)), 5, axis=0)[rng.permutation(200)] + rng.uniform(-6e-4, 6e-4, (200, 2))
    leaders, expected = [], []
    for row in angles:
        alike = [number for number, first in enumerate(leaders, 1) if np.abs(row - first).max() <= SAME_POSE]
        leaders += [] if alike else [row]
        expected.append(alike[0] if alike else len(leaders))
    rows = "".join(f"{one!r},{other!r},1,2,3\n" for one, other in angles.tolist())
    found = table(tmp_path, "q1,q2,x,y,z\n" + rows, ImportOptions(units={"angles": "rad", "lengths": "m"}, target="a"))
    np.testing.assert_array_equal(found.table["pose"], expected)
    assert len(leaders) > 40


def test_ten_times_as_many_poses_take_about_ten_times_as_long_to_number(tmp_path):
    def read(poses):
        rows = "".join(f"{number * 0.1:.1f},1,2,3\n" for number in range(poses))
        assert table(tmp_path, "q1,x,y,z\n" + rows, PLAIN).table["pose"][-1] == poses

    assert growth(lambda: read(1_000), lambda: read(10_000)) < 20


def test_a_homogeneous_matrix_gives_position_and_orientation(tmp_path):
    header = "q1," + ",".join(f"t{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4))
    found = table(tmp_path, f"{header}\n0,0,-1,0,100,1,0,0,200,0,0,1,300\n")
    np.testing.assert_allclose([found.table[name][0] for name in ("x", "y", "z")], [0.1, 0.2, 0.3])
    np.testing.assert_allclose([found.table[name][0] for name in ("rx", "ry", "rz")], [0, 0, math.pi / 2], atol=1e-15)


def test_the_options_found_out_give_the_same_again(tmp_path):
    text = "made by\nq1 [rad];X [in];Y [in];Z [in];qw;qx;qy;qz;note\n0,5;1;2;3;1;0;0;0;a\n0,6;1;2;3;0;1;0;0;b\n"
    found = table(tmp_path, text, ImportOptions(target="smr"))
    assert found.ignored == ("note",)
    assert (found.options.separator, found.options.decimal, found.options.header) == ("semicolon", "comma", 2)
    assert found.options.units == {"q1": "rad", "x": "in", "y": "in", "z": "in"}
    again = table(tmp_path, text, found.options)
    assert again.options == found.options
    for name, values in found.table.items():
        np.testing.assert_array_equal(again.table[name], values)


def test_three_digits_behind_the_comma_of_an_angle_in_degrees_are_no_thousand(tmp_path):
    text = "q1;x;y;z\n12,345;1,250;1,500;1,750\n"
    found = table(tmp_path, text)
    assert (found.options.decimal, found.table["x"].tolist()) == ("comma", [0.00125])
    for units in ({"angles": "mrad", "lengths": "mm"}, {"q1": "mm", "lengths": "mm"}):
        with refused(tmp_path / "t.csv", "line 2", "'12,345'", "--decimal comma"):
            table(tmp_path, text, replace(PLAIN, units=units))


@pytest.mark.parametrize("empty", [",,", "nan,NaN,1", "1,-,–", "N/A,n/a,NA", "#N/A,1,2", "-nan(ind),null,None"])
def test_rows_without_a_position_are_left_out_only_where_asked(tmp_path, empty):
    text = f"q1,x,y,z\n1,1,2,3\n2,{empty}\n3,1,2,3\n"
    with refused((tmp_path / "t.csv").as_posix(), "line 3", "--skip-empty" if empty == ",," else "a number such as"):
        table(tmp_path, text)
    found = table(tmp_path, text, replace(PLAIN, skip_empty=True))
    assert (len(found.table["x"]), found.skipped) == (2, 1)


def test_a_table_without_a_header_has_the_columns_that_are_stated(tmp_path):
    names = ["q1", "q2", *(f"t{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4))]
    text = "90,1,0,-1,0,100,1,0,0,200,0,0,1,300\n-90,2,1,0,0,100,0,1,0,200,0,0,1,300\n"
    with refused(tmp_path / "t.csv", "line 1", "--columns q1,q2"):
        table(tmp_path, text)
    found = table(tmp_path, text, replace(PLAIN, names=names))
    assert found.table["q1"].tolist() == [math.pi / 2, -math.pi / 2] and found.table["z"].tolist() == [0.3, 0.3]
    np.testing.assert_allclose(found.table["rz"], [math.pi / 2, 0.0])
    assert table(tmp_path, text, found.options).options == found.options


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("q1,x,y,z\n0,1,2,3\n", ImportOptions(target="a"), ["no unit of 'q1'", "--angles"]),
        ("q1 [deg],x,y,z\n0,1,2,3\n", ImportOptions(target="a"), ["no unit of 'x'", "--lengths"]),
        ("q1,x,y,z\n0,1,2,3\n", ImportOptions(units=PLAIN.units), ["no column target", "--target"]),
        ("q1,x,y,z,rx,ry,rz\n0,1,2,3,0,0,0\n", PLAIN, ["rx, ry, rz", "euler:ZYX"]),
        ("q1,x,y,z,Roll\n0,1,2,3,0\n", PLAIN, ["Roll", "--rotation"]),
        ("q1,q3,x,y,z\n0,0,1,2,3\n", PLAIN, ["no column q2"]),
        ("x,y,z\n1,2,3\n", PLAIN, ["no joint angles", "--column q1"]),
        ("J1 [deg],J2 [deg],L [mm]\n0,1,400\n", PLAIN, ["'L [mm]' and no position", "distances alone"]),
        ("q1,x,y,z,Distance\n0,1,2,3,400\n", ImportOptions(units=PLAIN.units), ["no column target"]),
        ("q1,J1,x,y,z\n0,0,1,2,3\n", PLAIN, ["both 'q1' and 'J1'", "--column q1=NAME"]),
        ("q1,x,y,z\n0,1,a,3\n", PLAIN, ["line 2, column y", "'a'", "number"]),
        ("q1,x,y,z\n0,1,nan,3\n", PLAIN, ["line 2, column y", "a number such as"]),
        ("q1,x,y,z\n0,1,1_0,3\n", PLAIN, ["line 2, column y", "'1_0'"]),
        ("q1,x,y,z\n0,1,1e308,3\n", PLAIN, ["line 2, column y", "'1e308'"]),
        ("q1,x,y,z,temperature_c\n0,1,2,3,-500\n", PLAIN, ["line 2, column temperature_c", "'-500'", "-200 to 200"]),
        ("q1,x,y,z,u95 [mm]\n0,1,2,3,1e-20\n", PLAIN, ["line 2, column u95 [mm]", "'1e-20'", "laser"]),
        ("q1,x,y,z,pose\n0,1,2,3,99999999999\n", PLAIN, ["line 2, column pose", "an integer, up to"]),
        ("q999999999,x,y,z\n0,1,2,3\n", PLAIN, ["no joint angles"]),
        ("q1,x,y,z,repeat\n0,1,2,3,0.5\n", PLAIN, ["line 2, column repeat", "an integer"]),
        ("q1,x,y,z,qw,qx,qy,qz\n0,1,2,3,1,1,0,0\n", PLAIN, ["line 2, column qw", "length 1"]),
        ("q1,x [bananas],y,z\n0,1,2,3\n", PLAIN, ["unit of 'x [bananas]'", "mm"]),
        ("q1,x,y,z\n0,1,2,3\n", ImportOptions(columns={"qq": "x"}), ["--column", "'qq'"]),
        ("q1,x,y,z\n0,1,2,3\n", ImportOptions(columns={"q1": "Q"}), ["no column 'Q'"]),
        ("q1,x,y,z\n0,1,2,3\n", ImportOptions(units=PLAIN.units, rotation="rpy"), ["--rotation", "'rpy'", "euler:"]),
    ],
)
def test_what_is_missing_ambiguous_or_wrong_is_said_with_the_option_that_helps(tmp_path, text, options, words):
    source = words[0] if words[0].startswith("--") else (tmp_path / "t.csv").as_posix()
    with refused(source, "", *words):
        table(tmp_path, text, options)


def test_options_read_back_as_they_were_and_an_unknown_key_is_refused(tmp_path):
    (tmp_path / "t.csv").write_text("x")
    options = ImportOptions(
        *("tab", "comma", 3, None, {"q1": "Achse 1 [°]"}, {"q1": "°"}, "euler:ZYX", "smr", "by-robot", True), names=["q1", "x"]
    )
    path = tmp_path / "import.yaml"
    path.write_text(import_options_text(options, tmp_path / "t.csv"), encoding="utf-8")
    assert read_import_options(path) == options
    path.write_text("seperator: tab\n")
    with refused(path.as_posix(), "seperator", "'separator'?"):
        read_import_options(path)


def test_a_sheet_of_a_plan_that_a_spreadsheet_saved_is_asked_nothing_but_what_was_edited(tmp_path):
    head = "pose;load;repeat;target;done;q1_mm;q2_deg;q1;q2;fx;fy;fz;mx;my;mz;x;y;z;rx;ry;rz"
    row = "1;0;0;A;x;250;57,296;0,25;1,00000384;0;0;0;0;0;0;1,5;2,5;3,5;0,1;0,2;0,3"
    found = table(tmp_path, f"{head}\n{row}\n", ImportOptions())
    assert [found.table[name][0] for name in ("q1", "q2", "x", "rz")] == pytest.approx([0.25, 1.00000384, 1.5, 0.3])
    assert found.options.rotation == "vector"
    with refused((tmp_path / "t.csv").as_posix(), "line 2, column q2_deg", "'58.296'", "57.296, which is q2"):
        table(tmp_path, f"{head}\n{row.replace('57,296', '58,296')}\n", ImportOptions())

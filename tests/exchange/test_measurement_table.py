"""Another program's table becomes measurements; what it leaves open is asked for."""

import math
from dataclasses import replace

import numpy as np
import pytest
from durations import growth
from scipy.spatial.transform import Rotation
from support import refused, robot_of

from elastocal.exchange.measurement_table import SAME_POSE, ImportOptions, read_measurement_table

PLAIN = ImportOptions(units={"angles": "deg", "lengths": "mm"}, target="smr")


def table(folder, text, options=PLAIN):
    (folder / "t.csv").write_text(text)
    return read_measurement_table(folder / "t.csv", options)


def test_angles_lengths_and_forces_come_in_si_units(tmp_path):
    found = table(tmp_path, "J1;J2;X;Y;Z;Fz [kN];Time [ms]\n90;-45;1000;2;3;0,5;2000\n")
    row = {name: values[0] for name, values in found.table.items()}
    assert (row["q1"], row["q2"], row["x"], row["fz"], row["fx"]) == (math.pi / 2, -math.pi / 4, 1.0, 500.0, 0.0)
    assert (row["time_s"], row["target"], row["pose"], row["load"], row["repeat"]) == (2.0, "smr", 1, 1, 0)


def test_forces_that_the_robot_exerts_are_turned_round(tmp_path):
    options = ImportOptions(units={"angles": "deg", "lengths": "mm"}, target="smr", wrench="by-robot")
    found = table(tmp_path, "q1,x,y,z,fx,fy,fz\n0,1,2,3,5,0,-7\n", options)
    assert [found.table[name][0] for name in ("fx", "fy", "fz")] == [-5.0, 0.0, 7.0]
    assert not np.signbit(found.table["fy"]).any()


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

    assert growth(lambda: read(3_000), lambda: read(30_000)) < 20


def test_labels_of_poses_are_numbered_and_numbers_stay(tmp_path):
    assert table(tmp_path, "pose,q1,x,y,z\nP7,1,1,2,3\nP2,2,1,2,3\nP7,1,1,2,3\n").table["pose"].tolist() == [1, 2, 1]
    assert table(tmp_path, "pose,q1,x,y,z\n7,1,1,2,3\n2,2,1,2,3\n").table["pose"].tolist() == [7, 2]


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


def test_rows_without_a_position_are_left_out_only_where_asked(tmp_path):
    text = "q1,x,y,z\n1,1,2,3\n2,,,\n3,1,2,3\n"
    with refused((tmp_path / "t.csv").as_posix(), "line 3", "no position", "--skip-empty"):
        table(tmp_path, text)
    options = ImportOptions(units={"angles": "deg", "lengths": "mm"}, target="smr", skip_empty=True)
    found = table(tmp_path, text, options)
    assert (len(found.table["x"]), found.skipped) == (2, 1)


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


ROW = "1,2,3"
TIMES = {
    "2023-05-04 10:20:33|2023-05-04 10:21:33.5": [1683195633.0, 1683195693.5],
    "2023-05-04T12:20:33+02:00|2023-05-04T10:21:33+00:00": [1683195633.0, 1683195693.0],
    "2023/05/04 10:20:33|2023/05/04 10:21:33": [1683195633.0, 1683195693.0],
    "04.05.2023 10:20:33|05.05.2023 10:20:33": [1683195633.0, 1683282033.0],
    "10:20:33|10:21:33": [37233.0, 37293.0],
    "23:59|00:01": [86340.0, 86460.0],
    "11:59:00 AM|01:00:00 PM": [43140.0, 46800.0],
    "1600000000000|1600000002000": [1.6e9, 1600000002.0],
    "1600000000000000|1600000002000000": [1.6e9, 1600000002.0],
    "1600000000000000000|1600000002000000000": [1.6e9, 1600000002.0],
    "1600000000.0|1600000002.0": [1.6e9, 1600000002.0],
    "0.5|2": [0.5, 2.0],
}


@pytest.mark.parametrize("cells", TIMES)
@pytest.mark.parametrize("header", ["Time", "Timestamp", "%time", "__time", "/header/Time"])
def test_time_is_read_as_anybody_writes_it(tmp_path, cells, header):
    rows = "".join(f"{number},1,2,3,{cell}\n" for number, cell in enumerate(cells.split("|")))
    found = table(tmp_path, f"q1,x,y,z,{header}\n{rows}")
    if header == "/header/Time":
        assert "time_s" not in found.table and header in found.ignored
        return
    np.testing.assert_allclose(found.table["time_s"], TIMES[cells], rtol=0, atol=1e-6)
    again = table(tmp_path, f"q1,x,y,z,{header}\n{rows}", found.options)
    np.testing.assert_array_equal(again.table["time_s"], found.table["time_s"])


@pytest.mark.parametrize(
    ("header", "cells"),
    [
        ("Time", ["05/04/2023 10:20", "06/04/2023 10:20"]),
        ("Time", ["10:20:33", "noon"]),
        ("Time", ["10:20:33", "2023-05-04 10:20:33"]),
        ("Temp", ["21.3 C", "21.3 C"]),
        ("Temperature", ["21.3", ""]),
    ],
)
def test_time_or_temperature_that_is_no_number_is_left_out_with_a_note_but_not_where_it_is_asked_for(tmp_path, header, cells):
    text = f"q1,x,y,z,{header}\n" + "".join(f"{number},1,2,3,{cell}\n" for number, cell in enumerate(cells))
    found = table(tmp_path, text)
    name = "time_s" if header == "Time" else "temperature_c"
    assert name not in found.table and found.ignored == (header,)
    assert len(found.notes) == 1 and header in found.notes[0] and "not read" in found.notes[0]
    assert table(tmp_path, text, replace(PLAIN, ignore=[header])).notes == ()
    with refused(tmp_path / "t.csv", f"column {header}", f"--ignore {header!r}"):
        table(tmp_path, text, replace(PLAIN, columns={name: header}))


@pytest.mark.parametrize("header", ["Load [kg]", "load (kg)", "Cycle [s]", "Target [mm]", "Marker (mm)"])
def test_a_number_or_name_with_a_unit_is_a_question(tmp_path, header):
    text = f"q1,x,y,z,{header}\n0,1,2,3,4\n"
    with refused(tmp_path / "t.csv", repr(header), f"--ignore {header!r}", f"={header!r}"):
        table(tmp_path, text)
    assert table(tmp_path, text, replace(PLAIN, ignore=[header])).ignored == (header,)
    assert table(tmp_path, text, replace(PLAIN, columns={"load": header})).table["load"].tolist() == [4]
    assert table(tmp_path, "q1,x,y,z,load [-]\n0,1,2,3,4\n").table["load"].tolist() == [4]


SIX = "1,2,3,4,5,6"


@pytest.mark.parametrize(
    "names",
    [
        [f"q[{joint}]" for joint in range(1, 7)],
        [f"q[{joint}]" for joint in range(6)],
        [f"J({joint})" for joint in range(1, 7)],
        [f"J ( {joint} )" for joint in range(1, 7)],
        [f"q[{joint}] [deg]" for joint in range(6)],
        [f"actual_q_{joint}" for joint in range(6)],
        [f"rax_{joint}" for joint in range(1, 7)],
        [f"/joint_states/A{joint}/position" for joint in range(1, 7)],
        [f"/joint_states/position.J{joint}" for joint in range(1, 7)],
    ],
)
def test_joints_may_be_counted_by_an_index_or_from_0_and_have_the_names_of_topics(tmp_path, names):
    found = table(tmp_path, f"{','.join(names)},x,y,z\n{SIX},{ROW}\n")
    np.testing.assert_allclose([found.table[f"q{joint}"][0] for joint in range(1, 7)], np.radians(range(1, 7)))
    assert bool(found.notes) == ("0" in names[0])


def test_an_index_is_no_unit(tmp_path):
    names = {f"q{joint + 1}": f"q_d[{joint}]" for joint in range(6)}
    found = table(tmp_path, f"{','.join(names.values())},x,y,z\n{SIX},{ROW}\n", replace(PLAIN, columns=names))
    assert found.options.units["q1"] == "deg"


@pytest.mark.parametrize(
    ("names", "columns", "words"),
    [
        # A part of what is counted from 0, four of it, and two counts.
        ("q[0],q[2],q[3]", {}, ["counted from 0", "--column q1="]),
        ("q0,q1,q2,q3", {}, ["counted from 0", "--column q1="]),
        ("q[0],q[1],q[2]", {"q1": "q[0]"}, ["counted from 0"]),
        ("J1,J2,A3", {}, ["'J1' and 'A3'", "--ignore"]),
        ("J1,J2,A1,A2", {}, ["both 'J1' and 'A1'", "--ignore"]),
        ("position0,position1", {}, ["no joint angles", "not yet used: position0, position1"]),
    ],
)
def test_joints_that_may_be_counted_in_two_ways_are_a_question(tmp_path, names, columns, words):
    text = f"{names},x,y,z\n{','.join('5' * len(names.split(',')))},{ROW}\n"
    with refused(tmp_path / "t.csv", "header", *words):
        table(tmp_path, text, replace(PLAIN, columns=columns))


@pytest.mark.parametrize(
    "joints", [[f"rax_{j}" for j in range(1, 7)], [f"A{j}" for j in range(1, 7)], [f"axis_{j}_real" for j in "abcdef"], []]
)
@pytest.mark.parametrize("parts", [["q1", "q2", "q3", "q4"], ["q0", "q1", "q2", "q3"]])
def test_a_quaternion_beside_joints_is_a_question(tmp_path, joints, parts):
    rng = np.random.default_rng(1)
    turns = Rotation.random(5, random_state=rng)
    rows = "".join(
        f"{','.join(['5'] * len(joints) + [f'{each:.6f}' for each in quat])},{ROW}\n"
        for quat in turns.as_quat()[:, [3, 0, 1, 2]]
    )
    text = f"{','.join([*joints, *parts])},x,y,z\n{rows}"
    with refused(tmp_path / "t.csv", "header", ", ".join(parts), "length 1", f"--column qw={parts[0]!r}"):
        table(tmp_path, text)
    if joints:
        columns = {f"q{number}": name for number, name in enumerate(joints, 1)} | dict(
            zip(("qw", "qx", "qy", "qz"), parts, strict=True)
        )
        found = table(tmp_path, text, replace(PLAIN, columns=columns))
        got = np.column_stack([found.table[name] for name in ("rx", "ry", "rz")])
        np.testing.assert_allclose(got, turns.as_rotvec(), atol=1e-5)


def test_four_joints_that_are_no_quaternion_are_joints(tmp_path):
    assert table(tmp_path, f"q1,q2,q3,q4,x,y,z\n0.5,0.5,0.5,0.5,{ROW}\n10,20,30,40,{ROW}\n").joints == 4


@pytest.mark.parametrize("others", ["A,B,C", "W,P,R", "A [deg],B [deg],C [deg]", "E4,E5,E6"])
@pytest.mark.parametrize("external", ["E1,E2,E3", "E1"])
def test_external_axes_beside_an_orientation_are_a_question(tmp_path, others, external):
    count = len(external.split(","))
    text = f"q1,x,y,z,{others},{external}\n1,{ROW},10,20,30{',0' * count}\n"
    options = replace(PLAIN, rotation="euler:ZYX")
    with refused(tmp_path / "t.csv", "header", external.replace(",", ", "), "external axes?", "--column e1="):
        table(tmp_path, text, options)
    # Said in part it is still one.
    names = others.split(",")
    if count == 1:
        with refused(tmp_path / "t.csv", "header", "external axes?"):
            table(tmp_path, text, replace(options, columns={"e2": names[1], "e3": names[2]}))
    found = table(tmp_path, text, replace(options, columns=dict(zip(("e1", "e2", "e3"), names, strict=True))))
    expected = Rotation.from_euler("ZYX", [10, 20, 30], degrees=True).as_rotvec()
    np.testing.assert_allclose([found.table[name][0] for name in ("rx", "ry", "rz")], expected)


def test_euler_angles_with_nothing_beside_them_are_what_the_option_says(tmp_path):
    assert "rx" in table(tmp_path, f"q1,x,y,z,E1,E2,E3\n1,{ROW},1,2,3\n", replace(PLAIN, rotation="euler:ZYX")).table


def test_a_label_that_is_no_pose_is_a_question(tmp_path):
    """Controllers call the posture of the arm its configuration."""
    text = f"Config,q1,x,y,z\nFUT,1,{ROW}\nFUT,40,{ROW}\n"
    with refused(tmp_path / "t.csv", "line 2, column Config", "'FUT'", "--ignore 'Config'"):
        table(tmp_path, text)
    assert table(tmp_path, text, replace(PLAIN, ignore=["Config"])).table["pose"].tolist() == [1, 2]


NAMED = ("rail", "shoulder_pan_joint", "J1")


@pytest.mark.parametrize(
    "headers",
    [
        "rail,shoulder_pan_joint,J1",
        "rail [mm],Shoulder Pan Joint (deg),J1 [deg]",
        "rail_mm,shoulder_pan_joint_deg,J1_deg",
        "/joint_states/rail/position,/joint_states/shoulder_pan_joint/position,/joint_states/J1/position",
    ],
)
def test_columns_may_have_the_names_of_the_robots_joints(tmp_path, headers):
    robot = replace(robot_of("Tx(q1) Rz(q2) Tx(1) Rz(q3) [A]"), joint_names=NAMED)
    velocity = "/joint_states/rail/velocity"
    (tmp_path / "t.csv").write_text(f"{headers},{velocity},x,y,z\n1,2,3,9,{ROW}\n")
    found = read_measurement_table(tmp_path / "t.csv", PLAIN, robot)
    np.testing.assert_allclose([found.table[name][0] for name in ("q1", "q2", "q3")], [0.001, *np.radians([2, 3])])
    assert found.ignored == (velocity,)
    # What was found out needs no robot a second time.
    assert read_measurement_table(tmp_path / "t.csv", found.options).options == found.options


def test_a_rail_is_measured_in_lengths_and_a_joint_in_angles(tmp_path):
    robot = robot_of("Tx(q1) Rz(q2) [A]")
    for names, unit in (("J1 [deg],J2", "J1 [deg]"), ("J1,J2 [mm]", "J2 [mm]")):
        (tmp_path / "t.csv").write_text(f"{names},x,y,z\n1,2,{ROW}\n")
        with refused(tmp_path / "t.csv", f"unit of {unit!r}", "--unit"):
            read_measurement_table(tmp_path / "t.csv", PLAIN, robot)


@pytest.mark.parametrize(
    ("names", "words"), [("J1,J2,J3", ["3 joints", "--ignore"]), ("J1", ["no column q2"]), ("a,b", ["no joint angles"])]
)
def test_as_many_joints_as_the_robot_has_are_needed(tmp_path, names, words):
    (tmp_path / "t.csv").write_text(f"{names},x,y,z\n{','.join('5' * len(names.split(',')))},{ROW}\n")
    with refused(tmp_path / "t.csv", "header", *words):
        read_measurement_table(tmp_path / "t.csv", PLAIN, robot_of("Rz(q1) Tx(1) Rz(q2) [A]"))


def test_topics_have_positions_orientations_and_forces(tmp_path):
    names = [f"/tcp/pose/position/{axis}" for axis in "xyz"] + [f"field.pose.orientation.{axis}" for axis in "wxyz"]
    text = f"J1,/ft/wrench/force/x,/tcp/twist/linear/x,{','.join(names)}\n5,6,9,{ROW},1,0,0,0\n"
    found = table(tmp_path, text)
    assert [found.table[name][0] for name in ("x", "y", "z", "fx", "rx")] == [0.001, 0.002, 0.003, 6.0, 0.0]
    assert found.ignored == ("/tcp/twist/linear/x",)

"""What columns are: found by their names and units, asked for where they could be two things; markers that are targets."""

import math
from dataclasses import replace

import numpy as np
import pytest
from imported_tables import PLAIN, ROW, table
from scipy.spatial.transform import Rotation
from support import refused, robot_of

from elastocal.exchange.column_names import is_name, kind_of, markers_in, recognize_column, unit_scale
from elastocal.exchange.measurement_table import ImportOptions, read_measurement_table

MARKED = replace(PLAIN, target=None)


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("q1", "q1", None),
        ("J3 [deg]", "q3", "deg"),
        ("Joint 4 (rad)", "q4", "rad"),
        ("A6", "q6", None),
        ("Axis_2_deg", "q2", "deg"),
        ("X", "x", None),
        ("x_mm", "x", "mm"),
        ("Position Y [mm]", "y", "mm"),
        ("Yaw (°)", "rz", "°"),
        ("Force X [kN]", "fx", "kN"),
        ("mz [N m]", "mz", "Nm"),
        ("mx (N·mm)", "mx", "Nmm"),
        ("Time [ms]", "time_s", "ms"),
        ("time_s", "time_s", "s"),
        ("Temperature [°C]", "temperature_c", "°C"),
        ("SMR", "target", None),
        ("t14", "t14", None),
        ("approach5", "approach5", None),
        # Whose first joint 0 is, and what an operator is, an option has to say.
        ("q0", None, None),
        ("Operator", None, None),
        ("tx", None, None),
        # No arm has so many joints, and each up to the last would be looked for.
        ("q999999999", None, None),
        ("q" + "9" * 5000, None, None),
        ("q٣", None, None),
        ("x_furlong", None, None),
    ],
)
def test_headers_are_recognized(header, name, unit):
    assert recognize_column(header) == (name, unit)
    assert name is None or is_name(name)


def test_units_are_those_of_the_kind():
    assert unit_scale("mm", kind_of("x")) == 1e-3
    assert unit_scale("deg", kind_of("q1")) == math.pi / 180.0
    # Of a prismatic joint.
    assert unit_scale("mm", kind_of("q7")) == 1e-3
    assert unit_scale("deg", kind_of("x")) is None
    assert unit_scale("kgf", kind_of("fx")) == 9.80665


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
        [f"field.position{joint}" for joint in range(6)],
        [f"field.name.position{joint}" for joint in range(6)],
        [f"/joint_states/A{joint}/position" for joint in range(1, 7)],
        [f"/joint_states/position.J{joint}" for joint in range(1, 7)],
    ],
)
def test_joints_may_be_counted_by_an_index_or_from_0_and_have_the_names_of_topics(tmp_path, names):
    found = table(tmp_path, f"{','.join(names)},x,y,z\n{SIX},{ROW}\n")
    np.testing.assert_allclose([found.table[f"q{joint}"][0] for joint in range(1, 7)], np.radians(range(1, 7)))
    assert bool(found.notes) == ("0" in names[0])


TWO_JOINTS, A_RAIL = robot_of("Rz(q1) Tx(1) Rz(q2) [A]"), robot_of("Tx(q1) Rz(q2) [A]")
BOTH = {"target": None, "targets": {"A": "A", "B": "B"}}


@pytest.mark.parametrize(
    ("header", "options", "robot", "words"),
    [
        # A part of what is counted from 0, four of it, and two counts.
        ("q[0],q[2],q[3],x,y,z", {}, None, ["counted from 0", "--column q1="]),
        ("q0,q1,q2,q3,x,y,z", {}, None, ["counted from 0", "--column q1="]),
        ("q[0],q[1],q[2],x,y,z", {"columns": {"q1": "q[0]"}}, None, ["counted from 0"]),
        ("J1,J2,A3,x,y,z", {}, None, ["'J1' and 'A3'", "--ignore"]),
        ("J1,J2,A1,A2,x,y,z", {}, None, ["both 'J1' and 'A1'", "--ignore"]),
        ("position0,position1,x,y,z", {}, None, ["no joint angles", "not yet used: position0, position1"]),
        ("J1,J2,J3,x,y,z", {}, TWO_JOINTS, ["3 joints", "--ignore"]),
        ("J1,x,y,z", {}, TWO_JOINTS, ["no column q2"]),
        ("a,b,x,y,z", {}, TWO_JOINTS, ["no joint angles"]),
        ("J1 [deg],J2,x,y,z", {}, A_RAIL, ["unit of 'J1 [deg]'", "--unit"]),
        ("J1,J2 [mm],x,y,z", {}, A_RAIL, ["unit of 'J2 [mm]'", "--unit"]),
        *(
            (f"q1,x,y,z,{part}", {}, None, ["a part of a quaternion", "--column qw=NAME", "--rotation none"])
            for part in ("qx,qy,qz", "qw,qx", "Q_x,Q_y,Q_z", "q0,qx,qy,qz")
        ),
        ("q1,x [mm],y,z\ndeg,m,mm,mm", {}, None, ["'x [mm]' and 'm'", "one unit"]),
        ("q1,x,y,z\nmm,mm,mm,mm", {"units": {}}, robot_of("Rz(q1) Tx(1) [A]"), ["unit of 'q1'", "'mm'", "--unit q1="]),
        ("q1,A_x,A_y,A_z,B_x,B_y,B_z,A_u95", BOTH, None, ["'A_u95' of A alone", "--ignore 'A_u95'"]),
        ("q1,A_x,A_y,A_z,B_x,B_y,B_z,B_u95", BOTH, None, ["'B_u95' of B alone"]),
        ("q1,A_x [mm],A_y,A_z,B_x [m],B_y,B_z", BOTH, None, ["'A_x [mm]' in mm and 'B_x [m]' in m", "one unit"]),
        ("q1,A_x,A_y,A_z,n", {"target": None, "targets": {"A": "A"}, "columns": {"x": "n"}}, None, ["'n'", "no --target"]),
    ],
)
def test_what_may_be_two_things_or_is_there_in_part_is_a_question(tmp_path, header, options, robot, words):
    row = ",".join("1" * len(header.partition("\n")[0].split(",")))
    with refused("--column" if words[0] == "'n'" else tmp_path / "t.csv", "", *words):
        table(tmp_path, f"{header}\n{row}\n", replace(PLAIN, **options), robot)


@pytest.mark.parametrize(
    ("text", "options", "name", "value"),
    [
        ("q1,x,y,z\nmm,mm,mm,mm\n90,1,2,3\n", {"units": {"q1": "deg"}}, "q1", np.pi / 2),
        ("q1,x,y,z,qx,qy,qz\n90,1,2,3,0,0,0\n", {"rotation": "none"}, "q1", np.pi / 2),
    ],
)
def test_options_go_before_what_a_table_says(tmp_path, text, options, name, value):
    found = table(tmp_path, text, replace(PLAIN, **options))
    assert found.table[name].tolist() == [value] and "rx" not in found.table


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
        columns = {f"q{number}": name for number, name in enumerate(joints, 1)}
        columns |= dict(zip(("qw", "qx", "qy", "qz"), parts, strict=True))
        found = table(tmp_path, text, replace(PLAIN, columns=columns))
        got = np.column_stack([found.table[name] for name in ("rx", "ry", "rz")])
        np.testing.assert_allclose(got, turns.as_rotvec(), atol=1e-5)


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
    found = table(tmp_path, f"{headers},{velocity},x,y,z\n1,2,3,9,{ROW}\n", PLAIN, robot)
    np.testing.assert_allclose([found.table[name][0] for name in ("q1", "q2", "q3")], [0.001, *np.radians([2, 3])])
    assert found.ignored == (velocity,)
    # What was found out needs no robot a second time.
    assert read_measurement_table(tmp_path / "t.csv", found.options).options == found.options


def test_topics_have_positions_orientations_and_forces(tmp_path):
    names = [f"/tcp/pose/position/{axis}" for axis in "xyz"] + [f"field.pose.orientation.{axis}" for axis in "wxyz"]
    text = f"J1,/ft/wrench/force/x,/tcp/twist/linear/x,{','.join(names)}\n5,6,9,{ROW},1,0,0,0\n"
    found = table(tmp_path, text)
    assert [found.table[name][0] for name in ("x", "y", "z", "fx", "rx")] == [0.001, 0.002, 0.003, 6.0, 0.0]
    assert found.ignored == ("/tcp/twist/linear/x",)


@pytest.mark.parametrize("joints", ["J1,J2", "q1,q2"])
def test_q0_beside_the_other_parts_of_a_quaternion_is_its_real_one(tmp_path, joints):
    text = f"{joints},x,y,z,q0,qx,qy,qz\n10,20,{ROW},-0.509038,0.770622,-0.290230,-0.250575\n"
    found = table(tmp_path, text)
    vector = [found.table[name][0] for name in ("rx", "ry", "rz")]
    np.testing.assert_allclose(vector, [-1.85636369, 0.69913851, 0.60361478], atol=1e-6)
    np.testing.assert_allclose([found.table[name][0] for name in ("q1", "q2")], np.radians([10, 20]))
    assert (found.options.columns["qw"], found.notes) == ("q0", ())


@pytest.mark.parametrize(
    "head", ["q1,x,y,z,fz\ndeg,mm,mm,mm,kN", "q1,x,y,z,fz\n[deg],[mm],(mm),mm,[ kN ]", "q1 [deg],x,y_mm,z,fz\n,mm,mm,mm,kN"]
)
def test_units_may_stand_in_a_row_under_the_header(tmp_path, head):
    found = table(tmp_path, f"{head}\n90,{ROW},4\n", ImportOptions(target="a"))
    assert (found.table["q1"][0], found.table["x"][0], found.table["fz"][0]) == (np.pi / 2, 0.001, 4000.0)
    assert any(note.startswith("units in the row under the header") for note in found.notes)
    again = table(tmp_path, f"{head}\n90,{ROW},4\n", found.options)
    assert again.options == found.options and again.table["fz"].tolist() == [4000.0]


ARM = ("shoulder_pan", "shoulder_lift", "elbow")


def three_joints():
    return replace(robot_of("Rz(q1) Tx(1) Ry(q2) Tx(1) Ry(q3) [A]"), joint_names=ARM)


HEADS = {
    "rosbag": ("field.name{}", "field.position{}"),
    "PlotJuggler": ("/joint_states/name[{}]", "/joint_states/position[{}]"),
    "a list": ("names_{}", "positions_{}"),
    "points": ("/joint_states/name.{}", "/joint_states/position.{}"),
}


@pytest.mark.parametrize("program", HEADS)
def test_positions_are_of_the_joints_that_names_say_in_whatever_order(tmp_path, program):
    names, positions = ([head.format(number) for number in range(4)] for head in HEADS[program])
    velocities = [position.replace("position", "velocity") for position in positions]
    head = ",".join(["%time", *names, *positions, *velocities, "x", "y", "z"])
    rows = "".join(f"{row},elbow,gripper,shoulder_lift,shoulder_pan,3,9,2,1,7,7,7,7,1,2,3\n" for row in range(2))
    found = table(tmp_path, f"{head}\n{rows}", PLAIN, three_joints())
    assert [found.table[f"q{joint}"][0] for joint in (1, 2, 3)] == pytest.approx(np.radians([1, 2, 3]))
    assert set(found.ignored) == {*names, positions[1], *velocities}
    # The columns that were found out need no robot.
    again = read_measurement_table(tmp_path / "t.csv", found.options)
    np.testing.assert_array_equal(again.table["q2"], found.table["q2"])
    with refused(tmp_path / "t.csv", "header", "elbow, gripper", "--robot FILE", "--column q1="):
        table(tmp_path, f"{head}\n{rows}")


def test_a_name_that_changes_is_refused_with_its_line(tmp_path):
    text = "name0,name1,name2,position0,position1,position2,x,y,z\n" + "elbow,shoulder_pan,shoulder_lift,3,1,2,1,2,3\n" * 2
    text += "shoulder_pan,elbow,shoulder_lift,3,1,2,1,2,3\n"
    with refused(tmp_path / "t.csv", "line 4, column name0", "'shoulder_pan'", "'elbow' in line 2"):
        table(tmp_path, text, PLAIN, three_joints())


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
        table(tmp_path, text, MARKED)
    targets = {"SMR": markers[1], markers[0]: markers[0]}
    found = table(tmp_path, text, replace(MARKED, targets=targets))
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
        table(tmp_path, text, replace(MARKED, targets={"C": "C"}))


def test_a_marker_that_the_target_is_called_after_is_meant_and_the_others_are_left_out(tmp_path):
    text = "q1,A_x,A_y,A_z,B_x,B_y,B_z\n1,1,2,3,4,5,6\n"
    found = table(tmp_path, text, replace(MARKED, target="B"))
    assert found.table["x"].tolist() == [0.004] and found.ignored == ("A_x", "A_y", "A_z")
    # Another name says nothing of a marker.
    with refused(tmp_path / "t.csv", "header", "'A', 'B'"):
        table(tmp_path, text, replace(MARKED, target="SMR"))


def test_what_was_commanded_is_no_target_and_a_number_behind_plain_names_is_a_question(tmp_path):
    found = table(tmp_path, "q1,x,y,z,x_cmd,y_cmd,z_cmd\n1,1,2,3,4,5,6\n", replace(MARKED, target="a"))
    assert found.table["x"].tolist() == [0.001] and found.ignored == ("x_cmd", "y_cmd", "z_cmd")
    text = "q1,x,y,z,x2,y2,z2\n1,1,2,3,4,5,6\n"
    with refused(tmp_path / "t.csv", "header", "x, y, z, '2'", "--target NAME= "):
        table(tmp_path, text, replace(MARKED, target="a"))
    found = table(tmp_path, text, replace(MARKED, targets={"a": "", "b": "2"}))
    assert found.table["x"].tolist() == [0.001, 0.004]
    columns = {"x": "x", "y": "y", "z": "z"}
    assert table(tmp_path, text, replace(MARKED, target="a", columns=columns)).table["x"].tolist() == [0.001]


@pytest.mark.parametrize("above", ["Name,,SMR1,SMR1,SMR1,SMR2,SMR2,SMR2", ",,SMR1,,,SMR2,,", ",,SMR1,,,SMR2"])
def test_markers_may_stand_in_the_line_above_the_axes(tmp_path, above):
    text = f"Motive,1.2\n{above}\nq1,Time,X,Y,Z,X,Y,Z\ndeg,s,mm,mm,mm,mm,mm,mm\n90,5,1,2,3,4,5,6\n"
    with refused(tmp_path / "t.csv", "header", "'SMR1', 'SMR2'"):
        table(tmp_path, text, ImportOptions())
    found = table(tmp_path, text, ImportOptions(targets={"SMR1": "SMR1", "SMR2": "SMR2"}))
    assert found.table["x"].tolist() == [0.001, 0.004] and found.table["time_s"].tolist() == [5.0, 5.0]
    assert "1 line above the header" in found.notes

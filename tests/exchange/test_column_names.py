"""What columns are: found by their names and units, asked for where they could be two things; orientations in any notation."""

from dataclasses import replace

import numpy as np
import pytest
from imported_tables import PLAIN, ROW, table
from scipy.spatial.transform import Rotation
from support import refused, robot_of

from elastocal.exchange.column_names import is_name, kind_of, recognize_column, rotation_vectors, unit_scale
from elastocal.exchange.measurement_table import ImportOptions, read_measurement_table


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("J3 [deg]", "q3", "deg"),
        ("Joint 4 (rad)", "q4", "rad"),
        ("Axis_2_deg", "q2", "deg"),
        ("x_mm", "x", "mm"),
        ("Position Y [mm]", "y", "mm"),
        ("Yaw (°)", "rz", "°"),
        ("mx (N·mm)", "mx", "Nmm"),
        ("time_s", "time_s", "s"),
        ("Temperature [°C]", "temperature_c", "°C"),
        ("SMR", "target", None),
        ("approach5", "approach5", None),
        # Whose first joint 0 is, and what an operator is, an option has to say.
        ("q0", None, None),
        ("Operator", None, None),
        # No arm has so many joints, and each up to the last would be looked for.
        ("q" + "9" * 5000, None, None),
        ("q٣", None, None),
        ("x_furlong", None, None),
    ],
)
def test_headers_are_recognized(header, name, unit):
    assert recognize_column(header) == (name, unit)
    assert name is None or is_name(name)


def test_units_are_those_of_the_kind():
    # Of a prismatic joint too.
    assert unit_scale("mm", kind_of("x")) == unit_scale("mm", kind_of("q7")) == 1e-3
    assert unit_scale("deg", kind_of("x")) is None and unit_scale("kgf", kind_of("fx")) == 9.80665


@pytest.mark.parametrize("header", ["Load [kg]", "Target [mm]"])
def test_a_number_or_name_with_a_unit_is_a_question(tmp_path, header):
    text = f"q1,x,y,z,{header}\n0,1,2,3,4\n"
    with refused(tmp_path / "t.csv", repr(header), f"--ignore {header!r}", f"={header!r}"):
        table(tmp_path, text)
    assert table(tmp_path, text, replace(PLAIN, ignore=[header])).ignored == (header,)
    assert table(tmp_path, text, replace(PLAIN, columns={"load": header})).table["load"].tolist() == [4]


@pytest.mark.parametrize(
    ("called", "first"),
    [("q[{}]", 1), ("q[{}]", 0), ("J ( {} )", 1), ("q[{}] [deg]", 0), ("rax_{}", 1), ("/joint_states/A{}/position", 1)],
)
def test_joints_may_be_counted_by_an_index_or_from_0_and_have_the_names_of_topics(tmp_path, called, first):
    names = ",".join(called.format(first + joint) for joint in range(6))
    found = table(tmp_path, f"{names},x,y,z\n1,2,3,4,5,6,{ROW}\n")
    np.testing.assert_allclose([found.table[f"q{joint}"][0] for joint in range(1, 7)], np.radians(range(1, 7)))
    assert bool(found.notes) == (first == 0)


TWO_JOINTS, A_RAIL = robot_of("Rz(q1) Tx(1) Rz(q2) [A]"), robot_of("Tx(q1) Rz(q2) [A]")


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
        ("J1 [deg],J2,x,y,z", {}, A_RAIL, ["unit of 'J1 [deg]'", "--unit"]),
        ("q1,x,y,z,qw,qx", {}, None, ["a part of a quaternion", "--column qw=NAME", "--rotation none"]),
        ("q1,x,y,z,q0,qx,qy,qz", {}, None, ["a part of a quaternion"]),
        ("q1,x [mm],y,z\ndeg,m,mm,mm", {}, None, ["'x [mm]' and 'm'", "one unit"]),
        ("q1,A_x,A_y,A_z,B_x,B_y,B_z", {}, None, ["no column x, y, z", "not yet used: A_x"]),
    ],
)
def test_what_may_be_two_things_or_is_there_in_part_is_a_question(tmp_path, header, options, robot, words):
    row = ",".join("1" * len(header.partition("\n")[0].split(",")))
    with refused(tmp_path / "t.csv", "", *words):
        table(tmp_path, f"{header}\n{row}\n", replace(PLAIN, **options), robot)


def test_options_go_before_what_a_table_says(tmp_path):
    found = table(tmp_path, "q1,x,y,z\nmm,mm,mm,mm\n90,1,2,3\n", replace(PLAIN, units={"q1": "deg"}))
    assert found.table["q1"].tolist() == [np.pi / 2]
    found = table(tmp_path, "q1,x,y,z,qx,qy,qz\n90,1,2,3,0,0,0\n", replace(PLAIN, rotation="none"))
    assert found.table["q1"].tolist() == [np.pi / 2] and "rx" not in found.table


@pytest.mark.parametrize("joints", [[f"rax_{j}" for j in range(1, 7)], [f"axis_{j}_real" for j in "abcdef"], []])
@pytest.mark.parametrize("parts", [["q1", "q2", "q3", "q4"], ["q0", "q1", "q2", "q3"]])
def test_a_quaternion_beside_joints_is_a_question(tmp_path, joints, parts):
    turns = Rotation.random(5, random_state=np.random.default_rng(1))
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


@pytest.mark.parametrize("others", ["A,B,C", "A [deg],B [deg],C [deg]", "E4,E5,E6"])
@pytest.mark.parametrize("external", ["E1,E2,E3", "E1"])
def test_external_axes_beside_an_orientation_are_a_question(tmp_path, others, external):
    text = f"q1,x,y,z,{others},{external}\n1,{ROW},10,20,30{',0' * len(external.split(','))}\n"
    options, names = replace(PLAIN, rotation="euler:ZYX"), others.split(",")
    # Said in part it is still one.
    for stated in ({}, {"e2": names[1], "e3": names[2]} if external == "E1" else {}):
        with refused(tmp_path / "t.csv", "header", external.replace(",", ", "), "external axes?", "--column e1="):
            table(tmp_path, text, replace(options, columns=stated))
    found = table(tmp_path, text, replace(options, columns=dict(zip(("e1", "e2", "e3"), names, strict=True))))
    expected = Rotation.from_euler("ZYX", [10, 20, 30], degrees=True).as_rotvec()
    np.testing.assert_allclose([found.table[name][0] for name in ("rx", "ry", "rz")], expected)


@pytest.mark.parametrize(
    "headers",
    [
        "rail [mm],Shoulder Pan Joint (deg),J1 [deg]",
        "rail_mm,shoulder_pan_joint_deg,J1_deg",
        "/joint_states/rail/position,/joint_states/shoulder_pan_joint/position,/joint_states/J1/position",
    ],
)
def test_columns_may_have_the_names_of_the_robots_joints(tmp_path, headers):
    robot = robot_of("Tx(q1) Rz(q2) Tx(1) Rz(q3) [A]")
    robot = replace(robot, joint_names=("rail", "shoulder_pan_joint", "J1"))
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


def test_q0_beside_the_other_parts_of_a_quaternion_is_its_real_one(tmp_path):
    found = table(tmp_path, f"q1,q2,x,y,z,q0,qx,qy,qz\n10,20,{ROW},-0.509038,0.770622,-0.290230,-0.250575\n")
    vector = [found.table[name][0] for name in ("rx", "ry", "rz")]
    np.testing.assert_allclose(vector, [-1.85636369, 0.69913851, 0.60361478], atol=1e-6)
    np.testing.assert_allclose([found.table[name][0] for name in ("q1", "q2")], np.radians([10, 20]))
    assert (found.options.columns["qw"], found.notes) == ("q0", ())


@pytest.mark.parametrize("head", ["q1,x,y,z,fz\n[deg],[mm],(mm),mm,[ kN ]", "q1 [deg],x,y_mm,z,fz\n,mm,mm,mm,kN"])
def test_units_may_stand_in_a_row_under_the_header(tmp_path, head):
    found = table(tmp_path, f"{head}\n90,{ROW},4\n", ImportOptions(target="a"))
    assert (found.table["q1"][0], found.table["x"][0], found.table["fz"][0]) == (np.pi / 2, 0.001, 4000.0)
    again = table(tmp_path, f"{head}\n90,{ROW},4\n", found.options)
    assert again.options == found.options and again.table["fz"].tolist() == [4000.0]


ORIENTATIONS = Rotation.random(20, random_state=3)
QUATERNIONS, MATRICES = np.roll(ORIENTATIONS.as_quat(), 1, axis=1), ORIENTATIONS.as_matrix()


@pytest.mark.parametrize(
    ("notation", "values"),
    [
        ("vector", ORIENTATIONS.as_rotvec()),
        ("quaternion", -QUATERNIONS),
        ("matrix", MATRICES.reshape(-1, 9)),
        ("homogeneous", np.concatenate([MATRICES, np.ones((20, 3, 1))], axis=2).reshape(-1, 12)),
        # Capitals turn about axes that move with the body, small letters about fixed ones.
        ("euler:ZYX", ORIENTATIONS.as_euler("ZYX")),
        ("euler:xyz", ORIENTATIONS.as_euler("ZYX")[:, ::-1]),
    ],
)
def test_notations_agree(notation, values):
    vectors, off = rotation_vectors(notation, values)
    assert not off.any()
    np.testing.assert_allclose(Rotation.from_rotvec(vectors).as_matrix(), MATRICES, atol=1e-12)


def test_rounded_values_pass_and_what_is_no_rotation_is_marked():
    rounded = np.round(MATRICES.reshape(-1, 9), 4)
    assert not rotation_vectors("matrix", rounded)[1].any()
    wrong = np.vstack([rounded[:1], np.diag([1.0, 1.0, -1.0]).reshape(1, 9), 2 * rounded[:1]])
    assert rotation_vectors("matrix", wrong)[1].tolist() == [False, True, True]
    assert rotation_vectors("quaternion", np.array([[1.0, 0, 0, 0], [0, 0, 0, 0], [1, 1, 0, 0]]))[1].tolist() == [
        False,
        True,
        True,
    ]

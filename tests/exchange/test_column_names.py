"""Columns are recognized by names and units, ambiguous ones are refused, and orientations
are read in any notation."""

from dataclasses import replace

import numpy as np
import pytest
from imported_tables import PLAIN, ROW, table
from scipy.spatial.transform import Rotation
from support import refused, robot_of

from elastocal.exchange.column_names import (
    convert_to_rotation_vectors,
    find_scales,
    is_name,
    recognize_column,
)
from elastocal.exchange.measurement_table import read_measurement_table


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("J3 [deg]", "q3", "deg"),
        ("Axis_2_deg", "q2", "deg"),
        ("q[1]", "q1", None),
        ("J ( 6 )", "q6", None),
        ("Actuator7", "q7", None),
        ("q[5] [deg]", "q5", "deg"),
        ("x_mm", "x", "mm"),
        ("Position Y [mm]", "y", "mm"),
        ("Yaw (°)", "rz", "°"),
        ("mx (N·mm)", "mx", "Nmm"),
        ("time_s", "time_s", "s"),
        ("SMR", "target", None),
        ("approach5", "approach5", None),
        # Whose first joint 0 is, whether E1 is an external axis, and what an operator
        # is, an option has to say.
        *(
            (header, None, None)
            for header in ("q0", "E1", "Operator", "x_furlong", "q٣")
        ),
        # No arm has so many joints, and each up to the last would be looked for.
        ("q" + "9" * 5000, None, None),
    ],
)
def test_headers_are_recognized(header, name, unit):
    assert recognize_column(header) == (name, unit)
    assert name is None or is_name(name)


def test_units_belong_to_the_kind_of_the_column():
    scales = {"x": 1e-3, "q7": 1e-3, "q1": np.pi / 180, "fx": 9.80665}
    assert find_scales(
        {"x": "mm", "q7": "mm", "q1": "degrees", "fx": "kgf"}
    ) == pytest.approx(scales)


@pytest.mark.parametrize("header", ["Load [kg]", "Target [mm]"])
def test_a_number_or_name_with_a_unit_is_refused(tmp_path, header):
    text = f"q1,x,y,z,{header}\n0,1,2,3,4\n"
    with refused(
        tmp_path / "t.csv", repr(header), f"--ignore {header!r}", f"={header!r}"
    ):
        table(tmp_path, text)
    assert table(tmp_path, text, replace(PLAIN, ignore=[header])).ignored == (header,)
    assert table(tmp_path, text, replace(PLAIN, columns={"load": header})).table[
        "load"
    ].tolist() == [4]


def test_joints_are_counted_from_0_if_an_option_says_so(tmp_path):
    text = "q[0],q[1],q[2],x,y,z\n10,20,30,1,2,3\n"
    first = table(tmp_path, text, replace(PLAIN, columns={"q1": "q[0]"}))
    angles = [first.table[f"q{joint}"][0] for joint in (1, 2, 3)]
    np.testing.assert_allclose(angles, np.radians([10.0, 20.0, 30.0]))
    every = {f"q{joint + 1}": f"q[{joint}]" for joint in range(3)}
    assert table(tmp_path, text, replace(PLAIN, columns=every)).joints == 3


TWO_JOINTS = robot_of("Rz(q1) Tx(1) Rz(q2) [A]")
A_RAIL = robot_of("Tx(q1) Rz(q2) [A]")


@pytest.mark.parametrize(
    ("header", "options", "robot", "words"),
    [
        ("q[0],q[1],x,y,z", {}, None, ["'q[0]', counted from 0", "--column q1='q[0]'"]),
        ("J1,J2,A1,A2,x,y,z", {}, None, ["both 'J1' and 'A1'", "--ignore"]),
        (
            "rax_1,rax_2,x,y,z,q1,q2,q3,q4",
            {},
            None,
            ["both 'rax_1' and 'q1'", "--column qw="],
        ),
        (
            "position0,position1,x,y,z",
            {},
            None,
            ["no joint angles", "not yet used: position0, position1"],
        ),
        ("J1,J2,J3,x,y,z", {}, TWO_JOINTS, ["3 joints", "--ignore"]),
        ("J1,x,y,z", {}, TWO_JOINTS, ["no column q2"]),
        ("J1 [deg],J2,x,y,z", {}, A_RAIL, ["unit of 'J1 [deg]'", "--unit"]),
        (
            "q1,x,y,z,qw,qx",
            {},
            None,
            ["a part of a quaternion", "--column qw=NAME", "--rotation none"],
        ),
        ("q1,x [mm],y,z\ndeg,m,mm,mm", {}, None, ["'x [mm]' and 'm'", "one unit"]),
        ("q1,A_x,A_y,A_z", {}, None, ["no column x, y, z", "not yet used: A_x"]),
        (
            "q1,x,y,z,A,B,C,E1,E2,E3",
            {"rotation": "euler:XYZ"},
            None,
            ["no column e1", "--column e1=NAME; not yet used: A, B"],
        ),
    ],
)
def test_ambiguous_and_incomplete_columns_are_refused(
    tmp_path, header, options, robot, words
):
    row = ",".join("1" * len(header.partition("\n")[0].split(",")))
    with refused(tmp_path / "t.csv", "", *words):
        table(tmp_path, f"{header}\n{row}\n", replace(PLAIN, **options), robot)


def test_options_precede_the_header_of_the_table(tmp_path):
    imported = table(
        tmp_path,
        "q1,x,y,z\nmm,mm,mm,mm\n90,1,2,3\n",
        replace(PLAIN, units={"q1": "deg"}),
    )
    assert imported.table["q1"].tolist() == [np.pi / 2]
    joints = {"q1": "q[0]", "q2": "q[1]"}
    imported = table(
        tmp_path,
        f"q[0],q[1],x,y,z,qx,qy,qz\n90,0,{ROW},0,0,0\n",
        replace(PLAIN, rotation="none", columns=joints),
    )
    assert imported.table["q1"].tolist() == [np.pi / 2] and "rx" not in imported.table


def vector(imported):
    return [imported.table[name][0] for name in ("rx", "ry", "rz")]


def test_orientations_are_read_from_stated_columns_and_quaternions_from_q0_to_q3(
    tmp_path,
):
    angles = dict(zip(("e1", "e2", "e3"), "ABC", strict=True))
    options = replace(PLAIN, rotation="euler:ZYX", columns=angles)
    imported = table(
        tmp_path, f"q1,x,y,z,A,B,C,E1,E2,E3\n1,{ROW},10,20,30,0,0,0\n", options
    )
    np.testing.assert_allclose(
        vector(imported),
        Rotation.from_euler("ZYX", [10, 20, 30], degrees=True).as_rotvec(),
    )
    imported = table(
        tmp_path,
        f"q1,q2,x,y,z,q0,qx,qy,qz\n10,20,{ROW},-0.509038,0.770622,-0.290230,-0.250575\n",
    )
    np.testing.assert_allclose(
        vector(imported), [-1.85636369, 0.69913851, 0.60361478], atol=1e-6
    )
    parts = {"qw": "q1", "qx": "q2", "qy": "q3", "qz": "q4", "q1": "rax_1"}
    imported = table(
        tmp_path,
        f"rax_1,x,y,z,q1,q2,q3,q4\n10,{ROW},0,1,0,0\n",
        replace(PLAIN, columns=parts),
    )
    np.testing.assert_allclose(
        [*vector(imported), imported.table["q1"][0]], [np.pi, 0, 0, np.radians(10)]
    )


@pytest.mark.parametrize(
    "headers",
    [
        "rail [mm],Shoulder Pan Joint (deg),J1 [deg]",
        "rail_mm,shoulder_pan_joint_deg,J1_deg",
    ],
)
def test_columns_may_have_the_names_of_the_robots_joints(tmp_path, headers):
    robot = replace(
        robot_of("Tx(q1) Rz(q2) Tx(1) Rz(q3) [A]"),
        joint_names=("rail", "shoulder_pan_joint", "J1"),
    )
    imported = table(
        tmp_path, f"{headers},rail velocity,x,y,z\n1,2,3,9,{ROW}\n", PLAIN, robot
    )
    np.testing.assert_allclose(
        [imported.table[name][0] for name in ("q1", "q2", "q3")],
        [0.001, *np.radians([2, 3])],
    )
    assert imported.ignored == ("rail velocity",)
    # What was found out needs no robot a second time.
    assert (
        read_measurement_table(tmp_path / "t.csv", imported.options).options
        == imported.options
    )


def test_rounded_rotations_are_accepted_and_other_matrices_are_marked():
    """That each notation is read as it is meant, tests/fuzz/test_dialects.py has."""
    rounded = np.round(
        Rotation.random(20, random_state=3).as_matrix().reshape(-1, 9), 4
    )
    assert not convert_to_rotation_vectors("matrix", rounded)[1].any()
    wrong = np.vstack(
        [rounded[:1], np.diag([1.0, 1.0, -1.0]).reshape(1, 9), 2 * rounded[:1]]
    )
    assert convert_to_rotation_vectors("matrix", wrong)[1].tolist() == [
        False,
        True,
        True,
    ]
    quaternions = np.array([[1.0, 0, 0, 0], [0, 0, 0, 0], [1, 1, 0, 0]])
    assert convert_to_rotation_vectors("quaternion", quaternions)[1].tolist() == [
        False,
        True,
        True,
    ]

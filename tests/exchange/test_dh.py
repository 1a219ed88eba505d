"""Robots of Denavit-Hartenberg tables and kinematics files against pinocchio; every fault
is reported in one line, with line and column."""

import math

import numpy as np
import pinocchio as pin
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from support import refused

from elastocal.exchange.dh import DhOptions, robot_from_dh
from elastocal.exchange.robot_text import format_robot_file
from elastocal.mechanics.kinematics import compute_poses
from elastocal.mechanics.robot_file import parse_robot

PLAIN = DhOptions("deg", "m")
RADIANS = DhOptions("rad", "m")
HEADER = "theta_offset,d,a,alpha"


def table(folder, text, name="arm.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def write(folder, rows):
    return table(
        folder, "\n".join([HEADER, *(",".join(map(str, row)) for row in rows)]) + "\n"
    )


def screw(letter, turn, shift):
    axis = np.eye(3)["xyz".index(letter)]
    return pin.SE3(pin.exp3(turn * axis), shift * axis)


def assert_stands(result, rows, modified):
    robot = parse_robot(yaml.safe_load(format_robot_file(result)))
    for angles in np.random.default_rng(1).uniform(-2, 2, (4, robot.joints)):
        at = pin.SE3.Identity()
        values = iter(angles)
        for theta, d, a, alpha in rows:
            about_z = screw("z", theta + next(values), d)
            at = at * (
                screw("x", alpha, a) * about_z
                if modified
                else about_z * screw("x", alpha, a)
            )
        position, rotation = compute_poses(
            robot.chain, angles[None], robot.chain.end_effector
        )
        np.testing.assert_allclose(position[0], at.translation, rtol=0, atol=1e-9)
        assert np.linalg.norm(pin.log3(at.rotation.T @ rotation[0])) < 1e-9
    return robot


angle = st.floats(-3.2, 3.2)
length = st.floats(-0.5, 0.5)
tables = st.lists(st.tuples(angle, length, length, angle), min_size=1, max_size=7)


@settings(max_examples=20, deadline=None)
@given(rows=tables, modified=st.booleans())
def test_any_table_has_the_poses_of_its_notation(tmp_path_factory, rows, modified):
    assert_stands(
        robot_from_dh(
            write(tmp_path_factory.mktemp("dh"), rows), RADIANS, modified=modified
        ),
        rows,
        modified,
    )


# A UR5 as its controller has calibrated it; d of the second to the fourth joint cancel.
UR5_CALIBRATED = [
    (-9.62699668632896e-06, 0.0888794492754001, 0.000279332356195598, 1.57033858830411),
    (-1.43707039992005, 574.241384579456, -0.0566854832098269, -0.000733893428160216),
    (2.02543119975016, -507.363402098168, -0.32646702272051, 0.00325607356326439),
    (-0.588254688694989, -66.7676839353205, 1.49388687216263e-05, 1.57040005185553),
    (2.55e-05, 0.0950, 3.5e-05, -1.5705),
    (1.2e-05, 0.0823, 0.0, 0.0),
]


@pytest.mark.parametrize(
    ("lever", "modified"), [(None, False), (3.0, True), (300.0, False)]
)
def test_lengths_that_cancel_along_nearly_parallel_axes_become_short(
    tmp_path, lever, modified
):
    rows = [[*row] for row in UR5_CALIBRATED]
    for number, d in enumerate((lever, -lever - 0.1, 0.2) if lever else (), 1):
        rows[number][1] = d
    result = robot_from_dh(write(tmp_path, rows), RADIANS, modified=modified)
    robot = assert_stands(result, rows, modified)
    assert sum(abs(t.constant) for t in robot.chain.transforms if t.kind == "T") < 2.5
    assert any("cancel" in note for note in result.notes)


def read(folder, text, **options):
    return robot_from_dh(table(folder, text), options=DhOptions(**options), name="two")


def test_rows_are_converted_to_si_units_and_joint_names_are_kept(tmp_path):
    text = (
        "# maker's manual\njoint; theta_offset_deg; d_mm; a_m; alpha; type\n\n"
        "base;90;250;-0,1;-1,5;R\nrest ;0;0;0;6,2;\n"
    )
    result = read(tmp_path, text, angles="rad", lengths="mm")
    assert (result.document["joint_names"], result.document["name"]) == (
        ["base", "rest"],
        "two",
    )
    assert_stands(
        result, [(math.pi / 2, 0.25, -0.1, -1.5), (0, 0, 0, 6.2)], modified=False
    )
    # Units stand behind names in brackets or in a row of their own, too.
    for head in (
        "[rad],d [mm],a (mm),alpha(rad)",
        ",d,a,alpha\n[rad],[mm],[mm],(rad)",
        "_rad,d,a_mm,alpha\nrad,mm,mm,rad",
    ):
        assert_stands(
            read(tmp_path, f"theta_offset{head}\n0,0.1,0.2,1.5\n"),
            [(0, 1e-4, 2e-4, 1.5)],
            modified=False,
        )
    text = "maker;d_m;a_m;alpha_deg;dynamics\nx;0.1;0;90;a,b\n"
    assert (
        "not used: maker, dynamics"
        in read(tmp_path, text, ignore=("maker", "dynamics")).notes
    )


JOINT_ROW = "joint,theta_offset_deg,d_m,a_m,alpha_deg,type\n"
FAULTS = {
    "no number": (
        JOINT_ROW + "1,0,0.1,0,90,R\n2,0,x,0,90,R\n",
        "line 3, column d_m",
        ["'x'"],
    ),
    "nothing": (JOINT_ROW + "1,0,,0,90,R\n", "line 2, column d_m", ["nothing"]),
    "a type": (
        JOINT_ROW + "1,0,0,0,90,S\n",
        "line 2, column type",
        ["'S'", "R (revolute), P (prismatic) or F (fixed)"],
    ),
    "a prismatic joint without limits": (
        JOINT_ROW + "1,0,0,0,90,P\n",
        "line 2, column type",
        ["no limits of a prismatic joint", "lower and upper, in m as d"],
    ),
    "one limit": (
        "d_m,a_m,alpha_deg,lower_deg,upper_deg\n0,1,0,-90,\n",
        "line 2, column upper_deg",
        ["nothing"],
    ),
    "limits in two units": (
        "d_m,a_m,alpha_deg,lower_deg,upper_rad\n0,1,0,-90,1\n",
        "header",
        ["lower in deg and upper in rad"],
    ),
    "a rail in millimetres": (
        "type,d_m,a_m,alpha_deg,lower_deg,upper_deg\nP,0,1,0,0,3000\n",
        "joint_limits_deg[0]",
        ["3000", "metres"],
    ),
    "no column": ("d_m,a_m\n0,0\n", "header", ["no column alpha"]),
    "no unit": (
        "theta_offset_deg,d,a_m,alpha\ndeg,,,deg\n0,0,0,0\n",
        "header",
        ["no unit of 'd'", "--lengths"],
    ),
    "a column in two units": ("d_m,d_mm,a,alpha\n0,0,0,0\n", "header", ["d twice"]),
    "more turns than a joint counts": (
        JOINT_ROW + "1,0,0.1,0,1e9,R\n",
        "line 2, column alpha_deg",
        ["'1e9'", "1000 turns at"],
    ),
    "more rows than a chain has room for": (
        "d,a,alpha\n" + "0,0,90\n" * 501,
        "",
        ["501 rows", "at most 500"],
    ),
    "a joint's name twice": (
        "joint,d,a,alpha\na,0,1,0\na,0,1,0\n",
        "column joint",
        ["each once"],
    ),
    "millimetres": ("d,a,alpha\n0,425,0\n", "chain", ["metres"]),
    "two units": ("d_mm,a_m,alpha_deg\nm,m,deg\n0,0,0\n", "header", ["'d_mm' and 'm'"]),
    "a unit of another kind": (
        "d_deg,a_m,alpha_deg\n0,0,0\n",
        "header",
        ["'d_deg' in deg", "--lengths"],
    ),
    "a column that nobody needs": (
        "maker,d,a,alpha\nx,0,0,0\n",
        "header",
        ["'maker'", "--ignore 'maker'"],
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_names_its_line_and_column(tmp_path, fault):
    text, key, fragments = FAULTS[fault]
    with refused(table(tmp_path, text), key, *fragments):
        robot_from_dh(
            tmp_path / "arm.csv",
            options=DhOptions("deg") if fault == "no unit" else PLAIN,
        )


def test_degrees_stated_as_radians_and_files_without_a_table_are_refused(tmp_path):
    with refused(
        table(tmp_path, "theta_offset,d,a,alpha\n0,0.162,0,1.5708\n0,0,-0.4,-90\n"),
        "line 3, column alpha",
        "--angles deg",
    ):
        robot_from_dh(tmp_path / "arm.csv", options=RADIANS)
    for name, text in (("arm.yaml", "rows: 3"), ("arm.txt", "x")):
        with refused(tmp_path / name, "", ".csv"):
            robot_from_dh(table(tmp_path, text, name), options=PLAIN)


KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
ORIGINS = {
    "shoulder": (0, 0, 0.0888794492754001, 0, 0, -9.62e-06),
    "upper_arm": (0.00027933, 0, 0, 1.570338588, 0, 2.15e-05),
    "forearm": (-0.425, 1e-05, 0, 0.001, -0.002, 0.0003),
    "wrist_1": (-0.392, 0, 0.1103, 0.003, 0, -2e-05),
    "wrist_2": (0, -0.095, 0, 1.5704, 0, 2.55e-05),
    "wrist_3": (0, 0.0823, 0, 1.5705, 3.141592653, 3.1415926),
}


def pose_by_pinocchio(angles):
    """Pose of the last link of the arm of `ORIGINS`."""
    pose = pin.SE3.Identity()
    for name, angle in zip(ORIGINS, angles, strict=True):
        *shift, roll, pitch, yaw = ORIGINS[name]
        rotation = pin.rpy.rpyToMatrix(roll, pitch, yaw)
        origin = pin.SE3(rotation, np.array(shift, float))
        pose = pose * origin * screw("z", angle, 0.0)
    return pose


@pytest.mark.parametrize("order", [1, -1])
def test_a_calibrated_arm_has_the_poses_of_its_origins(tmp_path, order):
    described = {
        name: dict(zip(KEYS, ORIGINS[name], strict=True))
        for name in [*ORIGINS][::order]
    } | {"hash": "calib_7"}
    path = table(
        tmp_path,
        yaml.safe_dump({"kinematics": described}, sort_keys=False),
        "calib.yaml",
    )
    result = robot_from_dh(path, name="ur5")
    robot = parse_robot(yaml.safe_load(format_robot_file(result)))
    assert robot.joint_names == (
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_1_joint",
        "wrist_2_joint",
        "wrist_3_joint",
    )
    assert robot.chain.end_effector.name == "wrist_3" and any(
        "base_link" in note for note in result.notes
    )
    q = np.random.default_rng(0).uniform(-3, 3, (5, 6))
    position, rotation = compute_poses(robot.chain, q, robot.chain.end_effector)
    for number, angles in enumerate(q):
        expected = pose_by_pinocchio(angles)
        np.testing.assert_allclose(
            position[number], expected.translation, rtol=0, atol=1e-9
        )
        np.testing.assert_allclose(
            rotation[number], expected.rotation, rtol=0, atol=1e-9
        )
    with refused("--modified", "", "kinematics"):
        robot_from_dh(path, modified=True)


@pytest.mark.parametrize(
    ("described", "key", "fragments"),
    [
        ({"hash": "x"}, "kinematics", ["no link"]),
        ({"shoulder": {"x": 1}}, "line 2, kinematics.shoulder.y", ["found nothing"]),
        (
            {"shoulder": dict.fromkeys(KEYS, "a")},
            "line 3, kinematics.shoulder.pitch",
            ["'a'"],
        ),
        (
            dict.fromkeys(("shoulder", "forearm"), dict.fromkeys(KEYS, 0)),
            "kinematics",
            ["no link upper_arm"],
        ),
    ],
)
def test_an_invalid_kinematics_file_is_refused(tmp_path, described, key, fragments):
    path = table(tmp_path, yaml.safe_dump({"kinematics": described}), "calib.yaml")
    with refused(path, key, *fragments):
        robot_from_dh(path)


RAIL = """joint;type;theta_offset;d;a;alpha;lower;upper
;;deg;mm;mm;deg;deg;deg
track;P;0;100,5;0;-90;-500;4000
base;F;0;675;0;90;;
a1;R;10;0;350;-90;-185;185
a2;R;0;0;1150;0;;
"""


@pytest.mark.parametrize("modified", [False, True])
def test_rails_and_fixed_parts_have_the_poses_of_their_rows(tmp_path, modified):
    result = robot_from_dh(table(tmp_path, RAIL), modified=modified)
    robot = parse_robot(yaml.safe_load(format_robot_file(result)))
    assert robot.joint_names == ("track", "a1", "a2")
    assert robot.chain.prismatic == (True, False, False)
    limits = [[-0.5, 4.0], [-185.0, 185.0], [-360.0, 360.0]]
    limits = np.array(limits) * [[1.0], [math.pi / 180.0], [math.pi / 180.0]]
    np.testing.assert_allclose(robot.joint_limits, limits)
    coordinates = np.array([[1.3, 0.4, -0.7]])
    across = [
        pin.SE3(
            pin.exp3(math.radians(alpha) * np.array([1.0, 0, 0])), np.array([a, 0, 0])
        )
        for alpha, a in ((-90, 0), (90, 0), (-90, 0.35), (0, 1.15))
    ]
    about_z = [
        screw("z", 0.0, 0.1005 + 1.3),
        screw("z", 0.0, 0.675),
        screw("z", math.radians(10) + 0.4, 0.0),
        screw("z", -0.7, 0.0),
    ]
    expected = pin.SE3.Identity()
    for fixed, moving in zip(across, about_z, strict=True):
        expected = expected * (fixed * moving if modified else moving * fixed)
    position, rotation = compute_poses(
        robot.chain, coordinates, robot.chain.end_effector
    )
    np.testing.assert_allclose(position[0], expected.translation, atol=1e-9)
    np.testing.assert_allclose(rotation[0], expected.rotation, atol=1e-9)
    assert any("decimal comma" in note for note in result.notes)


def test_a_rail_keeps_its_pose_where_long_lengths_cancel(tmp_path):
    rows = "P,0,0,0,90,0,1\nR,0,300,0,0.01,-90,90\nR,0,-300,0.4,0,-90,90\n"
    header = "type,theta_offset_deg,d_m,a_m,alpha_deg,lower_deg,upper_deg\n"
    result = robot_from_dh(table(tmp_path, header + rows))
    assert any("cancel" in note for note in result.notes)
    robot = parse_robot(yaml.safe_load(format_robot_file(result)))
    tilt = pin.SE3(pin.exp3(np.array([math.radians(0.01), 0, 0])), np.zeros(3))
    expected = screw("z", 0, 0.5) * screw("x", math.pi / 2, 0) * screw("z", 0.3, 300)
    expected = expected * tilt * screw("z", -0.2, -300) * screw("x", 0, 0.4)
    position, _ = compute_poses(
        robot.chain, np.array([[0.5, 0.3, -0.2]]), robot.chain.end_effector
    )
    np.testing.assert_allclose(position[0], expected.translation, atol=1e-8)

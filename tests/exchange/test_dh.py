"""Denavit-Hartenberg tables and kinematics files to robots, beside pinocchio; every fault is one line with line and column."""

import itertools
import math

import numpy as np
import pinocchio as pin
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from support import refused
from synthetic import made_states

from elastocal.effects.conditions import conditions_of
from elastocal.exchange.dh import DhOptions, read_dh_table, robot_from_dh
from elastocal.exchange.robot_text import robot_text
from elastocal.io.documents import read_document
from elastocal.mechanics.kinematics import poses
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.mechanics.sites import sites_of

PLAIN = DhOptions("deg", "m")


def write(folder, rows, header="theta_offset,d,a,alpha,type,lower,upper"):
    path = folder / "arm.csv"
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")
    return path


def screw(letter, turn, shift):
    axis = np.eye(3)["xyz".index(letter)]
    return pin.SE3(pin.exp3(turn * axis), shift * axis)


def frames_of(rows, coordinates, modified):
    """Frame of each row."""
    found, at, values = [], pin.SE3.Identity(), iter(coordinates)
    for theta, d, a, alpha, kind, *_ in rows:
        moved = 0.0 if kind == "F" else next(values)
        about_z = screw("z", theta + (moved if kind == "R" else 0.0), d + (moved if kind == "P" else 0.0))
        about_x = screw("x", alpha, a)
        at = at * (about_x * about_z if modified else about_z * about_x)
        found.append(at)
    return found


def assert_stands_and_weighs(robot, rows, modified, places, step):
    """As rows with a mass and its centre do: `places` are those of measuring points among the rows."""
    states = made_states(robot.joints, 4, seed=1)
    own = conditions_of(sites_of(robot), robot.compliance, states).gravity[:, : robot.joints]

    def height(q):
        """Sum of mass times height, whose slope against gravity is the torque."""
        frames = frames_of(rows, q, modified)
        return sum(row[7] * frame.act(np.array(row[8:11]))[2] for row, frame in zip(rows, frames, strict=True))

    for name, place in places.items():
        position, rotation = poses(robot.chain, states.joint_angles, robot.chain.point(name))
        for number, q in enumerate(states.joint_angles):
            frame = frames_of(rows, q, modified)[place]
            np.testing.assert_allclose(position[number], frame.translation, rtol=0, atol=1e-9)
            assert np.linalg.norm(pin.log3(frame.rotation.T @ rotation[number])) < 1e-9
    for number, q in enumerate(states.joint_angles):
        slope = np.array([(height(q + each) - height(q - each)) / (2 * step) for each in step * np.eye(robot.joints)])
        np.testing.assert_allclose(own[number], -9.80665 * slope, rtol=0, atol=step)


angle, length = st.floats(-3.2, 3.2), st.floats(-0.5, 0.5)
tables = st.lists(st.tuples(angle, length, length, angle, st.sampled_from("RPF")), min_size=1, max_size=7).filter(
    lambda rows: any(row[4] != "F" for row in rows)
)


@settings(max_examples=20, deadline=None)
@given(rows=tables, modified=st.booleans())
def test_any_table_is_where_its_notation_puts_it_and_weighs_there(tmp_path_factory, rows, modified):
    header = "theta_offset,d,a,alpha,type,lower,upper,mass_kg,cx,cy,cz"
    weighed = [(*row, -1, 1, 1.5 + number, 0.1, -0.02 * number, 0.05) for number, row in enumerate(rows)]
    path = write(tmp_path_factory.mktemp("dh"), weighed, header)
    robot = robot_from_document(yaml.safe_load(robot_text(robot_from_dh(path, modified, DhOptions("rad", "m")))))
    assert_stands_and_weighs(robot, weighed, modified, {robot.chain.end_effector.name: -1}, 1e-5)


def test_the_ur_of_this_project_is_its_table(tmp_path, config_folder):
    """The UR10 of config/robots, which was typed from its maker's table."""
    lengths = read_document(config_folder / "robots" / "ur10.yaml")["lengths_m"]
    names = (("d1", None, 90), (None, "a2", 0), (None, "a3", 0), ("d4", None, 90), ("d5", None, -90), ("d6", None, 0))
    rows = [(0, lengths.get(d, 0), lengths.get(a, 0), alpha, "R", "", "") for d, a, alpha in names]
    robot = robot_from_dh(write(tmp_path, rows), options=PLAIN).robot
    known = robot_from_document(read_document(config_folder / "robots" / "ur10.yaml"))
    q = np.random.default_rng(0).uniform(-3, 3, (5, 6))
    both = (poses(each.chain, q, each.chain.end_effector) for each in (robot, known))
    for one, other in zip(*both, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


def test_limits_compliances_names_and_points_come_along(tmp_path):
    header = "joint,d,a,alpha,type,lower,upper,compliance_urad_per_Nm,point"
    path = write(tmp_path, [("rail", 0, 0, 90, "P", 0, 2, 0.02, ""), ("arm", 1, 1, 0, "R", "", "", 5, "elbow at")], header)
    result = robot_from_dh(path, options=PLAIN, name="two")
    assert result.document["joint_names"] == ["rail", "arm"] and result.document["name"] == "two"
    assert result.document["joint_limits_deg"] == [[0.0, 2.0], [-360.0, 360.0]]
    assert result.document["compliance_urad_per_Nm"] == [0.02, 5.0] and result.robot.compliance_known
    assert result.document["chain"].endswith("[elbow_at]")


# A UR5 as its controller has calibrated it; d of the second to the fourth joint cancel.
UR5_CALIBRATED = [
    (-9.62699668632896e-06, 0.0888794492754001, 0.000279332356195598, 1.57033858830411),
    (-1.43707039992005, 574.241384579456, -0.0566854832098269, -0.000733893428160216),
    (2.02543119975016, -507.363402098168, -0.32646702272051, 0.00325607356326439),
    (-0.588254688694989, -66.7676839353205, 1.49388687216263e-05, 1.57040005185553),
    (2.55e-05, 0.0950, 3.5e-05, -1.5705),
    (1.2e-05, 0.0823, 0.0, 0.0),
]
DH_HEADER = "theta_offset,d,a,alpha,type,lower,upper,mass_kg,cx,cy,cz,point"


@pytest.mark.parametrize(("lever", "modified"), [(None, False), *itertools.product([3.0, 12.0, 300.0], [False, True])])
def test_lengths_that_cancel_along_nearly_parallel_axes_become_short_ones(tmp_path, lever, modified):
    rows = [list(row) for row in UR5_CALIBRATED]
    if lever is not None:
        for number, d in enumerate((lever, -lever - 0.1, 0.2), 1):
            rows[number][1] = d
    # A centre stands where the link is, far from the frame of the row.
    centres = [(0.1, -0.2, 0.05 - sum(row[1] for row in rows[1 : number + 1])) for number in range(4)] + 2 * [(0.1, -0.2, 0.05)]
    weighed = [
        (*row, "R", -1, 1, 2.0, *centre, "wrist" if number == 4 else "")
        for number, (row, centre) in enumerate(zip(rows, centres, strict=True))
    ]
    path = write(tmp_path, weighed, DH_HEADER)
    result = robot_from_dh(path, modified, DhOptions("rad", "m"))
    robot = robot_from_document(yaml.safe_load(robot_text(result)))
    assert sum(abs(t.constant) for t in robot.chain.transforms if t.kind == "T") < 2.5
    assert any("cancel" in note for note in result.notes)
    assert_stands_and_weighs(robot, weighed, modified, {"wrist": 4, "flange": 5}, 1e-4)


JOINT_ROW = "joint,theta_offset_deg,d_m,a_m,alpha_deg,type\n"


def table(folder, text, name="arm.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_row_is_in_si_units(tmp_path):
    text = "# maker's manual\njoint; theta_offset_deg; d_mm; a_m; alpha; lower; upper; mass_kg; cx; cy; cz_m; point; type\n"
    path = table(tmp_path, text + "\nbase;90;250;-0.1;-pi/2;-1;pi;3;10;0;0.2;elbow;R\n; ;0;0;2*pi; ; ;;;;;;f\n")
    (row, fixed), _ = read_dh_table(path, DhOptions("rad", "mm"))
    assert (row.joint, row.kind, row.point, row.where) == ("base", "R", "elbow", "line 4")
    assert (row.theta, row.d, row.a, row.alpha) == pytest.approx((math.pi / 2, 0.25, -0.1, -math.pi / 2))
    assert row.limits == pytest.approx((-1.0, math.pi)) and row.mass_kg == 3.0
    assert row.centre_m == pytest.approx((0.01, 0.0, 0.2))
    assert (fixed.kind, fixed.limits, fixed.mass_kg, fixed.alpha) == ("F", None, None, pytest.approx(2 * math.pi))


FAULTS = {
    "no number": (JOINT_ROW + "1,0,0.1,0,90,R\n2,0,x,0,90,R\n", "line 3, d_m", ["'x'"]),
    "pi in degrees": (JOINT_ROW + "1,0,0.1,0,pi/2,R\n", "line 2, alpha_deg", ["'pi/2'"]),
    "not finite": (JOINT_ROW + "1,0,inf,0,90,R\n", "line 2, d_m", ["'inf'"]),
    "nothing": (JOINT_ROW + "1,0,,0,90,R\n", "line 2, d_m", ["nothing"]),
    "a type": (JOINT_ROW + "1,0,0,0,90,spherical\n", "line 2, type", ["'spherical'", "revolute"]),
    "too few cells": (JOINT_ROW + "1,0,0,0,90\n", "line 2", ["5 cells", "6"]),
    "no column": ("d_m,a_m\n0,0\n", "header", ["no column alpha"]),
    "unknown column": ("d_m,a_m,alfa_deg\n0,0,0\n", "header", ["'alfa_deg'", "'alpha_deg'?"]),
    "a column in two units": ("d_m,d_mm,a,alpha\n0,0,0,0\n", "header", ["d twice"]),
    "one limit": ("d,a,alpha,lower,upper\n0,0,0,1,\n", "line 2, lower and upper", ["both"]),
    "limits the wrong way": ("d,a,alpha,lower,upper\n0,0,0,9,-9\n", "line 2, lower and upper", ["9 to -9"]),
    "a mass without a centre": ("d,a,alpha,mass_kg\n0,0,0,9\n", "line 2, cx, cy, cz", ["three numbers"]),
    "a centre without a mass": ("d,a,alpha,cx\n0,0,0,9\n", "line 2, mass_kg", ["the mass"]),
    "a mass of nothing": ("d,a,alpha,mass_kg,cx,cy,cz\n0,0,0,0,0,0,0\n", "line 2, mass_kg", ["more than 0"]),
    "underscores": (JOINT_ROW + "1,0,0.1,0,9_0,R\n", "line 2, alpha_deg", ["'9_0'"]),
    "more turns than a joint counts": (JOINT_ROW + "1,0,0.1,0,1e9,R\n", "line 2, alpha_deg", ["'1e9'", "1000 turns at most"]),
    "an endless cell": (JOINT_ROW + f"1,0,{'1' * 200_000},0,90,R\n", "line 2", ["field limit"]),
    "more rows than a chain has room for": ("d,a,alpha\n" + "0,0,90\n" * 501, "", ["501 rows", "at most 500"]),
    "compliances of some": ("d,a,alpha,compliance_urad_per_Nm\n0,1,0,2\n0,1,0,\n", "line 3, compliance_urad_per_Nm", ["every"]),
    "a shift without limits": ("d,a,alpha,type\n0,1,0,P\n", "line 2, lower and upper", ["prismatic"]),
    "a joint's name twice": ("joint,d,a,alpha\na,0,1,0\na,0,1,0\n", "line 2, joint", ["each once"]),
    "a point twice": ("d,a,alpha,point\n0,1,0,p\n0,1,0,p\n", "chain", ["[p] twice"]),
    "millimetres": ("d,a,alpha\n0,425,0\n", "chain", ["metres"]),
    "two units": ("d_mm,a_m,alpha_deg\nm,m,deg\n0,0,0\n", "header", ["'d_mm' and 'm'"]),
    "a unit of angles": ("d_deg,a_m,alpha_deg\n0,0,0\n", "header", ["'d_deg' in deg"]),
    "a column that nobody needs": ("maker,d,a,alpha\nx,0,0,0\n", "header", ["'maker'", "--ignore 'maker'"]),
    "no joint": ("d,a,alpha,type\n0,0,0,F\n", "", ["no joint"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_names_its_line_and_column(tmp_path, fault):
    text, key, words = FAULTS[fault]
    path = table(tmp_path, text)
    with refused(path, key, *words):
        robot_from_dh(path, options=PLAIN)


def test_commas_are_decimal_marks_where_they_can_be_nothing_else_or_an_option_says_so(tmp_path):
    path = table(tmp_path, "theta_offset_deg;d_mm;a_mm;alpha_deg\n0;162,5;0;90\n-1,5;0;-1425,25;0\n")
    (first, second), _ = read_dh_table(path, PLAIN)
    assert read_dh_table(table(tmp_path, "d;a;alpha_deg\n1,250;1,500;90,125\n"), PLAIN)[0][0].d == pytest.approx(1.25)
    text = "theta_offset_deg;d_m;a_m;alpha_deg\n0;1,250;0;90\n"
    with refused(table(tmp_path, text), "line 2", "'1,250'", "--decimal comma"):
        read_dh_table(path, PLAIN)
    assert read_dh_table(path, DhOptions(decimal="comma"))[0][0].d == 1.25
    assert (first.d, second.a, second.theta) == pytest.approx((0.1625, -1.42525, math.radians(-1.5)))
    for cell in ("1,425", "1.425,5", "1 425"):
        with refused(table(tmp_path, f"d;a;alpha\n{cell};0;90\n"), "line 2", repr(cell)):
            read_dh_table(path, PLAIN)


@pytest.mark.parametrize(("name", "text"), [("arm.yaml", "rows: 3"), ("arm.txt", "x"), ("arm.yaml", "- {d_m: 1}")])
def test_what_is_no_table_is_refused(tmp_path, name, text):
    with refused(tmp_path / name, "", ".csv"):
        robot_from_dh(table(tmp_path, text, name), options=PLAIN)


ROW = "0,0.1,0.2,90"


@pytest.mark.parametrize(
    ("text", "name", "option"),
    [
        ("theta_offset,d_m,a_m,alpha_deg\n", "theta_offset", "--angles"),
        ("theta_offset_deg,d_m,a,alpha_deg\n", "a", "--lengths"),
        ("theta_offset [deg],d [m],a [m],alpha\n", "alpha", "--angles"),
        ("theta_offset,d,a,alpha\ndeg,m,,deg\n", "a", "--lengths"),
        ("d_m,a_m,alpha_deg,type,lower_deg,upper_deg\n0,0,0,P,0,2\n", "line 2, lower_deg", "--lengths"),
    ],
)
def test_a_unit_that_nothing_states_is_asked_for(tmp_path, text, name, option):
    where = (name, "") if name[:4] == "line" else ("header", f"no unit of {name!r}")
    with refused(tmp_path / "arm.csv", *where, option):
        read_dh_table(table(tmp_path, text if name[:4] == "line" else f"{text}{ROW}\n"))


@pytest.mark.parametrize(
    "head",
    [
        "theta_offset_rad,d_mm,a_mm,alpha_rad",
        "theta_offset [rad],d [mm],a (mm),alpha(rad)",
        "theta_offset,d,a,alpha\nrad,mm,mm,rad",
        "theta_offset,d,a,alpha\n[rad],[mm],[mm],(rad)",
        "theta_offset_rad,d,a_mm,alpha\nrad,mm,mm,rad",
    ],
)
def test_units_stand_behind_names_in_brackets_or_in_a_row_of_their_own(tmp_path, head):
    (row,), notes = read_dh_table(table(tmp_path, f"{head}\n{ROW.replace('90', '1.5')}\n"))
    assert (row.d, row.a, row.alpha) == pytest.approx((1e-4, 2e-4, 1.5))
    assert "d in mm" in notes[0] and "alpha in rad" in notes[0]


def test_columns_that_nobody_needs_are_left_out_where_that_is_stated(tmp_path):
    path = table(tmp_path, "maker;d_m;a_m;alpha_deg;dynamics\nx;0.1;0;90;a,b\n")
    (row,), notes = read_dh_table(path, DhOptions(ignore=("maker", "dynamics")))
    assert row.d == 0.1 and "not used: maker, dynamics" in notes
    with refused(path, "", "'serial'"):
        read_dh_table(path, DhOptions(ignore=("serial",)))


PARTS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
ORIGINS = {
    "shoulder": (0, 0, 0.0888794492754001, 0, 0, -9.62e-06),
    "upper_arm": (0.00027933, 0, 0, 1.570338588, 0, 2.15e-05),
    "forearm": (-0.425, 1e-05, 0, 0.001, -0.002, 0.0003),
    "wrist_1": (-0.392, 0, 0.1103, 0.003, 0, -2e-05),
    "wrist_2": (0, -0.095, 0, 1.5704, 0, 2.55e-05),
    "wrist_3": (0, 0.0823, 0, 1.5705, 3.141592653, 3.1415926),
}


def kinematics(folder, links, **beside):
    path = folder / "calib.yaml"
    described = {name: dict(zip(KEYS, origin, strict=True)) for name, origin in links.items()}
    path.write_text(yaml.safe_dump({"kinematics": described | beside}, sort_keys=False))
    return path


@pytest.mark.parametrize("order", [1, -1])
def test_a_calibrated_arm_is_where_its_origins_put_it(tmp_path, order):
    path = kinematics(tmp_path, {name: ORIGINS[name] for name in PARTS[::order]}, hash="calib_7")
    result = robot_from_dh(path, name="ur5")
    robot = robot_from_document(yaml.safe_load(robot_text(result)))
    wrist = "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"
    assert robot.joint_names == ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", *wrist)
    assert robot.chain.end_effector.name == "wrist_3" and any("base_link" in note for note in result.notes)
    q = np.random.default_rng(0).uniform(-3, 3, (5, 6))
    position, rotation = poses(robot.chain, q, robot.chain.end_effector)
    for number, angles in enumerate(q):
        at = pin.SE3.Identity()
        for name, angle in zip(PARTS, angles, strict=True):
            *shift, roll, pitch, yaw = ORIGINS[name]
            at = at * pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array(shift, float))
            at = at * screw("z", angle, 0.0)
        np.testing.assert_allclose(position[number], at.translation, rtol=0, atol=1e-9)
        np.testing.assert_allclose(rotation[number], at.rotation, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("document", "key", "words"),
    [
        ({"kinematics": 3}, "kinematics", ["int", "roll"]),
        ({"kinematics": {}}, "kinematics", ["no link"]),
        ({"kinematics": {"hash": "x"}}, "kinematics", ["no link"]),
        ({"kinematics": {"shoulder": {"x": 1}}}, "kinematics.shoulder", ["found x;", "roll"]),
        ({"kinematics": {"shoulder": [1, 2]}}, "kinematics.shoulder", ["list"]),
        ({"kinematics": {"shoulder": dict.fromkeys(KEYS, "a")}}, "kinematics.shoulder.x", ["'a'"]),
        ({"kinematics": dict.fromkeys(("shoulder", "forearm"), dict.fromkeys(KEYS, 0))}, "kinematics", ["no link upper_arm"]),
    ],
)
def test_what_is_no_kinematics_is_refused(tmp_path, document, key, words):
    (tmp_path / "calib.yaml").write_text(yaml.safe_dump(document))
    with refused(tmp_path / "calib.yaml", key, *words):
        robot_from_dh(tmp_path / "calib.yaml")


def test_no_notation_of_tables_goes_with_it(tmp_path):
    with refused("--modified", "", "kinematics"):
        robot_from_dh(kinematics(tmp_path, ORIGINS), modified=True)


def test_degrees_where_radians_are_stated_are_refused_with_the_way_to_say_so(tmp_path):
    (tmp_path / "arm.csv").write_text("theta_offset,d,a,alpha\n0,0.162,0,1.5708\n0,0,-0.4,-90\n", encoding="utf-8")
    with refused(tmp_path / "arm.csv", "line 3, alpha", "'-90'", "--angles deg"):
        robot_from_dh(tmp_path / "arm.csv", options=DhOptions("rad", "m"))

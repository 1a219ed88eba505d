"""Denavit-Hartenberg tables to robots, beside products of pinocchio's transforms."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support import refused
from synthetic import made_states

from elastocal.effects.conditions import conditions_of
from elastocal.exchange.dh import _slid_words, robot_from_dh
from elastocal.exchange.dh_table import DhOptions
from elastocal.exchange.robot_text import robot_text
from elastocal.io.documents import read_document
from elastocal.mechanics.chain import parse_chain
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


@pytest.mark.parametrize(
    ("header", "rows", "key", "words"),
    [
        ("d,a,alpha,compliance_urad_per_Nm", [(0, 1, 0, 2), (0, 1, 0, "")], "line 3, compliance_urad_per_Nm", ["every joint"]),
        ("d,a,alpha,type", [(0, 1, 0, "P")], "line 2, lower and upper", ["prismatic"]),
        ("joint,d,a,alpha", [("a", 0, 1, 0), ("a", 0, 1, 0)], "line 2, joint", ["each once"]),
        ("d,a,alpha,point", [(0, 1, 0, "p"), (0, 1, 0, "p")], "chain", ["[p] twice"]),
        ("d,a,alpha", [(0, 425, 0)], "chain", ["metres"]),
    ],
)
def test_what_makes_no_robot_is_refused(tmp_path, header, rows, key, words):
    path = write(tmp_path, rows, header)
    with refused(path, key, *words):
        robot_from_dh(path, options=PLAIN)


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


def homogeneous(rotation, shift):
    return pin.SE3(rotation, np.array(shift, float)).homogeneous


@given(seed=st.integers(0, 10**6), kinds=st.text("RP", min_size=1, max_size=5))
def test_poses_of_all_points_are_those_of_the_pieces(seed, kinds):
    rng = np.random.default_rng(seed)

    def piece(name):
        return homogeneous(Rotation.random(random_state=rng).as_matrix(), rng.uniform(-3, 3, 3)), name

    gaps = [[piece(""), piece("base"), piece("")], *([piece(f"p{number}"), piece("")] for number in range(len(kinds)))]
    gaps[-1].append(piece("end"))
    words, slides = _slid_words(gaps, kinds)
    assert slides.shape == (len(kinds) + 1,) and slides[0] == 0.0
    chain = parse_chain(" ".join(words), {}, "test")
    q = rng.uniform(-2, 2, len(kinds))
    at = np.eye(4)
    for number, gap in enumerate(gaps):
        if number:
            turns = kinds[number - 1] == "R"
            at = at @ screw("z", q[number - 1] * turns, q[number - 1] * (not turns)).homogeneous
        for transform, name in gap:
            at = at @ transform
            if name:
                position, rotation = poses(chain, q[None], chain.point(name))
                np.testing.assert_allclose(position[0], at[:3, 3], rtol=0, atol=1e-9)
                np.testing.assert_allclose(rotation[0], at[:3, :3], rtol=0, atol=1e-9)

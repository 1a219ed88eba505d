"""The user's own URDF with joint origins changed and nothing else, as pinocchio has it."""

from xml.etree import ElementTree as Xml

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_calibrated import made_calibrated
from made_urdf import assert_same_poses, joint, link, segments, written
from support import refused

from elastocal.application.exported import fold_effects
from elastocal.effects.catalogue import candidates_on
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.exchange.urdf_writing import write_calibrated_origins
from elastocal.mechanics.sites import sites_of

MESH = '<geometry><mesh filename="part.stl" scale="0.5 0.5 0.5"/></geometry>'
BOX = '<geometry><box size="0.1 0.1 0.1"/></geometry>'
LINK = """  <link name="{name}">
    <inertial><origin xyz="0.01 0.02 {z}" rpy="0.1 0 0"/><mass value="{mass}"/>
      <inertia ixx="0.11" ixy="0.01" ixz="0.002" iyy="0.12" iyz="-0.003" izz="0.09"/></inertial>
    <visual><origin xyz="0 0 0.05" rpy="0 0 0.1"/>{geometry}<material name="red"/></visual>
    <collision>{geometry}</collision>
  </link>
"""
# Each: name, type, parent, child, how its origin is written, axis.
JOINTS = (
    ("rail", "prismatic", "world_mount", "carriage", '<origin xyz="0 0 0.2" rpy="0 0 0"/>', "0 1 0"),
    ("a1", "revolute", "carriage", "l1", "<origin rpy='0 0 0.3'\n      xyz='0.1 0 0.4'></origin>", "0 0 1"),
    ("a2", "revolute", "l1", "l2", '<origin xyz="0.1 0.02 0.2" rpy="1.5707963267948966 0 0"/>', "0 0 -1"),
    ("a3", "revolute", "l2", "l3", '<origin xyz="0.5 0 0"/>', "0.6 0 0.8"),
    ("a4", "continuous", "l3", "l4", "", "1 0 0"),
    ("a5", "revolute", "l4", "l5", '<origin rpy="0 0.4 0"/>', "0 1 0"),
    ("bolts", "fixed", "l5", "l5b", '<origin xyz="0.15 0 0" rpy="0.2 0 0"/>', ""),
    ("a6", "revolute", "l5b", "l6", '<origin xyz="0.2 0 0.01" rpy="0 0 0"/>', "1 0 0"),
    ("a7", "revolute", "l6", "l7", '<origin xyz="0.1 0 0.05" rpy="0 0 0"/>', "0 0 1"),
    ("flange-tool0", "fixed", "l7", "tool0", '<origin xyz="0.1 0 0" rpy="0 1.5707963267948966 0"/>', ""),
    ("grip", "prismatic", "l7", "finger", '<origin xyz="0.1 0.03 0" rpy="0 0 0"/>', "0 1 0"),
    ("grip2", "prismatic", "l7", "finger2", '<origin xyz="0.1 -0.03 0" rpy="0 0 0"/>', "0 -1 0"),
)
KEYS = (*(f"joint_offset@{joint}" for joint in range(1, 9)), *(f"link_geometry@{joint}" for joint in range(1, 9)))


def text():
    """With what people have in their files: comments, meshes, other programs' elements, attributes in any form."""
    parts = ['<?xml version="1.0" encoding="utf-8"?>\n<!-- Zelle 7, geprüft -->\n<robot name="my cell">\n']
    parts.append('  <material name="red"><color rgba="1 0 0 1"/></material>\n  <link name="world_mount"/>\n')
    for number, described in enumerate(JOINTS):
        if described[3] == "tool0":
            parts.append('  <link name="tool0"/>\n')
        else:
            parts.append(
                LINK.format(name=described[3], z=0.01 * number, mass=1.0 + number, geometry=MESH if number % 2 else BOX)
            )
    for name, kind, parent, child, origin, axis in JOINTS:
        parts.append(f'  <joint type="{kind}"\n     name="{name}"><!-- <origin xyz="9 9 9"/> -->\n    {origin}\n')
        parts.append(f'    <parent link="{parent}"/><child link="{child}"/>\n')
        parts.append(f'    <axis xyz="{axis}"/>\n' if axis else "")
        if kind in ("revolute", "prismatic"):
            parts.append('    <limit lower="-1.25" upper="2.5" effort="321" velocity="3.5"/><dynamics damping="0.7"/>\n')
        parts.append('    <mimic joint="grip" multiplier="1" offset="0"/>\n' if name == "grip2" else "")
        parts.append("  </joint>\n")
    parts.append('  <transmission name="t"><joint name="a1"><origin xyz="5 5 5"/></joint></transmission>\n')
    parts.append('  <gazebo reference="l1"><selfCollide>true</selfCollide></gazebo>\n</robot>\n')
    return "".join(parts)


@pytest.fixture
def cell(tmp_path):
    """The user's file, the robot of it, and that robot calibrated."""
    path = tmp_path / "cell.urdf"
    path.write_bytes(text().replace("\n", "\r\n").encode())
    robot = robot_from_urdf(path, "world_mount", "tool0").robot
    return path, robot, fold_effects(made_calibrated(robot, *KEYS, identified=False, seed=4)).robot


def export_arm(cell):
    path, robot, calibrated = cell
    found = write_calibrated_origins(path, robot, calibrated)
    output = path.with_name("robot.urdf")
    output.write_bytes(found.content)
    return output, found


def test_all_but_joint_origins_is_as_it_was(cell):
    output, found = export_arm(cell)
    assert found.changed == 9 and (found.base, found.tip) == ("world_mount", "tool0")
    assert_same_poses(cell[2], output, "world_mount", "tool0")

    def elements(path):
        root = Xml.fromstring(path.read_bytes(), Xml.XMLParser(target=Xml.TreeBuilder(insert_comments=True)))
        origins = {joint.find("origin") for joint in root.findall("joint")}
        return [
            (str(each.tag)[:9], dict(each.attrib), (each.text or "").strip()) for each in root.iter() if each not in origins
        ]

    assert elements(output) == elements(cell[0])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('xyz="0.5 0 0"', 'xyz="0.5004 0 0"', "as the robot file has it"),
        ('name="a6"', 'name="axis_6"', "no chain to 'tool0'"),
        ('"tool0"', '"tcp"', "no link 'tool0'"),
        ('xyz="0.6 0 0.8"', 'xyz="-0.6 0 -0.8"', "as the robot file has it"),
    ],
)
def test_another_robots_file_is_refused(cell, old, new, words):
    path, robot, calibrated = cell
    other = path.with_name("other.urdf")
    other.write_text(text().replace(old, new), encoding="utf-8")
    with refused(other, words, "imported"):
        write_calibrated_origins(other, robot, calibrated)


@settings(max_examples=10, deadline=None)
@given(parts=segments, seed=st.integers(0, 1000))
def test_any_chain_moves_as_its_calibrated_robot(tmp_path_factory, parts, seed):
    described = [link("l0")]
    for number, (kind, xyz, rpy, axis, *_) in enumerate(parts, 1):
        described += [link(f"l{number}"), joint(f"j{number}", f"l{number - 1}", f"l{number}", kind, xyz, rpy, axis, (-1, 1))]
    described += [link("tip"), joint("end", f"l{len(parts)}", "tip", "fixed", (0.1, 0, 0.2))]
    path = written(tmp_path_factory.mktemp("urdf"), *described)
    robot = robot_from_urdf(path, "l0", "tip").robot
    places = range(1, robot.joints + 1)
    keys = [*(f"joint_offset@{place}" for place in places), *(f"link_geometry@{place}" for place in places)]
    known = candidates_on(sites_of(robot))
    made = made_calibrated(robot, *(key for key in keys if key in known), identified=False, seed=seed)
    calibrated = fold_effects(made).robot
    assert_same_poses(calibrated, export_arm((path, robot, calibrated))[0], "l0", "tip", count=3, within=1e-8)

"""Calibrated joint origins in the user's own URDF, against pinocchio."""

from dataclasses import replace
from xml.etree import ElementTree as Xml

import numpy as np
import pinocchio as pin
import pytest
from analysed_robots import analysed
from hypothesis import given, settings
from hypothesis import strategies as st
from made_calibrated import make_calibrated_robot
from made_urdf import (
    Pinocchio,
    assert_same_poses,
    joint,
    link,
    segments,
    write_linkage,
    written,
)
from support import refused

from elastocal.application.exported import fold_effects
from elastocal.effects.catalogue import candidates_on
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.exchange.urdf_writing import build_urdf, write_calibrated_origins
from elastocal.mechanics.kinematics import compute_poses
from elastocal.mechanics.sites import build_sites

# With what people have in their files: comments, meshes, other programs' elements, a
# mimic, an origin that is not written.
MESH = '<visual><geometry><mesh filename="part.stl" scale="0.5 0.5 0.5"/></geometry></visual>'
PARTS = (
    '<material name="red"><color rgba="1 0 0 1"/></material>',
    *map(link, ("base", "arm", "plate", "hand", "tool0", "finger")),
    link("mount", 2.0).replace("</link>", f"{MESH}</link><!-- geprüft -->"),
    joint(
        "rail", "base", "mount", "prismatic", xyz=(0, 0, 0.2), axis=(0, 1, 0)
    ).replace("<origin", "<dynamics damping='1'/><origin"),
    joint("a1", "mount", "arm", axis=(0.6, 0, 0.8)).replace(
        '<origin xyz="0.0 0.0 0.0" rpy="0.0 0.0 0.0"/>', "\n"
    ),
    joint("bolts", "arm", "plate", "fixed", xyz=(0.5, 0, 0), rpy=(0.2, 0, 0)),
    joint(
        "a2",
        "plate",
        "hand",
        "continuous",
        xyz=(0.4, 0.02, 0),
        rpy=(1.5708, 0, 0),
        axis=(0, 0, -1),
    ),
    joint("flange", "hand", "tool0", "fixed", xyz=(0.1, 0, 0)),
    joint("grip", "hand", "finger", "prismatic", mimic=("a2", 1.0, 0.0)),
    '<transmission name="t"><joint name="a1"><origin xyz="5 5 5"/></joint></transmission>',
)


def calibrated_of(robot, seed=4):
    joints = range(1, robot.joints + 1)
    candidates = candidates_on(build_sites(robot))
    keys = [
        *(f"joint_offset@{joint}" for joint in joints),
        *(f"link_geometry@{joint}" for joint in joints),
    ]
    made = make_calibrated_robot(
        robot, *(key for key in keys if key in candidates), identified=False, seed=seed
    )
    return fold_effects(made).robot


def export_arm(path, robot, calibrated):
    corrected = write_calibrated_origins(path, robot, calibrated)
    output = path.with_name("robot.urdf")
    output.write_bytes(corrected.content)
    return output, corrected


@pytest.fixture
def cell(tmp_path):
    """The user's file, the robot of it, and that robot calibrated."""
    path = written(tmp_path, *PARTS, name="my cell")
    robot = robot_from_urdf(path, "base", "tool0").robot
    return path, robot, calibrated_of(robot)


def test_only_joint_origins_change(cell):
    output, corrected = export_arm(*cell)
    assert corrected.changed == 4 and (corrected.base, corrected.tip) == (
        "base",
        "tool0",
    )
    assert_same_poses(cell[2], output, "base", "tool0")

    def elements(path):
        root = Xml.fromstring(
            path.read_bytes(),
            Xml.XMLParser(target=Xml.TreeBuilder(insert_comments=True)),
        )
        origins = {joint.find("origin") for joint in root.findall("joint")}
        return [
            (str(element.tag)[:9], element.attrib, (element.text or "").strip())
            for element in root.iter()
            if element not in origins
        ]

    assert elements(output) == elements(cell[0])


@pytest.mark.parametrize(
    ("old", "new", "fragments"),
    [
        ('xyz="0.5 0.0 0.0"', 'xyz="0.5004 0 0"', "as the robot file has it"),
        ('name="a2"', 'name="axis_2"', "no chain to 'tool0' by rail, a1, a2"),
        ('"tool0"', '"tcp"', "no link 'tool0'"),
        ('xyz="0.6 0.0 0.8"', 'xyz="-0.6 0 -0.8"', "as the robot file has it"),
    ],
)
def test_the_file_of_another_robot_is_refused(cell, old, new, fragments):
    path, robot, calibrated = cell
    other_path = path.with_name("other.urdf")
    other_path.write_text(
        path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8"
    )
    with refused(other_path, fragments, "imported"):
        write_calibrated_origins(other_path, robot, calibrated)


def test_a_joint_that_follows_still_does_in_the_calibrated_file(tmp_path):
    path = write_linkage(tmp_path)
    robot = robot_from_urdf(path, "base", "tool").robot
    calibrated = calibrated_of(robot)
    output, _ = export_arm(path, robot, calibrated)
    mimic = '<mimic joint="j2" multiplier="-1.0" offset="0.1"'
    assert mimic in output.read_text("utf-8")
    assert_same_poses(calibrated, output, "base", "tool", mimic=True)


def test_a_new_urdf_lets_a_joint_follow(tmp_path):
    nominal = robot_from_urdf(write_linkage(tmp_path), "base", "tool").robot
    calibrated = calibrated_of(nominal)
    path = tmp_path / "new.urdf"
    path.write_text(build_urdf(nominal, calibrated), "utf-8")
    assert '<mimic joint="j2"' in path.read_text("utf-8")
    by_pinocchio = Pinocchio(path, mimic=True)
    commands = np.random.default_rng(2).uniform(-1.0, 1.0, (5, nominal.commands))
    expected, _ = compute_poses(
        calibrated.chain,
        calibrated.model_angles(commands),
        calibrated.chain.end_effector,
    )
    for command, position in zip(commands, expected, strict=True):
        values = dict(zip(nominal.command_names, command, strict=True))
        reached, _ = by_pinocchio.pose("base_link", "tool", values)
        np.testing.assert_allclose(reached, position, atol=1e-9)


@settings(max_examples=10, deadline=None)
@given(parts=segments, seed=st.integers(0, 1000))
def test_any_chain_moves_as_its_calibrated_robot(tmp_path_factory, parts, seed):
    described = [link("l0")]
    for number, (kind, xyz, rpy, axis, *_) in enumerate(parts, 1):
        described += [
            link(f"l{number}"),
            joint(
                f"j{number}",
                f"l{number - 1}",
                f"l{number}",
                kind,
                xyz,
                rpy,
                axis,
                (-1, 1),
            ),
        ]
    described += [
        link("tip"),
        joint("end", f"l{len(parts)}", "tip", "fixed", (0.1, 0, 0.2)),
    ]
    path = written(tmp_path_factory.mktemp("urdf"), *described)
    robot = robot_from_urdf(path, "l0", "tip").robot
    calibrated = calibrated_of(robot, seed)
    assert_same_poses(
        calibrated,
        export_arm(path, robot, calibrated)[0],
        "l0",
        "tip",
        count=3,
        within=1e-8,
    )


@pytest.mark.parametrize("name", ["kuka", "gen3", "motoman_right_arm"])
def test_a_new_urdf_has_the_poses_of_the_calibrated_robot(name, tmp_path):
    """Read by this package, and by pinocchio, which shares no code with it."""
    nominal = analysed(name)
    offset = np.linspace(1e-3, 5e-3, nominal.joints)
    calibrated = replace(nominal, reported_offset=nominal.reported_offset + offset)
    path = tmp_path / "arm.urdf"
    path.write_text(build_urdf(nominal, calibrated), "utf-8")
    tip = calibrated.chain.end_effector.name
    stream = np.random.default_rng(1)
    reported = stream.uniform(-1.0, 1.0, (5, nominal.joints))
    values = nominal.model_angles(reported)
    expected, _ = compute_poses(
        calibrated.chain,
        calibrated.model_angles(reported),
        calibrated.chain.end_effector,
    )
    read = robot_from_urdf(path, "base_link", tip).robot
    position, _ = compute_poses(read.chain, values, read.chain.end_effector)
    np.testing.assert_allclose(position, expected, atol=1e-9)
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    for row, place in zip(values, expected, strict=True):
        pin.framesForwardKinematics(model, data, row)
        reached = data.oMf[model.getFrameId(tip)].translation
        np.testing.assert_allclose(reached, place, atol=1e-9)
    assert sum(m.mass_kg for m in read.masses) == pytest.approx(
        sum(m.mass_kg for m in nominal.masses)
    )

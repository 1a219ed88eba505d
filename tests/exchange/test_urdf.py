"""URDF to robot file and back into poses and torques, beside pinocchio."""

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from made_urdf import Pinocchio, assert_same_poses, joint, link, segments, written
from support import refused
from synthetic import made_states

from elastocal.effects.conditions import conditions_of
from elastocal.exchange.robot_text import robot_text
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.io.documents import check_document
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.mechanics.sites import sites_of

ARM = (
    link("base", 5.0, (0.0, 0.1, 0.2)),
    link("upper", 4.0, (0.1, 0.02, 0.3), (0.3, 0.2, 0.1)),
    link("bracket", 1.5, (0.0, -0.1, 0.05)),
    link("fore", 3.0, (0.2, 0.0, -0.05)),
    link("slide", 2.0, (0.05, 0.0, 0.0)),
    link("hand", 1.0, (0.0, 0.03, 0.04)),
    link("flange"),
    link("finger", 0.2, (0.0, 0.0, 0.06)),
    joint("shoulder", "base", "upper", xyz=(0.1, -0.2, 0.4), rpy=(0.3, -0.4, 1.2), axis=(0, 1, 0), limits=(-1.5, 2.0)),
    joint("bolted", "upper", "bracket", "fixed", xyz=(0.0, 0.1, 0.2), rpy=(np.pi / 2, 0, 0)),
    joint("elbow", "bracket", "fore", "continuous", xyz=(0.5, 0, 0), rpy=(0, np.pi / 2, 0.7), axis=(1.0, -2.0, 0.5)),
    joint("rail", "fore", "slide", "prismatic", xyz=(0.3, 0.01, 0), axis=(0.6, 0, 0.8), limits=(-0.1, 0.25)),
    joint("wrist", "slide", "hand", xyz=(0, 0, 0.1), rpy=(-0.2, 0, 0), axis=(-1, 0, 0)),
    joint("plate", "hand", "flange", "fixed", xyz=(0, 0, 0.08), rpy=(0, 0, 3.0)),
    joint("grip", "hand", "finger", "prismatic", xyz=(0.0, 0.02, 0.1), axis=(0, 1, 0)),
)


def through_its_file(result):
    """The robot of the text that is written, not of the document in memory."""
    document = yaml.safe_load(robot_text(result))
    check_document(document, "robot", "robot.yaml")
    return robot_from_document(document)


def assert_same_weight(robot, path, within=None):
    states, by_pinocchio = made_states(robot.joints, 6, seed=3), Pinocchio(path)
    own = conditions_of(sites_of(robot), robot.compliance, states).gravity[:, : robot.joints]
    for angles, torque in zip(states.joint_angles, own, strict=True):
        expected = by_pinocchio.weight(dict(zip(robot.joint_names, angles, strict=True)), robot.joint_names)
        np.testing.assert_allclose(torque, expected, rtol=0, atol=within or 1e-6 * max(1.0, np.abs(expected).max()))
    return np.abs(own).max()


def test_oblique_axes_turned_origins_and_shifts_are_where_pinocchio_has_them(tmp_path):
    path = written(tmp_path, *ARM)
    robot = through_its_file(robot_from_urdf(path, "base", "flange"))
    assert robot.joint_names == ("shoulder", "elbow", "rail", "wrist")
    assert robot.chain.prismatic == (False, False, True, False)
    assert_same_poses(robot, path, "base", "flange")
    assert assert_same_weight(robot, path) > 1.0


def test_a_part_of_the_tree_stands_and_weighs_as_in_the_whole(tmp_path):
    path = written(tmp_path, *ARM)
    robot = through_its_file(robot_from_urdf(path, "upper", "hand"))
    assert robot.joint_names == ("elbow", "rail", "wrist")
    assert_same_poses(robot, path, "upper", "hand")
    assert assert_same_weight(robot, path) > 1.0
    assert {mass.link for mass in robot.masses} == {0, 1, 2, 3}


@pytest.mark.parametrize("limits", [None, (-1e16, 1e16)])
def test_no_limits_and_those_that_stand_for_none_are_a_turn_either_way(tmp_path, limits):
    free = written(tmp_path, link("a"), link("b"), joint("j", "a", "b", xyz=(0, 0, 1), limits=limits))
    result = robot_from_urdf(free, "a", "b")
    assert result.document["joint_limits_deg"] == [[-360.0, 360.0]]
    assert any("'j' has no limits" in note for note in result.notes)


@pytest.mark.parametrize("limits", [(-170, 170), (0, 20), (-125, 10)])
def test_limits_that_look_like_degrees_are_asked_for(tmp_path, limits):
    path = written(
        tmp_path, *map(link, "abc"), joint("j", "a", "b", xyz=(0, 0, 1), limits=limits), joint("rail", "b", "c", "prismatic")
    )
    with refused(path, "joint 'j': limit", "turns", "--limits deg", "--limits rad"):
        robot_from_urdf(path, "a", "c")
    degrees = robot_from_urdf(path, "a", "c", limits_in="deg")
    assert degrees.document["joint_limits_deg"] == [[float(each) for each in limits], [-2.0, 2.0]]
    assert any("degrees" in note for note in degrees.notes)
    radians = robot_from_urdf(path, "a", "c", limits_in="rad")
    np.testing.assert_allclose(radians.robot.joint_limits[0], limits)


def test_a_shift_without_limits_is_refused(tmp_path):
    path = written(tmp_path, link("a"), link("b"), joint("j", "a", "b", "prismatic", limits=None))
    with refused(path, "joint 'j': limit", "metres"):
        robot_from_urdf(path, "a", "b")


def test_what_a_urdf_does_not_say_is_not_made_up(tmp_path):
    result = robot_from_urdf(written(tmp_path, *ARM), "base", "flange", relative_std=0.3)
    assert "compliance_urad_per_Nm" not in result.document and not result.robot.compliance_known
    assert {mass.relative_std for mass in result.robot.masses} == {0.3}
    assert any("no compliances" in note for note in result.notes)
    assert any("30 %, by assumption" in note for note in result.notes)


@settings(max_examples=20, deadline=None)
@given(parts=segments)
def test_any_chain_is_where_pinocchio_has_it_and_weighs_as_much(tmp_path_factory, parts):
    """Each link also carries a bolted part at its side."""
    described = [link("l0", 1.0)]
    for number, (kind, xyz, rpy, axis, mass, centre, beside) in enumerate(parts, 1):
        described += [link(f"l{number}", mass, centre), link(f"s{number}", 1.5 * mass, centre)]
        described.append(joint(f"j{number}", f"l{number - 1}", f"l{number}", kind, xyz, rpy, axis, (-1, 1)))
        described.append(joint(f"b{number}", f"l{number}", f"s{number}", "fixed", beside, (0.4, 0.0, 0.2)))
    path = written(tmp_path_factory.mktemp("urdf"), *described)
    tip = f"l{len(parts)}"
    robot = through_its_file(robot_from_urdf(path, "l0", tip))
    assert_same_poses(robot, path, "l0", tip, count=4)
    assert_same_weight(robot, path, 1e-5)


@pytest.mark.parametrize("multiplier, offset", [(1.0, 0.0), (-1.0, 0.0), (-1.0, 0.3), (1.0, -1.1)])
@pytest.mark.parametrize("kind, axis", [("revolute", (0, -1, 0)), ("prismatic", (0, 0, 1)), ("revolute", (1, 1, 0.5))])
def test_a_joint_that_mimics_another_is_a_passive_one(tmp_path, multiplier, offset, kind, axis):
    parts = [link(name) for name in "abcd"]
    parts.append(joint("one", "a", "b", kind, (0, 0, 0.4), (0.1, 0, 0), axis))
    parts.append(joint("two", "b", "c", "revolute", (0.2, 0, 0.3), (0, 0.5, 0), (0, 0, 1)))
    parts.append(joint("three", "c", "d", kind, (0.1, 0, 0.3), (0, 0, 0.2), axis, mimic=("one", multiplier, offset)))
    path = written(tmp_path, *parts)
    robot = through_its_file(robot_from_urdf(path, "a", "d"))
    assert robot.joint_names == ("one", "two")
    assert_same_poses(robot, path, "a", "d", lambda values: {"three": multiplier * values["one"] + offset})

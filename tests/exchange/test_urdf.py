"""Robots of URDF files: poses and torques against pinocchio, and refusals of unsafe or
invalid files."""

import re

import numpy as np
import pytest
import yaml
from made_urdf import (
    LINKAGE_COMMANDS,
    LINKAGE_JOINTS,
    Pinocchio,
    assert_same_poses,
    joint,
    link,
    robot,
    write_linkage,
    written,
)
from support import refused
from synthetic import make_states

from elastocal.effects.conditions import build_conditions
from elastocal.exchange import urdf
from elastocal.exchange.robot_text import format_robot_file
from elastocal.exchange.urdf import read_urdf, robot_from_urdf
from elastocal.io.documents import check_document
from elastocal.mechanics.robot_file import parse_robot
from elastocal.mechanics.sites import build_sites

ARM = (
    link("base", 5.0, (0.0, 0.1, 0.2)),
    link("upper", 4.0, (0.1, 0.02, 0.3), (0.3, 0.2, 0.1)),
    link("bracket", 1.5, (0.0, -0.1, 0.05)),
    link("fore", 3.0, (0.2, 0.0, -0.05)),
    link("slide", 2.0, (0.05, 0.0, 0.0)),
    link("hand", 1.0, (0.0, 0.03, 0.04)),
    link("flange"),
    link("finger", 0.2, (0.0, 0.0, 0.06)),
    joint(
        "shoulder",
        "base",
        "upper",
        xyz=(0.1, -0.2, 0.4),
        rpy=(0.3, -0.4, 1.2),
        axis=(0, 1, 0),
        limits=(-1.5, 2.0),
    ),
    joint(
        "bolted",
        "upper",
        "bracket",
        "fixed",
        xyz=(0.0, 0.1, 0.2),
        rpy=(np.pi / 2, 0, 0),
    ),
    joint(
        "elbow",
        "bracket",
        "fore",
        "continuous",
        xyz=(0.5, 0, 0),
        rpy=(0, np.pi / 2, 0.7),
        axis=(1.0, -2.0, 0.5),
    ),
    joint(
        "rail",
        "fore",
        "slide",
        "prismatic",
        xyz=(0.3, 0.01, 0),
        axis=(0.6, 0, 0.8),
        limits=(-0.1, 0.25),
    ),
    joint("wrist", "slide", "hand", xyz=(0, 0, 0.1), rpy=(-0.2, 0, 0), axis=(-1, 0, 0)),
    joint("plate", "hand", "flange", "fixed", xyz=(0, 0, 0.08), rpy=(0, 0, 3.0)),
    joint("grip", "hand", "finger", "prismatic", xyz=(0.0, 0.02, 0.1), axis=(0, 1, 0)),
)


def through_its_file(result):
    """The arm of the text that is written, not of the document in memory."""
    document = yaml.safe_load(format_robot_file(result))
    check_document(document, "robot", "robot.yaml")
    return parse_robot(document)


def assert_same_weight(arm, path, within=None):
    states = make_states(arm.joints, 6, seed=3)
    by_pinocchio = Pinocchio(path)
    torques = build_conditions(build_sites(arm), arm.compliance, states).gravity[
        :, : arm.joints
    ]
    for angles, torque in zip(states.joint_angles, torques, strict=True):
        expected = by_pinocchio.weight(
            dict(zip(arm.joint_names, angles, strict=True)), arm.joint_names
        )
        np.testing.assert_allclose(
            torque,
            expected,
            rtol=0,
            atol=within or 1e-6 * max(1.0, np.abs(expected).max()),
        )
    return np.abs(torques).max()


@pytest.mark.parametrize(
    ("base", "tip", "names"),
    [
        ("base", "flange", ("shoulder", "elbow", "rail", "wrist")),
        ("upper", "hand", ("elbow", "rail", "wrist")),
    ],
)
def test_poses_and_weights_of_a_chain_agree_with_pinocchio(tmp_path, base, tip, names):
    path = written(tmp_path, *ARM)
    result = robot_from_urdf(path, base, tip)
    arm = through_its_file(result)
    assert arm.joint_names == names and {mass.link for mass in arm.masses} == {
        *range(len(names) + 1)
    }
    assert_same_poses(arm, path, base, tip)
    assert assert_same_weight(arm, path) > 1.0
    # What a URDF does not say is not made up.
    assert not arm.compliance_known and {mass.relative_std for mass in arm.masses} == {
        0.2
    }
    assert any("no compliances" in note for note in result.notes) and any(
        "20 %, by assumption" in n for n in result.notes
    )


@pytest.mark.parametrize(
    ("limits", "limits_found"),
    [
        (None, "no limits"),
        ((-1e16, 1e16), "no radians"),
        ((-170, 170), "limits of -170 to 170, no radians"),
    ],
)
def test_limits_that_are_missing_or_not_in_radians_become_one_turn_either_way(
    tmp_path, limits, limits_found
):
    free = written(
        tmp_path,
        link("a"),
        link("b"),
        joint("j", "a", "b", xyz=(0, 0, 1), limits=limits),
    )
    result = robot_from_urdf(free, "a", "b")
    assert result.document["joint_limits_deg"] == [[-360.0, 360.0]]
    assert any("'j' has" in note and limits_found in note for note in result.notes)


TREE = (
    *(link(name) for name in ("root", "base", "arm", "hand", "other")),
    joint("foot", "root", "base", "fixed", (0, 0, 1)),
    joint("j1", "base", "arm", xyz=(0, 0, 0.5)),
    joint("j2", "arm", "hand", xyz=(0.4, 0, 0), axis=(0, 1, 0)),
    joint("side", "base", "other"),
)


def one_joint(*names, **more):
    return (
        *map(link, names),
        *(joint(f"j{n}", *names[n : n + 2], **more) for n in range(len(names) - 1)),
    )


@pytest.mark.parametrize(
    ("parts", "links", "key", "fragments"),
    [
        (TREE, ("bas", "hand"), "base", ["'bas'", "'base'?"]),
        (TREE, ("base", "nothing"), "tip", ["'nothing'", "hand"]),
        (TREE, ("hand", "base"), "base 'hand', tip 'base'", ["other way round"]),
        (TREE, ("arm", "other"), "base 'arm', tip 'other'", ["two branches"]),
        (TREE, ("root", "base"), "base 'root', tip 'base'", ["no joint that moves"]),
        (TREE, ("base", "hand", ["other"]), "point", ["'other'", "arm"]),
        (
            (*TREE[:5], *TREE[6:8], joint("foot", "root", "base", "planar")),
            ("root", "hand"),
            "joint 'foot'",
            ["planar", "revolute"],
        ),
        (one_joint("a", "b", axis=(0, 0, 0)), ("a", "b"), "joint 'j0'", ["0 0 0"]),
        (
            (*map(link, "ab"), joint("j", "a", "b", mimic=("x", 1.0, 0.0))),
            ("a", "b"),
            "joint 'j': mimic",
            ["'x'", "a joint of this file that moves: j"],
        ),
        (
            (
                *map(link, "abc"),
                joint("j", "a", "b", mimic=("k", 1.0, 0.0)),
                joint("k", "b", "c", mimic=("j", 1.0, 0.0)),
            ),
            ("a", "c"),
            "joint 'k': mimic",
            ["follow each other"],
        ),
        (
            (
                *map(link, "abc"),
                joint("j", "a", "b", mimic=("k", 0.0, 0.0)),
                joint("k", "b", "c"),
            ),
            ("a", "c"),
            "joint 'j': mimic multiplier",
            ["fixed"],
        ),
        (one_joint("a", "b c", "b_c"), ("a", "b_c", ["b c"]), "point", ["blanks"]),
        (
            one_joint("a", "b", kind="prismatic", limits=None),
            ("a", "b"),
            "joint 'j0': limit",
            ["metres"],
        ),
    ],
)
def test_links_that_make_no_chain_are_refused(tmp_path, parts, links, key, fragments):
    path = written(tmp_path, *parts)
    with refused(path, key, *fragments):
        robot_from_urdf(path, *links)


def test_poses_of_a_chain_with_a_joint_that_follows_agree_with_pinocchio(tmp_path):
    path = write_linkage(tmp_path)
    result = robot_from_urdf(path, "base", "tool")
    arm = through_its_file(result)
    assert (arm.joints, arm.commands) == (7, 6)
    assert arm.joint_names == LINKAGE_JOINTS and arm.command_names == LINKAGE_COMMANDS
    assert_same_poses(arm, path, "base", "tool", count=200, within=1e-12, mimic=True)
    (note,) = [note for note in result.notes if "follows" in note]
    assert "'linkage' follows 'j2'" in note and "q4 of 'j4'" in note


def test_joints_may_follow_a_joint_that_follows_and_one_beside_the_chain(tmp_path):
    """The chain's first joint is commanded by way of another, and the last by a joint of
    a side branch."""
    path = written(
        tmp_path,
        *map(link, "abcdx"),
        joint("j1", "a", "b", xyz=(0, 0, 0.3), mimic=("j2", 2.0, -0.1)),
        joint("j2", "b", "c", xyz=(0.2, 0, 0), axis=(0, 1, 0), mimic=("j3", -0.5, 0.2)),
        joint("j3", "c", "d", "prismatic", xyz=(0.1, 0, 0)),
        joint("side", "a", "x"),
        joint(
            "j4", "d", "e", xyz=(0.1, 0, 0), axis=(1, 0, 0), mimic=("side", 1.5, 0.3)
        ),
        link("e"),
    )
    arm = through_its_file(robot_from_urdf(path, "a", "e"))
    assert arm.command_names == ("j3", "side")

    def follow(values):
        j2 = -0.5 * values["j3"] + 0.2
        return {"j2": j2, "j1": 2.0 * j2 - 0.1, "j4": 1.5 * values["side"] + 0.3}

    assert_same_poses(arm, path, "a", "e", follow, within=1e-12)


SOUND = (link("a"), link("b"), joint("j", "a", "b"))
PLACE = 'xyz="0.0 0.0 0.0"'
LAUGHS = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 10))
BOMB = (
    f'<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY l0 "ha">{LAUGHS}]>'
    '<robot name="&l9;"><link name="a"/></robot>'
)
OUTSIDE = (
    '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    '<robot name="&x;"><link name="a"/></robot>'
)


def file_of(folder, text, encoding="utf-8"):
    path = folder / "made.urdf"
    path.write_bytes(text.encode(encoding))
    return path


def test_only_joints_and_masses_are_read(tmp_path):
    mesh = (
        '<visual><geometry><mesh filename="package://gone/x.stl"/></geometry></visual>'
    )
    heavy = link("b", 2.0, (0, 0, 1)).replace("</link>", mesh + "</link>")
    imported = read_urdf(
        file_of(
            tmp_path,
            robot(link("a"), heavy, SOUND[2], '<gazebo reference="a"/>', name="arm"),
        )
    )
    assert imported.name == "arm"
    assert (
        imported.moments["b"].tolist() == [0, 0, 2, 2]
        and not imported.moments["a"].any()
    )


@pytest.mark.parametrize(
    "text", [BOMB, OUTSIDE], ids=["entities of entities", "an entity outside"]
)
def test_entities_are_refused_before_they_are_expanded(tmp_path, text):
    for encoding in ("utf-8", "utf-16"):
        with refused(tmp_path / "made.urdf", "", "<!DOCTYPE"):
            read_urdf(file_of(tmp_path, text, encoding))


def test_too_large_files_are_refused(tmp_path, monkeypatch):
    links = [link(f"l{number}") for number in range(2002)]
    joints = [
        joint(f"j{number}", f"l{number}", f"l{number + 1}") for number in range(2001)
    ]
    with refused(tmp_path / "made.urdf", "", "2002 times <link>", "at most 2000"):
        read_urdf(file_of(tmp_path, robot(*links, *joints)))
    with refused(tmp_path / "made.urdf", "", "more than 50 elements in each other"):
        read_urdf(file_of(tmp_path, robot("<a>" * 50 + "</a>" * 50)))
    with refused(tmp_path / "made.urdf", "", "more than 200000 elements"):
        read_urdf(file_of(tmp_path, robot("<a/>" * 200_000)))
    monkeypatch.setattr(urdf, "LARGEST_BYTES", 1000)
    with refused(tmp_path / "made.urdf", "", "more than 1000 bytes"):
        read_urdf(file_of(tmp_path, robot(*SOUND) + " " * 1000))


def changed(old, new):
    return robot(*SOUND[:2], SOUND[2].replace(old, new))


MACRO = (
    '<robot name="x" xmlns:xacro="http://ros.org/wiki/xacro">'
    '<xacro:include filename="y"/></robot>'
)
FAULTS = {
    "a macro": (MACRO, "", ["<xacro:include>", "run it first"]),
    "a property": (
        robot(link("${prefix}a"), *SOUND),
        "<link>",
        ["${prefix}a", "run it first"],
    ),
    "no XML": ("name: KUKA\n", "line 1", ["XML"]),
    "no name": (robot(*SOUND, "<link/>"), "link ''", ["a name for each"]),
    "an unknown type": (
        robot(*SOUND[:2], joint("j", "a", "b", "hinge")),
        "joint 'j'",
        ["'hinge'", "revolute"],
    ),
    "two parents": (
        robot(*SOUND, joint("k", "a", "b")),
        "joint 'k'",
        ["another joint"],
    ),
    "a loop": (robot(*SOUND, joint("k", "b", "a")), "link", ["a loop"]),
    "a word for a number": (
        changed('upper="2"', 'upper="two"'),
        "joint 'j': limit upper",
        ["'two'"],
    ),
    "a negative mass": (
        robot(link("a", -1.0), *SOUND[1:]),
        "link 'a': mass value",
        ["-1", "0 or more"],
    ),
    "a number beyond all machines": (
        changed(PLACE, 'xyz="0 0 1e300"'),
        "joint 'j': origin xyz",
        ["1e300"],
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_reported_in_one_line(tmp_path, fault):
    text, key, fragments = FAULTS[fault]
    with refused(tmp_path / "made.urdf", key, *fragments):
        read_urdf(file_of(tmp_path, text))


def weights(tmp_path, *parts, base="base", tip="hand"):
    """Masses of the robot file, and notes about masses and gravity."""
    imported = robot_from_urdf(written(tmp_path, *parts), base, tip)
    subjects = re.compile("zero for what|placeholders|gravity")
    notes = [note for note in imported.notes if subjects.search(note)]
    return imported.document.get("masses", []), notes


FLANGED = (
    link("base", 9.0),
    link("arm", 2.0, (0.1, 0, 0)),
    link("hand", 0.0),
    joint("j1", "base", "arm", xyz=(0, 0, 1), axis=(0, 1, 0)),
    joint("end", "arm", "hand", "fixed", (1, 0, 0)),
)
FINGER = (
    link("finger", 1.0, (0, 0, 0.1)),
    joint("open", "hand", "finger", "prismatic", (0, 0, 0.2)),
)


def test_side_branches_weigh_as_at_zero_and_moving_ones_on_the_column_not_at_all(
    tmp_path,
):
    masses, (note,) = weights(tmp_path, *FLANGED, *FINGER)
    entry = {
        "link": 1,
        "mass_kg": 3.0,
        "centre_m": pytest.approx([0.4, 0, 0.1]),
        "relative_std": 0.2,
    }
    assert masses[1] == entry and "open" in note and "zero" in note
    result = robot_from_urdf(
        written(tmp_path, *FLANGED, link("door", 7.0), joint("hinge", "base", "door")),
        "base",
        "hand",
    )
    assert [entry["mass_kg"] for entry in result.document["masses"]] == [9.0, 2.0]
    assert "joints that are no part of the chain, left out: hinge" in result.notes


def test_equal_masses_are_placeholders(tmp_path):
    parts = [link(name, 2.0) for name in "abcd"] + [
        joint(f"j{n}", "abcd"[n], "abcd"[n + 1]) for n in range(3)
    ]
    masses, notes = weights(tmp_path, *parts, base="a", tip="d")
    assert masses == [] and "2 kg: placeholders" in notes[0]
    heavier, _ = weights(tmp_path, link("a", 2.1), *parts[1:], base="a", tip="d")
    assert len(heavier) == 4


def test_gravity_is_expressed_in_a_tilted_base(tmp_path):
    wall = (
        link("wall"),
        joint("bolts", "wall", "base", "fixed", rpy=(0, np.pi / 2, 0)),
    )
    path = written(tmp_path, *wall, *FLANGED)
    assert robot_from_urdf(path, "base", "hand").document[
        "gravity_m_s2"
    ] == pytest.approx([9.80665, 0, 0])
    assert "gravity_m_s2" not in robot_from_urdf(path, "wall", "hand").document

"""The chain between two links: what is found, and what is refused in one line."""

import pytest
from made_urdf import assert_same_poses, joint, link, written
from support import refused

from elastocal.exchange.urdf import robot_from_urdf
from elastocal.exchange.urdf_chain import chain_between
from elastocal.exchange.urdf_reading import read_urdf

TREE = (
    *(link(name) for name in ("root", "base", "arm", "hand", "other")),
    joint("foot", "root", "base", "fixed", (0, 0, 1)),
    joint("j1", "base", "arm", xyz=(0, 0, 0.5)),
    joint("j2", "arm", "hand", xyz=(0.4, 0, 0), axis=(0, 1, 0)),
    joint("side", "base", "other"),
)


def chain(tmp_path, base="base", tip="hand", points=(), parts=TREE):
    return chain_between(read_urdf(written(tmp_path, *parts)), base, tip, points, "made.urdf")


def test_a_plain_chain_is_read_as_a_person_would_write_it(tmp_path):
    found = chain(tmp_path)
    assert found.notation == "Tz(0.5) Rz(q1) Tx(0.4) Ry(q2) [hand]"
    assert [one.name for one in found.joints] == ["j1", "j2"]
    assert chain(tmp_path, "root").notation == "Tz(1) Tz(0.5) Rz(q1) Tx(0.4) Ry(q2) [hand]"


@pytest.mark.parametrize(
    ("base", "tip", "points", "key", "words"),
    [
        ("bas", "hand", (), "base", ["'bas'", "'base'?"]),
        ("base", "nothing", (), "tip", ["'nothing'", "hand"]),
        ("hand", "base", (), "base 'hand', tip 'base'", ["other way round"]),
        ("arm", "other", (), "base 'arm', tip 'other'", ["two branches"]),
        ("root", "base", (), "base 'root', tip 'base'", ["no joint that moves"]),
        ("hand", "hand", (), "base 'hand', tip 'hand'", ["no joint that moves"]),
        ("base", "hand", ("other",), "point", ["'other'", "arm"]),
    ],
)
def test_links_that_make_no_chain_are_refused(tmp_path, base, tip, points, key, words):
    with refused("made.urdf", key, *words):
        chain(tmp_path, base, tip, points)


def make_mimics(**of):
    """Three joints; which mimics what, with multiplier and offset."""
    kinds = {"j2": "revolute", "other": "revolute"} | of.pop("kinds", {})
    parts = [link(name) for name in ("base", "arm", "fore", "hand", "beside")]
    parts.append(joint("j1", "base", "arm", xyz=(0, 0, 0.5), mimic=of.get("j1")))
    parts.append(joint("j2", "arm", "fore", kinds["j2"], xyz=(0.4, 0, 0), mimic=of.get("j2")))
    parts.append(joint("j3", "fore", "hand", xyz=(0.4, 0, 0), axis=(0, 1, 0), mimic=of.get("j3")))
    parts.append(joint("j4", "base", "beside"))
    return parts


@pytest.mark.parametrize(
    ("of", "key", "words"),
    [
        ({"j2": ("j1", 0.5, 0.0)}, "joint 'j2': mimic", ["0.5 times 'j1'", "1 or -1"]),
        ({"j2": ("j4", 1.0, 0.0)}, "joint 'j2': mimic", ["'j4'", "j1, j2, j3"]),
        ({"j2": ("gone", 1.0, 0.0)}, "joint 'j2': mimic", ["'gone'"]),
        ({"j1": ("j2", 1.0, 0.0), "j2": ("j1", 1.0, 0.0)}, "mimic", ["a loop"]),
        ({"j2": ("j1", 1.0, 0.0), "kinds": {"j2": "prismatic"}}, "joint 'j2': mimic", ["moves otherwise"]),
    ],
)
def test_couplings_that_the_notation_cannot_say_are_refused(tmp_path, of, key, words):
    with refused("made.urdf", key, *words):
        chain(tmp_path, parts=make_mimics(**of))


def test_a_joint_may_mimic_one_behind_it_and_one_that_mimics(tmp_path):
    path = written(tmp_path, *make_mimics(j1=("j3", -1.0, 0.2), j2=("j1", -1.0, 0.4)))
    robot = robot_from_urdf(path, "base", "hand").robot
    assert robot.joint_names == ("j3",)

    def coupled(values):
        first = -values["j3"] + 0.2
        return {"j1": first, "j2": -first + 0.4}

    assert_same_poses(robot, path, "base", "hand", coupled)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_that_no_serial_arm_has_are_refused(tmp_path, kind):
    parts = (*TREE[:5], *TREE[6:8], joint("foot", "root", "base", kind))
    with refused("made.urdf", "joint 'foot'", kind, "revolute"):
        chain(tmp_path, "root", parts=parts)


def test_an_axis_without_a_direction_is_refused(tmp_path):
    with refused("made.urdf", "joint 'j'", "0 0 0"):
        chain(tmp_path, "a", "b", parts=(link("a"), link("b"), joint("j", "a", "b", axis=(0, 0, 0))))
    with refused("made.urdf", "joint 'j'", "1e-20"):
        chain(tmp_path, "a", "b", parts=(link("a"), link("b"), joint("j", "a", "b", axis=(1e-20, 0, 0))))


def test_points_that_would_have_one_name_are_refused(tmp_path):
    parts = (link("a"), link("b c"), link("b_c"), joint("j", "a", "b c"), joint("k", "b c", "b_c"))
    with refused("made.urdf", "point", "blanks"):
        chain(tmp_path, "a", "b_c", ["b c"], parts)

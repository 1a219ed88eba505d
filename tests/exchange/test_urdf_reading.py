"""A URDF file is read safely, and every fault of it is one line."""

import pytest
from made_urdf import joint, link, robot
from support import refused

from elastocal.exchange import urdf_reading
from elastocal.exchange.urdf_reading import read_urdf

SOUND = (link("a"), link("b"), joint("j", "a", "b"))
PLACE = 'xyz="0.0 0.0 0.0"'
LAUGHS = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 10))
BOMB = f'<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY l0 "ha">{LAUGHS}]><robot name="&l9;"><link name="a"/></robot>'
OUTSIDE = '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"><link name="a"/></robot>'


def file_of(folder, text, encoding="utf-8"):
    path = folder / "made.urdf"
    path.write_bytes(text.encode(encoding))
    return path


def test_links_joints_and_masses_are_there_and_no_geometry(tmp_path):
    mesh = '<visual><geometry><mesh filename="package://gone/x.stl"/></geometry></visual>'
    heavy = link("b", 2.0, (0, 0, 1)).replace("</link>", mesh + "</link>")
    urdf = read_urdf(file_of(tmp_path, robot(link("a"), heavy, SOUND[2], '<gazebo reference="a"/>', name="arm")))
    assert urdf.name == "arm" and [one.name for one in urdf.joints] == ["j"]
    assert urdf.links[1].mass == 2.0 and urdf.links[1].centre.tolist() == [0, 0, 1]


@pytest.mark.parametrize("text", [BOMB, OUTSIDE], ids=["entities of entities", "an entity outside"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_entities_are_refused_before_they_are_looked_at(tmp_path, text, encoding):
    with refused(tmp_path / "made.urdf", "line 1", "<!DOCTYPE"):
        read_urdf(file_of(tmp_path, text, encoding))


def test_more_than_a_urdf_can_have_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(urdf_reading, "LARGEST_BYTES", 1_000_000)
    with refused(tmp_path / "made.urdf", "", "more than 1000000 bytes"):
        read_urdf(file_of(tmp_path, robot(*SOUND) + " " * 1_000_000))


MACRO = '<robot name="x" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="y"/></robot>'
FAULTS = {
    "a macro": (MACRO, "", ["<xacro:include>", "run it first"]),
    "a property": (robot(link("${prefix}a"), *SOUND), "<link>", ["${prefix}a", "run it first"]),
    "no XML": ("name: KUKA\n", "line 1", ["XML"]),
    "cut off": (robot(*SOUND)[:-20], "line", ["XML"]),
    "empty": ("", "line 1", ["XML"]),
    "another language": ("<sdf><model/></sdf>", "", ["<sdf>", "<robot>"]),
    "no links": ("<robot name='x'/>", "", ["no <link>"]),
    "no joints": (robot(link("a")), "", ["no <joint>"]),
    "a link twice": (robot(*SOUND, link("a")), "link 'a'", ["2 times"]),
    "a joint twice": (robot(*SOUND, link("c"), joint("j", "b", "c")), "joint 'j'", ["2 times"]),
    "no name": (robot(*SOUND, "<link/>"), "<link>", ["no name"]),
    "an unknown type": (robot(*SOUND[:2], joint("j", "a", "b", "hinge")), "joint 'j'", ["'hinge'", "revolute"]),
    "an unknown parent": (robot(*SOUND[:2], joint("j", "x", "b")), "joint 'j'", ["parent 'x'"]),
    "no child": (robot(*SOUND[:2], joint("j", "a", "b").replace('<child link="b"/>', "")), "joint 'j'", ["child ''"]),
    "two parents": (robot(*SOUND, joint("k", "a", "b")), "joint 'k'", ["another joint"]),
    "a loop": (robot(*SOUND, joint("k", "b", "a")), "link", ["a loop"]),
    "a word for a number": (
        robot(*SOUND[:2], SOUND[2].replace('upper="2"', 'upper="two"')),
        "joint 'j': limit upper",
        ["'two'"],
    ),
    "two coordinates": (robot(*SOUND[:2], SOUND[2].replace(PLACE, 'xyz="0 0"')), "joint 'j': origin xyz", ["3 numbers"]),
    "no number": (robot(*SOUND[:2], SOUND[2].replace(PLACE, 'xyz="0 0 nan"')), "joint 'j': origin xyz", ["nan"]),
    "two origins": (robot(*SOUND[:2], SOUND[2].replace("</joint>", "<origin/></joint>")), "joint 'j'", ["<origin> 2 times"]),
    "a negative mass": (robot(link("a", -1.0), *SOUND[1:]), "link 'a': mass value", ["-1.0", "0 or more"]),
    "underscores": (robot(link("a", 1.0).replace('"1.0"', '"1_0"'), *SOUND[1:]), "link 'a': mass value", ["'1_0'", "a number"]),
    "a number beyond all machines": (
        robot(*SOUND[:2], SOUND[2].replace(PLACE, 'xyz="0 0 1e300"')),
        "joint 'j': origin xyz",
        ["1e300", "3 numbers"],
    ),
    "a mass of nothing": (robot(link("a", 1.0).replace('value="1.0"', ""), *SOUND[1:]), "link 'a'", ["<mass> without value"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_one_line(tmp_path, fault):
    text, key, words = FAULTS[fault]
    with refused(tmp_path / "made.urdf", key, *words):
        read_urdf(file_of(tmp_path, text))


def test_more_links_than_can_be_followed_are_refused_at_once(tmp_path):
    links = [link(f"l{number}") for number in range(2002)]
    joints = [joint(f"j{number}", f"l{number}", f"l{number + 1}") for number in range(2001)]
    with refused(tmp_path / "made.urdf", "", "2002 times <link>", "at most 2000"):
        read_urdf(file_of(tmp_path, robot(*links, *joints)))

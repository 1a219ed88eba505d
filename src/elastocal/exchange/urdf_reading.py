"""A URDF file, read safely: its links, joints and masses, nothing that it refers to.

The Unified Robot Description Format [1] is XML. No document type is accepted, and so no entity that grows or fetches another
file; meshes, materials and plug-ins are left out, and no other file is opened.

[1] Open Robotics, XML Robot Description Format (URDF), wiki.ros.org/urdf/XML.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.fixed_transforms import origin_transform
from elastocal.io.texts import LARGEST_NUMBER, plain_number, read_bytes

# The longest public descriptions, of humanoids with hands, have less than a megabyte.
LARGEST_BYTES = 20_000_000
# Whole cells with grippers and cameras have some hundred links; each is followed to the root.
_MOST_PARTS = 2000
_LARGEST_LIMIT = 1e100
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_XACRO = "a URDF; this is xacro, run it first: xacro FILE > robot.urdf"
# What is read of each, once at most.
_READ = {
    "link": ("inertial",),
    "inertial": ("origin", "mass"),
    "joint": ("parent", "child", "origin", "axis", "limit", "mimic"),
}
# How many numbers each attribute has that is read.
_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "mass": {"value": 1},
}
_NEEDED = {"mass": "value", "mimic": "joint"}


@dataclass(frozen=True)
class Link:
    """A link, its mass (kg, 0 where none is stated) and its centre of mass in the link's frame (m)."""

    name: str
    mass: float
    centre: np.ndarray


@dataclass(frozen=True)
class _Mimic:
    """The joint that another one follows."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Joint:
    """A joint: `origin` (4, 4) in the parent's frame, `axis` (3,) in its own; limits that are not stated are 0."""

    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray
    axis: np.ndarray
    lower: float
    upper: float
    mimic: _Mimic | None


@dataclass(frozen=True)
class Urdf:
    """A tree of links: every name once, every joint between two of them; `left_out` names other elements of the file."""

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    left_out: tuple[str, ...] = ()


def read_urdf(path: str | Path) -> Urdf:
    """Links, joints and masses of a URDF file; one whose joints and links do not hold together is refused."""
    source = Path(path).as_posix()
    root = _root_of(read_bytes(path, LARGEST_BYTES, "a URDF file"), source)
    links, joints = root.findall("link"), root.findall("joint")
    for part in (*links, *joints):
        if not part.get("name"):
            raise InputError(source, f"<{part.tag}>", "no name", "a name")
        _check_part(part, f"{part.tag} {part.get('name')!r}", source)
    _check_tree(links, joints, source)
    parts = [root, *links, *joints, *root.iterfind("link/inertial")]
    left_out = {child.tag for part in parts for child in part if child.tag not in ("link", "joint", *_READ.get(part.tag, ()))}
    name = root.get("name") or Path(path).stem
    return Urdf(name, tuple(map(_link, links)), tuple(map(_joint, joints)), tuple(sorted(left_out)))


def _link(part: Element) -> Link:
    (mass,) = _values(part, "inertial/mass", "value", "0")
    return Link(part.attrib["name"], mass, np.array(_values(part, "inertial/origin", "xyz", "0 0 0")))


def _joint(part: Element) -> Joint:
    origin = origin_transform(*(_values(part, "origin", name, "0 0 0") for name in ("xyz", "rpy")))
    (lower,), (upper,) = _values(part, "limit", "lower", "0"), _values(part, "limit", "upper", "0")
    (multiplier,), (offset,) = _values(part, "mimic", "multiplier", "1"), _values(part, "mimic", "offset", "0")
    mimic = None if part.find("mimic") is None else _Mimic(_end(part, "mimic", "joint"), multiplier, offset)
    ends = _end(part, "parent"), _end(part, "child")
    axis = np.array(_values(part, "axis", "xyz", "1 0 0"))
    return Joint(part.attrib["name"], part.attrib["type"], *ends, origin, axis, lower, upper, mimic)


def _values(part: Element, tag: str, attribute: str, default: str) -> list[float]:
    child = part.find(tag)
    return [float(word) for word in (default if child is None else child.get(attribute, default)).split()]


def _root_of(data: bytes, source: str) -> Element:
    """The root of the tree, its names without namespaces."""
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        allowed = "a URDF without a document type, for entities of one could be endless or other files"
        raise InputError(source, f"line {parser.CurrentLineNumber}", "<!DOCTYPE", allowed)

    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
        root = ElementTree.fromstring(data)
    except (expat.ExpatError, ElementTree.ParseError, ValueError, LookupError) as error:
        if isinstance(error, InputError):
            raise
        line = getattr(error, "lineno", None) or getattr(error, "position", (None,))[0]
        raise InputError(source, f"line {line}" if line else "", str(error).partition(":")[0], "a URDF, which is XML") from None
    for element in root.iter():
        uri, _, name = element.tag.rpartition("}")
        if "xacro" in uri:
            raise InputError(source, "", f"<xacro:{name}>", _XACRO)
        for value in element.attrib.values():
            if "${" in value or "$(" in value:
                raise InputError(source, f"<{name}>", repr(value), _XACRO)
        element.tag = name
    if root.tag != "robot":
        raise InputError(source, "", f"<{root.tag}>", "a URDF, which is a <robot>")
    return root


def _check_part(part: Element, called: str, source: str) -> None:
    """Each child that is read stands once at most, with numbers where there must be some."""
    for tag in _READ[part.tag]:
        children = part.findall(tag)
        if len(children) > 1:
            raise InputError(source, called, f"<{tag}> {len(children)} times", "once at most")
        for child in children:
            for attribute, count in _NUMBERS.get(tag, {}).items():
                # Programs write 1e16 and more where a joint, a force or a speed has no limit.
                largest = _LARGEST_LIMIT if tag == "limit" else LARGEST_NUMBER
                _check_numbers(child.get(attribute), count, f"{called}: {tag} {attribute}", source, largest)
            needed = _NEEDED.get(tag)
            if needed and not child.get(needed):
                raise InputError(source, called, f"<{tag}> without {needed}", f"<{tag} {needed}=...>")
            if tag == "mass" and float(child.attrib["value"]) < 0:
                raise InputError(source, f"{called}: mass value", child.attrib["value"], "0 or more kg")
            if tag == "inertial":
                _check_part(child, called, source)


def _check_numbers(text: str | None, count: int, key: str, source: str, largest: float) -> None:
    if text is None:
        return
    words = text.split(None, count)
    if len(words) != count or any(plain_number(word, largest) is None for word in words):
        allowed = f"{'a number' if count == 1 else f'{count} numbers'}, up to {largest:g} in size"
        raise InputError(source, key, repr(text), allowed)


def _check_tree(links: Sequence[Element], joints: Sequence[Element], source: str) -> None:
    for tag, parts in (("link", links), ("joint", joints)):
        if not parts:
            raise InputError(source, "", f"no <{tag}>", "a URDF with links and joints")
        if len(parts) > _MOST_PARTS:
            raise InputError(source, "", f"{len(parts)} times <{tag}>", f"at most {_MOST_PARTS}")
        name, times = Counter(part.attrib["name"] for part in parts).most_common(1)[0]
        if times > 1:
            raise InputError(source, f"{tag} {name!r}", f"{times} times", "each name once")
    names = {link.attrib["name"] for link in links}
    parent_of: dict[str, str] = {}
    for joint in joints:
        called = f"joint {joint.attrib['name']!r}"
        if joint.get("type") not in KINDS:
            raise InputError(source, called, f"type {joint.get('type')!r}", " | ".join(KINDS))
        parent, child = (_end(joint, tag) for tag in ("parent", "child"))
        for tag, name in (("parent", parent), ("child", child)):
            if name not in names:
                raise InputError(source, called, f"{tag} {name!r}", "a link of this file")
        if child in parent_of:
            found = f"child {child!r}, which another joint has too"
            raise InputError(source, called, found, "a tree: each link below one joint")
        parent_of[child] = parent
    for name in names:
        seen, at = {name}, parent_of.get(name)
        while at is not None:
            if at in seen:
                raise InputError(source, f"link {at!r}", "a loop of joints", "a tree: no link below itself")
            seen.add(at)
            at = parent_of.get(at)


def _end(joint: Element, tag: str, attribute: str = "link") -> str:
    end = joint.find(tag)
    return "" if end is None else end.get(attribute, "")

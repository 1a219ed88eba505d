"""A URDF file, read safely: its links, joints and masses, nothing that it refers to.

The Unified Robot Description Format [1]_ is XML. A file is checked before the library yourdfpy makes its links and joints: no
document type is accepted, and so no entity that grows or fetches another file; meshes, materials and plug-ins are left out, and
no other file is opened.

References
----------
.. [1] Open Robotics, XML Robot Description Format (URDF), wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

import io
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree
from xml.parsers import expat

from elastocal.errors import InputError
from elastocal.io.texts import LARGEST_NUMBER, plain_number, read_bytes

if TYPE_CHECKING:
    from collections.abc import Iterator

    from yourdfpy import URDF

# The longest public descriptions, of humanoids with hands, have less than a megabyte.
LARGEST_BYTES = 20_000_000
# Whole cells with grippers and cameras have some hundred links; each is followed to the root.
MOST_PARTS = 2000
LARGEST_LIMIT = 1e100
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_XACRO = "a URDF; this is xacro, run it first: xacro FILE > robot.urdf"
# How many numbers each attribute has that is read.
_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "mass": {"value": 1},
}
_NEEDED = {"mass": "value", "mimic": "joint"}


def read_urdf(path: str | Path) -> URDF:
    """Links, joints and masses of a URDF file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    yourdfpy.URDF
        Without geometry; every name once, every joint between two links that are there, and the links a tree.

    Raises
    ------
    InputError
        A file that is missing, too large, no URDF, or one whose joints and links do not hold together.
    """
    source = Path(path).as_posix()
    root = _root_of(read_bytes(path, LARGEST_BYTES, "a URDF file"), source)
    cleaned = ElementTree.Element("robot", {"name": root.get("name") or Path(path).stem})
    for part in root:
        if part.tag == "link":
            cleaned.append(_copy(part, f"link {part.get('name')!r}", ("inertial",), source))
        elif part.tag == "joint":
            cleaned.append(_copy(part, f"joint {part.get('name')!r}", ("parent", "child", *_NUMBERS), source))
    _check_tree(cleaned, source)
    # Imported here: it takes longer than all the rest of the command.
    from yourdfpy import URDF

    return URDF.load(io.BytesIO(ElementTree.tostring(cleaned)), load_meshes=False, build_scene_graph=False)


def _root_of(data: bytes, source: str) -> ElementTree.Element:
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


def _copy(part: ElementTree.Element, called: str, kept: tuple[str, ...], source: str) -> ElementTree.Element:
    """The children that matter, each once, with numbers where there must be some."""
    if not part.get("name"):
        raise InputError(source, f"<{part.tag}>", "no name", "a name")
    copy = ElementTree.Element(part.tag, part.attrib)
    for tag, children in _by_tag(part, kept):
        if len(children) > 1:
            raise InputError(source, called, f"<{tag}> {len(children)} times", "once at most")
        for attribute, count in _NUMBERS.get(tag, {}).items():
            # Programs write 1e16 and more where a joint, a force or a speed has no limit.
            largest = LARGEST_LIMIT if tag == "limit" else LARGEST_NUMBER
            _check_numbers(children[0].get(attribute), count, f"{called}: {tag} {attribute}", source, largest)
        needed = _NEEDED.get(tag)
        if needed and not children[0].get(needed):
            raise InputError(source, called, f"<{tag}> without {needed}", f"<{tag} {needed}=...>")
        copy.append(_copy_inertial(children[0], called, source) if tag == "inertial" else _bare(children[0]))
    return copy


def _copy_inertial(inertial: ElementTree.Element, called: str, source: str) -> ElementTree.Element:
    inertial.set("name", "inertial")
    copy = _copy(inertial, called, ("origin", "mass"), source)
    mass = copy.find("mass")
    if mass is not None and float(mass.attrib["value"]) < 0:
        raise InputError(source, f"{called}: mass value", mass.attrib["value"], "0 or more kg")
    return copy


def _bare(element: ElementTree.Element) -> ElementTree.Element:
    return ElementTree.Element(element.tag, element.attrib)


def _by_tag(part: ElementTree.Element, kept: tuple[str, ...]) -> Iterator[tuple[str, list[ElementTree.Element]]]:
    for tag in kept:
        if children := part.findall(tag):
            yield tag, children


def _check_numbers(text: str | None, count: int, key: str, source: str, largest: float) -> None:
    if text is None:
        return
    words = text.split(None, count)
    if len(words) != count or any(plain_number(word, largest) is None for word in words):
        raise InputError(
            source, key, repr(text), f"{'a number' if count == 1 else f'{count} numbers'}, up to {largest:g} in size"
        )


def _check_tree(robot: ElementTree.Element, source: str) -> None:
    links, joints = robot.findall("link"), robot.findall("joint")
    for tag, parts in (("link", links), ("joint", joints)):
        if not parts:
            raise InputError(source, "", f"no <{tag}>", "a URDF with links and joints")
        if len(parts) > MOST_PARTS:
            raise InputError(source, "", f"{len(parts)} times <{tag}>", f"at most {MOST_PARTS}")
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


def _end(joint: ElementTree.Element, tag: str) -> str:
    end = joint.find(tag)
    return "" if end is None else end.get("link", "")

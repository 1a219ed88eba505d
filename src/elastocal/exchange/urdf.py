"""A URDF file, read safely, and the serial chain between two of its links as the contents of a robot file.

The Unified Robot Description Format [1] is XML. No document type is accepted, and so no entity that grows or fetches another
file; meshes, materials and plug-ins are left out, and no other file is opened.

A joint of a URDF is a fixed transform (``origin``), and then a rotation about or a translation along an axis. The transform
becomes ``Tx Ty Tz Rz Ry Rx``; an axis that is not x, y or z is turned into z and back, ``Rz Ry Rz(q1) Ry Rz``. A joint that
mimics another one of the chain, by +1 or -1, stands in the chain as a passive joint ``Ry(-q2)``. All that a joint carries
rigidly is one mass, side branches and what stands behind the tip included.

[1] Open Robotics, XML Robot Description Format (URDF), wiki.ros.org/urdf/XML.
"""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np

from elastocal.counting import first_names
from elastocal.errors import InputError, closest_first
from elastocal.exchange import URDF_MASS_STD
from elastocal.exchange.fixed_transforms import (
    axis_rotation,
    displacement_words,
    elementary,
    express_axis,
    homogeneous,
    origin_transform,
    word,
)
from elastocal.exchange.robot_text import MOST_TURNS, Imported, check_imported, mass_entries, point_name
from elastocal.io.texts import LARGEST_NUMBER, plain_number, read_bytes
from elastocal.mechanics.robot import STANDARD_GRAVITY, UNLIMITED_DEG

# The longest public descriptions, of humanoids with hands, have less than a megabyte.
LARGEST_BYTES = 20_000_000
# Elements, and how deep in each other: each takes memory many times its size in the file.
_MOST_ELEMENTS, _DEEPEST = 200_000, 50
# Whole cells with grippers and cameras have some hundred links; each is followed to the root.
_MOST_PARTS = 2000
_MOVING = {"revolute": "R", "continuous": "R", "prismatic": "T"}
_KINDS = (*_MOVING, "fixed", "floating", "planar")
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
# Limits to a billionth of a degree, or to a nanometre; gravity to so many m/s².
_DECIMALS = 9
# Two turns, and rounding; the limits of a joint in degrees are farther, and few joints turn so often.
_FARTHEST_RAD = 4.0 * math.pi + 0.01
# An angle this close to a right one, and none, is one that was written with few digits: 1.57 and 1.5708 are.
_NEARLY_RAD, _EXACTLY_RAD = 1e-3, 1e-9
# So many links of a robot never weigh the same; links and joints that a note names.
_FEWEST_ALIKE, _NAMED = 3, 4


@dataclass(frozen=True)
class Joint:
    """A joint: `origin` (4, 4) in the parent's frame, `axis` (3,) in its own; limits not stated are 0; whom it follows."""

    name: str
    kind: str
    parent: str
    child: str
    origin: np.ndarray
    axis: np.ndarray
    lower: float
    upper: float
    # The other joint, multiplier and offset.
    mimic: tuple[str, float, float] | None


@dataclass(frozen=True)
class Urdf:
    """A tree of links: every name once, every joint between two of them; `left_out` names other elements of the file.

    `moments` (4,): of each link by its name the mass times its centre in the link's frame (kg m), and the mass (kg, 0 where
    none is stated). `above`: the joint that carries a link, by the link's name; the root has none.
    """

    name: str
    moments: dict[str, np.ndarray]
    joints: tuple[Joint, ...]
    left_out: tuple[str, ...]
    above: dict[str, Joint]

    def joints_above(self, link: str) -> Iterator[Joint]:
        """The joints that carry a link, the nearest first, to the root."""
        while link in self.above:
            yield self.above[link]
            link = self.above[link].parent

    def path_to(self, tip: str, base: str | None) -> list[Joint]:
        """The joints from a link, or from the root of the tree where it does not carry the tip, to the tip."""
        return [*takewhile(lambda joint: joint.child != base, self.joints_above(tip))][::-1]


@dataclass(frozen=True)
class Carried:
    """Where a link of the chain is: `body` is the number of the joint that carries it, 0 for the column.

    `transform` (4, 4): of its frame, in the frame directly behind that joint, all joints at zero. `behind_passive`: whether a
    passive joint turns it against that joint's frame.
    """

    body: int
    transform: np.ndarray
    behind_passive: bool


@dataclass(frozen=True)
class UrdfChain:
    """The chain between two links: in the notation, with measuring points; the joints of q1, q2, ...; links on it."""

    notation: str
    joints: tuple[Joint, ...]
    links: dict[str, Carried]


def robot_from_urdf(
    path: str | Path,
    base: str,
    tip: str,
    points: Sequence[str] = (),
    relative_std: float = URDF_MASS_STD,
    limits_in: str | None = None,
) -> Imported:
    """The robot between two links of a URDF.

    `base`, `tip`: links: the robot's base frame, and its last measuring point. `points`: links between them that become
    measuring points too. `relative_std`: how well the masses are known. `limits_in`: unit of the limits of joints that turn;
    asked for where one goes farther than joints do in rad. Limits of continuous joints are a turn either way. Raises
    `InputError`: as in `read_urdf` and `chain_between`; a prismatic joint without limits.
    """
    urdf, source = read_urdf(path), str(path)
    chain = chain_between(urdf, base, tip, points, source)
    masses, notes = _weights(urdf, chain, relative_std)
    notes.insert(0, f"read: {', '.join(f'q{n} from {joint.name!r}' for n, joint in enumerate(chain.joints, 1))}")
    limits = [_limits(joint, limits_in, notes, source) for joint in chain.joints]
    if limits_in == "deg":
        notes.append("limits read in degrees, as the option says")
    document: dict[str, Any] = {"name": urdf.name, "joint_names": [joint.name for joint in chain.joints]}
    document |= {"chain": chain.notation, "joint_limits_deg": limits}
    # The tree's root is upright.
    before = np.linalg.multi_dot([np.eye(4), np.eye(4), *(joint.origin for joint in urdf.path_to(base, None))])
    gravity = np.round(-STANDARD_GRAVITY * before[2, :3], _DECIMALS) + 0.0
    if gravity[2] != -STANDARD_GRAVITY:
        document["gravity_m_s2"] = gravity.tolist()
        notes.append(f"gravity as at {base!r} where the root of the tree stands upright and the joints before it are at zero")
    if masses:
        document["masses"] = masses
        notes.append(f"masses are known to {100 * relative_std:g} %, by assumption: a URDF does not say")
    on_chain = [joint for joint in urdf.joints if joint.child in chain.links]
    off = {joint.name: np.abs(joint.origin[:3, :3] - np.round(joint.origin[:3, :3])).max() for joint in on_chain}
    if few := [name for name, far in off.items() if _EXACTLY_RAD < far < _NEARLY_RAD]:
        notes.append(f"nearly right angles stay as they are written, with few digits: those of {', '.join(few)}")
    if beside := [joint.name for joint in urdf.joints if joint.kind != "fixed" and joint.child not in chain.links]:
        notes.append(f"joints that are no part of the chain, left out: {', '.join(beside)}")
    if urdf.left_out:
        notes.append(f"not used: {', '.join(urdf.left_out)}, nor limits of effort and velocity")
    return check_imported(document, path, f"the links from {base!r} to {tip!r}", notes)


def _limits(joint: Joint, limits_in: str | None, notes: list[str], source: str) -> list[float]:
    """Degrees, of prismatic joints metres."""
    low, high, farthest = joint.lower, joint.upper, max(-joint.lower, joint.upper)
    prismatic, called = joint.kind == "prismatic", f"joint {joint.name!r}: limit"
    if joint.kind == "continuous" and low >= high:
        return list(UNLIMITED_DEG)
    if low >= high and prismatic:
        raise InputError(
            source, called, f"{low:g} to {high:g}", 'of a prismatic joint, <limit lower="..." upper="..."> in metres'
        )
    if low >= high or (not prismatic and farthest > 2.0 * math.pi * MOST_TURNS):
        notes.append(f"joint {joint.name!r} has no limits in the URDF: a turn either way")
        return list(UNLIMITED_DEG)
    if limits_in is None and not prismatic and farthest > _FARTHEST_RAD:
        allowed = "radians; --limits deg where the file has degrees, or --limits rad where the joint does turn as often"
        raise InputError(source, called, f"{low:g} to {high:g}, {farthest / (2.0 * math.pi):.0f} turns", allowed)
    return [round(value if prismatic or limits_in == "deg" else math.degrees(value), _DECIMALS) for value in (low, high)]


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
    moments = {}
    for part in links:
        centre = _values(part, "inertial/origin", "xyz", "0 0 0")
        moments[part.attrib["name"]] = _values(part, "inertial/mass", "value", "0")[0] * np.array([*centre, 1.0])
    made = tuple(map(_joint, joints))
    name = root.get("name") or Path(path).stem
    return Urdf(name, moments, made, tuple(sorted(left_out)), {joint.child: joint for joint in made})


def _joint(part: Element) -> Joint:
    def number(tag: str, name: str, default: str = "0") -> float:
        return _values(part, tag, name, default)[0]

    origin = origin_transform(*(_values(part, "origin", name, "0 0 0") for name in ("xyz", "rpy")))
    mimic = (_end(part, "mimic", "joint"), number("mimic", "multiplier", "1"), number("mimic", "offset"))
    ends, axis = (_end(part, "parent"), _end(part, "child")), np.array(_values(part, "axis", "xyz", "1 0 0"))
    limits, follows = (number("limit", "lower"), number("limit", "upper")), part.find("mimic") is not None
    return Joint(part.attrib["name"], part.attrib["type"], *ends, origin, axis, *limits, mimic if follows else None)


def _values(part: Element, tag: str, attribute: str, default: str) -> list[float]:
    child = part.find(tag)
    return [float(word) for word in (default if child is None else child.get(attribute, default)).split()]


def _end(joint: Element, tag: str, attribute: str = "link") -> str:
    end = joint.find(tag)
    return "" if end is None else end.get(attribute, "")


def _root_of(data: bytes, source: str) -> Element:
    """The root of the tree, its names without namespaces."""
    parser, count, depth = expat.ParserCreate(), 0, 0

    def begin(*_: object) -> None:
        nonlocal count, depth
        count, depth = count + 1, depth + 1
        if count > _MOST_ELEMENTS or depth > _DEEPEST:
            found = (
                f"more than {_DEEPEST} elements in each other" if depth > _DEEPEST else f"more than {_MOST_ELEMENTS} elements"
            )
            raise InputError(source, f"line {parser.CurrentLineNumber}", found, "a URDF, which needs fewer")

    def end(*_: object) -> None:
        nonlocal depth
        depth -= 1

    def refuse(*_: object) -> None:
        allowed = "a URDF without a document type, for entities of one could be endless or other files"
        raise InputError(source, f"line {parser.CurrentLineNumber}", "<!DOCTYPE", allowed)

    parser.StartDoctypeDeclHandler, parser.StartElementHandler, parser.EndElementHandler = refuse, begin, end
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
            # Programs write 1e16 and more where a joint, a force or a speed has no limit.
            largest = 1e100 if tag == "limit" else LARGEST_NUMBER
            for attribute, count in _NUMBERS.get(tag, {}).items():
                text = child.get(attribute)
                words = None if text is None else text.split(None, count)
                if words is not None and (len(words) != count or any(plain_number(each, largest) is None for each in words)):
                    allowed = f"{'a number' if count == 1 else f'{count} numbers'}, up to {largest:g} in size"
                    raise InputError(source, f"{called}: {tag} {attribute}", repr(text), allowed)
            needed = _NEEDED.get(tag)
            if needed and not child.get(needed):
                raise InputError(source, called, f"<{tag}> without {needed}", f"<{tag} {needed}=...>")
            if tag == "mass" and float(child.attrib["value"]) < 0:
                raise InputError(source, f"{called}: mass value", child.attrib["value"], "0 or more kg")
            if tag == "inertial":
                _check_part(child, called, source)


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
        if joint.get("type") not in _KINDS:
            raise InputError(source, called, f"type {joint.get('type')!r}", " | ".join(_KINDS))
        parent, child = (_end(joint, tag) for tag in ("parent", "child"))
        for tag, name in (("parent", parent), ("child", child)):
            if name not in names:
                raise InputError(source, called, f"{tag} {name!r}", "a link of this file")
        if child in parent_of:
            raise InputError(
                source, called, f"child {child!r}, which another joint has too", "a tree: each link below one joint"
            )
        parent_of[child] = parent
    for name in parent_of:
        seen, at = {name}, parent_of.get(name)
        while at is not None and at not in seen:
            seen.add(at)
            at = parent_of.get(at)
        if at is not None:
            raise InputError(source, f"link {at!r}", "a loop of joints", "a tree: no link below itself")


def chain_between(urdf: Urdf, base: str, tip: str, points: Sequence[str], source: str) -> UrdfChain:
    """The chain from one link to another that it carries.

    `base`, `tip`: names of links. `points`: further links of the chain that become measuring points; the tip is the last one
    always. `source`: named in errors. Raises `InputError`: a link that is not there or not on the chain, a tip that the base
    does not carry, a joint that the notation cannot say.
    """
    path = _path(urdf, base, tip, source)
    masters = _masters(urdf, path, source)
    named = {joint.name: joint for joint in path}
    on_chain = [base, *(joint.child for joint in path)]
    for name in points:
        if name not in on_chain:
            allowed = f"a link between {base!r} and {tip!r}: {closest_first(name, on_chain)}"
            raise InputError(source, "point", repr(name), allowed)
    marked = {name: point_name(name) for name in (*points, tip)}
    if len(set(marked.values())) < len(marked):
        allowed = "links whose names differ by more than blanks and brackets"
        raise InputError(source, "point", ", ".join(map(repr, marked)), allowed)
    words = [f"[{marked[base]}]"] if base in marked else []
    numbers: dict[str, int] = {}
    place = Carried(0, np.eye(4), False)
    links = {base: place}
    for joint in path:
        words += displacement_words(joint.origin)
        place = replace(place, transform=place.transform @ joint.origin)
        if joint.name in masters:
            moved, place = _write_joint(joint, *masters[joint.name], numbers, place, source)
            words += moved
        if joint.child in marked:
            words.append(f"[{marked[joint.child]}]")
        links[joint.child] = place
    return UrdfChain(" ".join(words), tuple(named[name] for name in numbers), links)


def _write_joint(
    joint: Joint, master: str, sign: float, offset: float, numbers: dict[str, int], place: Carried, source: str
) -> tuple[list[str], Carried]:
    """Words of a joint that moves, and where it carries what is behind it."""
    # Of a shorter axis the direction is no more than rounding.
    if not np.linalg.norm(joint.axis) > 1e-9:
        raise InputError(source, f"joint {joint.name!r}: axis xyz", " ".join(f"{part:g}" for part in joint.axis), "a direction")
    kind = _MOVING[joint.kind]
    before, letter, minus, after = express_axis(joint.axis)
    negative, offset = (minus == "-") != (sign < 0), -offset if minus else offset
    fixed, passive = word(f"{kind}{letter}", offset), master in numbers
    number = numbers.setdefault(master, len(numbers) + 1)
    words = [*before, *([fixed] if fixed else []), f"{kind}{letter}({'-' if negative else ''}q{number})", *after]
    turn = homogeneous(axis_rotation(joint.axis))
    if not passive:
        return words, Carried(number, turn.T, False)
    step = turn @ elementary(kind, "xyz".index(letter), offset) @ turn.T
    return words, Carried(place.body, place.transform @ step, place.behind_passive or kind == "R")


def _path(urdf: Urdf, base: str, tip: str, source: str) -> list[Joint]:
    names, both = [*urdf.moments], f"base {base!r}, tip {tip!r}"
    for key, name in (("base", base), ("tip", tip)):
        if name not in names:
            raise InputError(source, key, repr(name), f"a link: {closest_first(name, names)}")
    path = urdf.path_to(tip, base)
    if base != (path[0].parent if path else tip):
        turned = any(joint.parent == tip for joint in urdf.joints_above(base))
        found = "a base that the tip carries (give them the other way round)" if turned else "two branches of the tree"
        raise InputError(source, both, found, "a tip that the base carries")
    if not any(joint.kind in _MOVING for joint in path):
        raise InputError(source, both, "no joint that moves between them", "links with joints between")
    if wrong := next((joint for joint in path if joint.kind not in (*_MOVING, "fixed")), None):
        raise InputError(source, f"joint {wrong.name!r}", f"type {wrong.kind}", " | ".join((*_MOVING, "fixed")))
    return path


def _masters(urdf: Urdf, path: Sequence[Joint], source: str) -> dict[str, tuple[str, float, float]]:
    """By name of each joint that moves: the joint of the chain whose coordinate it has, +1 or -1 of it, and an offset."""
    mimics = {joint.name: joint.mimic for joint in urdf.joints}
    kinds = {joint.name: _MOVING[joint.kind] for joint in path if joint.kind in _MOVING}
    masters = {}
    for name in kinds:
        master, factor, offset, seen = name, 1.0, 0.0, {name}
        while (mimic := mimics[master]) is not None:
            called, (followed, multiplier, shift) = f"joint {master!r}: mimic", mimic
            if followed not in kinds:
                raise InputError(source, called, repr(followed), f"a joint that moves in the chain: {', '.join(kinds)}")
            if followed in seen:
                raise InputError(source, called, f"a loop back to {followed!r}", "a joint that mimics no other in the end")
            master, factor, offset = followed, factor * multiplier, offset + factor * shift
            seen.add(master)
        if abs(factor) != 1.0 or kinds[master] != kinds[name]:
            found = f"{factor:g} times {master!r}" if kinds[master] == kinds[name] else f"{master!r}, which moves otherwise"
            raise InputError(source, f"joint {name!r}: mimic", found, "a joint of the same type with multiplier 1 or -1")
        masters[name] = (master, math.copysign(1.0, factor), offset)
    return masters


def _weights(urdf: Urdf, chain: UrdfChain, relative_std: float) -> tuple[list[dict[str, Any]], list[str]]:
    """Entries of ``masses`` of a robot file, see `mechanics.robot_file`, and what is to be said of them."""
    moments: dict[int, np.ndarray] = {}
    at_zero, passive = set(), set()
    for name, moment in urdf.moments.items():
        path = [*takewhile(lambda joint: joint.child not in chain.links, urdf.joints_above(name))]
        carrier = chain.links.get(path[-1].parent if path else name)
        moved = [joint.name for joint in path if joint.kind != "fixed"]
        # What moves beside the column weighs on no joint of the chain.
        if not moment[3] or carrier is None or (carrier.body == 0 and moved):
            continue
        at_zero.update(moved)
        passive |= {name} if carrier.behind_passive else set()
        for joint in path:
            moment = joint.origin @ moment
        moments[carrier.body] = moments.get(carrier.body, np.zeros(4)) + carrier.transform @ moment
    alike = {float(moment[3]) for moment in moments.values()}
    if len(moments) >= _FEWEST_ALIKE and len(alike) == 1:
        return [], [f"every link weighs {alike.pop():g} kg: placeholders, which are left out"]
    notes = [] if moments else ["no masses: the weight of the links is not known"]
    if passive:
        notes.insert(0, f"behind a passive joint, but weighing as if it did not turn: {first_names(sorted(passive), _NAMED)}")
    if at_zero:
        held = first_names(sorted(at_zero), _NAMED)
        notes.insert(0, f"joints beside the chain are held at zero for what they carry: {held}")
    return mass_entries(moments, relative_std), notes
